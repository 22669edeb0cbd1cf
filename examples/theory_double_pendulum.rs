//! A double pendulum with two joints, and a second one displaced by 1e-9: the motion is chaotic, yet the energy is
//! conserved. Prints `t,x,z,energy_error,distance`.

use vi_core::discrete::DiscreteLagrangian;
use vi_core::lagrange::{energy, velocities};
use vi_core::problems::double_pendulum;
use vi_core::{CoreError, Scheme, State};

fn main() -> Result<(), CoreError> {
    let (lengths, h) = ([1.0, 1.0], 0.01);
    let linkage = double_pendulum([1.0, 1.0], lengths, 9.81)?;
    let discrete = DiscreteLagrangian::new(&linkage, &Scheme::gauss(2)?, h)?;
    let mut state = State { t: 0.0, q: vec![2.0, 0.5], p: vec![0.0, 0.0] };
    let mut near = State { q: vec![2.0 + 1e-9, 0.5], ..state.clone() };
    let total = |s: &State| -> Result<f64, CoreError> {
        let v = velocities(&linkage, s.t, &s.q, &s.p)?;
        Ok(energy(&linkage, s.t, &s.q, v.as_slice()))
    };
    let initial = total(&state)?;
    println!("t,x,z,energy_error,distance");
    for _ in 0..2500 {
        let poses = linkage.poses(&state.q);
        let (elbow, turn) = poses[1];
        let (x, z) = (elbow[0] - turn[0][2] * lengths[1], elbow[2] - turn[2][2] * lengths[1]);
        let distance = (state.q[0] - near.q[0]).hypot(state.q[1] - near.q[1]);
        println!("{},{x},{z},{},{distance}", state.t, total(&state)? - initial);
        state = discrete.step(&state)?;
        near = discrete.step(&near)?;
    }
    Ok(())
}
