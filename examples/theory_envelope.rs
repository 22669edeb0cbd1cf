//! A million steps of the pendulum: the envelope of the energy error, window by window, does not drift. Prints
//! `window,low,high`.

use vi_core::diagnostics::Envelope;
use vi_core::problems::Pendulum;
use vi_core::{CoreError, Scheme, State, reference};

fn main() -> Result<(), CoreError> {
    let problem = Pendulum::unit();
    let system = problem.system()?;
    let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    let initial = problem.energy(&state);
    let mut envelope = Envelope::new(20_000);
    for _ in 0..1_000_000 {
        state = reference::step(&system, &Scheme::stormer_verlet(), &state, 0.1)?;
        envelope.enter(problem.energy(&state) - initial);
    }
    println!("window,low,high");
    for (k, (low, high)) in envelope.extremes().iter().enumerate() {
        println!("{k},{low},{high}");
    }
    eprintln!("spread {:e}, drift {:e}", envelope.spread(), envelope.drift());
    Ok(())
}
