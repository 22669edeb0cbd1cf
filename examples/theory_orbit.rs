//! An orbit of eccentricity 0.6 for 200 time units: energy and angular momentum of each scheme.
//! Prints `scheme,t,x,y,energy_error,momentum_error`.

use vi_core::problems::Kepler;
use vi_core::{CoreError, Scheme, reference};

fn main() -> Result<(), CoreError> {
    let problem = Kepler::<2> { mu: 1.0 };
    let system = problem.system()?;
    let start = problem.pericentre(0.6);
    let (h, end) = (0.05, 200.0_f64);
    println!("scheme,t,x,y,energy_error,momentum_error");
    for (name, scheme) in [
        ("symplectic-euler-a", Scheme::symplectic_euler_a()),
        ("stormer-verlet", Scheme::stormer_verlet()),
        ("implicit-midpoint", Scheme::implicit_midpoint()),
        ("gauss-2", Scheme::gauss(2)?),
        ("gauss-3", Scheme::gauss(3)?),
    ] {
        let mut state = start.clone();
        for _ in 0..(end / h).round() as usize {
            let error = problem.energy(&state) - problem.energy(&start);
            let momentum = problem.angular_momentum(&state) - problem.angular_momentum(&start);
            println!("{name},{},{},{},{error},{momentum}", state.t, state.q[0], state.q[1]);
            state = reference::step(&system, &scheme, &state, h)?;
        }
    }
    Ok(())
}
