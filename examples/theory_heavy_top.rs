//! Lagrange's top: its axis nutates while it precesses. Prints
//! `t,axis_x,axis_y,axis_z,energy_error,vertical_error,axial_error`.

use vi_core::problems::heavy_top;
use vi_core::rotations::{RigidState, cayley, rotate};
use vi_core::{CoreError, Scheme};

fn main() -> Result<(), CoreError> {
    let top = heavy_top(1.0, 0.4, 2.0, 0.7);
    let mut state = RigidState {
        t: 0.0,
        place: [0.0; 3],
        turn: cayley(&[0.6, 0.0, 0.0]),
        momentum: [0.0; 3],
        spin: [0.0, 0.0, 3.0],
    };
    let initial = (top.energy(&state)?, state.spatial_spin()[2], state.spin[2]);
    let scheme = Scheme::gauss(2)?;
    println!("t,axis_x,axis_y,axis_z,energy_error,vertical_error,axial_error");
    for _ in 0..1500 {
        let [x, y, z] = rotate(&state.turn, &[0.0, 0.0, 1.0]);
        let energy = top.energy(&state)? - initial.0;
        let (vertical, axial) = (state.spatial_spin()[2] - initial.1, state.spin[2] - initial.2);
        println!("{},{x},{y},{z},{energy},{vertical},{axial}", state.t);
        state = top.step(&scheme, &state, 0.02)?;
    }
    Ok(())
}
