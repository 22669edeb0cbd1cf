//! The free particle, for which every scheme is exact, and the mass–spring system in two ways: the discrete
//! Euler–Lagrange equations of the action and Newton's equation give the same numbers, step by step. Prints
//! `t,free,free_exact,spring_by_action,spring_by_newton,spring_exact`.

use vi_core::discrete::DiscreteLagrangian;
use vi_core::{CoreError, Scheme, State, lagrangian};

fn main() -> Result<(), CoreError> {
    let (h, omega) = (0.2_f64, 1.0_f64);
    let free = lagrangian!(1; |_t, _q, v| v[0] * v[0] * 0.5);
    let spring = lagrangian!(1; [omega] |_t, q, v| (v[0] * v[0] - q[0] * q[0] * (omega * omega)) * 0.5);
    let fly = DiscreteLagrangian::new(&free, &Scheme::implicit_midpoint(), h)?;
    let swing = DiscreteLagrangian::new(&spring, &Scheme::stormer_verlet(), h)?;
    let mut particle = State { t: 0.0, q: vec![1.0], p: vec![0.5] };
    let mut by_action = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    // Newton: m (q_{k+1} − 2 q_k + q_{k−1})/h² = F(q_k), started with half a kick.
    let (mut before, mut now) = (1.0, 1.0 - 0.5 * h * h * omega * omega);
    println!("t,free,free_exact,spring_by_action,spring_by_newton,spring_exact");
    for k in 0..=100 {
        let t = k as f64 * h;
        let (x, q) = (particle.q[0], by_action.q[0]);
        println!("{t},{x},{},{q},{before},{}", 1.0 + 0.5 * t, (omega * t).cos());
        particle = fly.step(&particle)?;
        by_action = swing.step(&by_action)?;
        (before, now) = (now, 2.0 * now - before - h * h * omega * omega * now);
    }
    Ok(())
}
