//! The harmonic oscillator in phase space: variational steps conserve area and bound the energy; the two Euler
//! methods do not. Prints `scheme,t,q,p,energy`.

use vi_core::problems::Oscillator;
use vi_core::{CoreError, Scheme, State, reference};

fn main() -> Result<(), CoreError> {
    let problem = Oscillator::with_frequency(1.0);
    let system = problem.system()?;
    let h = 0.2;
    let start = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    println!("scheme,t,q,p,energy");
    let print = |name: &str, s: &State| {
        println!("{name},{},{},{},{}", s.t, s.q[0], s.p[0], problem.energy(s));
    };
    for (name, scheme) in [
        ("symplectic-euler-a", Scheme::symplectic_euler_a()),
        ("stormer-verlet", Scheme::stormer_verlet()),
        ("implicit-midpoint", Scheme::implicit_midpoint()),
        ("gauss-2", Scheme::gauss(2)?),
    ] {
        let mut state = start.clone();
        for _ in 0..150 {
            print(name, &state);
            state = reference::step(&system, &scheme, &state, h)?;
        }
    }
    // Not variational: each step multiplies the phase area by 1 + h² or its inverse.
    let (mut forward, mut backward) = (start.clone(), start);
    for _ in 0..150 {
        print("forward-euler", &forward);
        print("backward-euler", &backward);
        let (q, p) = (forward.q[0], forward.p[0]);
        forward = State { t: forward.t + h, q: vec![q + h * p], p: vec![p - h * q] };
        let (q, p, scale) = (backward.q[0], backward.p[0], 1.0 / (1.0 + h * h));
        backward = State { t: backward.t + h, q: vec![(q + h * p) * scale], p: vec![(p - h * q) * scale] };
    }
    Ok(())
}
