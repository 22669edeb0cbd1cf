//! An elastic bar of twenty finite elements as a handwritten Lagrangian: the moving bar is stopped at its end, and a
//! wave follows. Prints `t,middle,tip,energy_error`.

use vi_core::discrete::DiscreteLagrangian;
use vi_core::lagrange::{energy, velocities};
use vi_core::problems::Bar;
use vi_core::{CoreError, Scheme, State};

fn main() -> Result<(), CoreError> {
    let bar = Bar { element_count: 20, length: 1.0, area: 0.01, young: 1e6, density: 1000.0 };
    let n = bar.element_count;
    let discrete = DiscreteLagrangian::new(&bar, &Scheme::implicit_midpoint(), 5e-4)?;
    // The whole bar moves at 0.1 m/s when its end is stopped.
    let mass = bar.density * bar.area * bar.length / n as f64;
    let p = (1..=n).map(|k| 0.1 * mass * if k == n { 0.5 } else { 1.0 }).collect();
    let mut state = State { t: 0.0, q: vec![0.0; n], p };
    let total = |s: &State| -> Result<f64, CoreError> {
        let v = velocities(&bar, s.t, &s.q, &s.p)?;
        Ok(energy(&bar, s.t, &s.q, v.as_slice()))
    };
    let initial = total(&state)?;
    println!("t,middle,tip,energy_error");
    for _ in 0..400 {
        let error = total(&state)? / initial - 1.0;
        println!("{},{},{},{error}", state.t, state.q[n / 2 - 1], state.q[n - 1]);
        state = discrete.step(&state)?;
    }
    Ok(())
}
