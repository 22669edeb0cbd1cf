//! A free rigid body that rotates about its intermediate axis flips periodically. Prints
//! `t,spin1,spin2,spin3,energy_error,momentum_error` for Gauss-2 over four periods.

use vi_core::problems::{flip_period, free_body};
use vi_core::rotations::{RigidState, identity};
use vi_core::{CoreError, Scheme};

fn main() -> Result<(), CoreError> {
    let moments = [1.0, 2.0, 3.0];
    let body = free_body(moments);
    let mut state =
        RigidState { t: 0.0, place: [0.0; 3], turn: identity(), momentum: [0.0; 3], spin: [0.02, 1.0, 0.01] };
    let period = flip_period(moments, state.spin);
    eprintln!("period of the flip (two turns over): {period:.12}");
    let (energy, initial) = (body.energy(&state)?, state.spatial_spin());
    let scheme = Scheme::gauss(2)?;
    println!("t,spin1,spin2,spin3,energy_error,momentum_error");
    for _ in 0..800 {
        let [a, b, c] = state.spin;
        let now = state.spatial_spin();
        let momentum = (0..3).map(|k| (now[k] - initial[k]).abs()).fold(0.0, f64::max);
        println!("{},{a},{b},{c},{},{momentum}", state.t, body.energy(&state)? - energy);
        state = body.step(&scheme, &state, period / 200.0)?;
    }
    Ok(())
}
