//! The planar pendulum: energy error and shadow energy of Störmer–Verlet for three steps, and the measured period
//! compared with the elliptic integral. Prints `h,t,q,p,energy_error,shadow_error`.

use vi_core::diagnostics::verlet_shadow;
use vi_core::problems::Pendulum;
use vi_core::{CoreError, Scheme, State, reference};

fn main() -> Result<(), CoreError> {
    let problem = Pendulum::unit();
    let system = problem.system()?;
    let start = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    println!("h,t,q,p,energy_error,shadow_error");
    for h in [0.2, 0.1, 0.05] {
        let mut state = start.clone();
        let (energy, shadow) = (problem.energy(&start), verlet_shadow(&system, &start, h));
        while state.t < 40.0 {
            let (q, p) = (state.q[0], state.p[0]);
            let error = problem.energy(&state) - energy;
            println!("{h},{},{q},{p},{error},{}", state.t, verlet_shadow(&system, &state, h) - shadow);
            state = reference::step(&system, &Scheme::stormer_verlet(), &state, h)?;
        }
    }
    for amplitude in [0.5, 1.0, 2.0, 3.0] {
        eprintln!("period of amplitude {amplitude}: {:.14}", problem.period(amplitude));
    }
    Ok(())
}
