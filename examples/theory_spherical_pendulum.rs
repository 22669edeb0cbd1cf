//! The spherical pendulum as a particle on a sphere, in three ways: multipliers (RATTLE), projection after a free
//! step, and a plain symplectic step with the differentiated constraint, which drifts off the sphere. Prints
//! `method,t,x,y,z,off_surface,energy_error`.

use vi_core::constraints::Rattle;
use vi_core::problems::{Sphere, SphericalPendulum};
use vi_core::{CoreError, Scheme, State, kinetic_energy, reference};

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn main() -> Result<(), CoreError> {
    let pendulum = SphericalPendulum { length: 1.0, gravity: 1.0 };
    let system = pendulum.particle()?;
    let rattle = Rattle::new(&system, Sphere(1.0));
    let (h, steps) = (0.05, 4000);
    let start = State { t: 0.0, q: vec![0.6, 0.0, -0.8], p: vec![0.0, 0.9, 0.0] };
    let verlet = Scheme::stormer_verlet();
    // Projection: a free step, then q back to the sphere and p to its tangent plane.
    let project = |state: &State| -> Result<State, CoreError> {
        let mut next = reference::step(&system, &verlet, state, h)?;
        let length = dot(&next.q, &next.q).sqrt();
        next.q.iter_mut().for_each(|q| *q /= length);
        let normal = dot(&next.p, &next.q);
        next.p.iter_mut().zip(&next.q).for_each(|(p, q)| *p -= normal * q);
        Ok(next)
    };
    // The force is −∇V − λ q with λ = |p|² − q·∇V (twice differentiated constraint), in kicks and drifts.
    let drift_off = |state: &State| -> Result<State, CoreError> {
        let kick = |q: &[f64], p: &[f64]| -> Vec<f64> {
            let lambda = dot(p, p) - q[2];
            (0..3).map(|k| -lambda * q[k] - if k == 2 { 1.0 } else { 0.0 }).collect()
        };
        let mut next = state.clone();
        let force = kick(&next.q, &next.p);
        next.p.iter_mut().zip(&force).for_each(|(p, f)| *p += h * f);
        let p = next.p.clone();
        next.q.iter_mut().zip(&p).for_each(|(q, p)| *q += h * p);
        next.t += h;
        Ok(next)
    };
    println!("method,t,x,y,z,off_surface,energy_error");
    let energy = |s: &State| kinetic_energy(&system, s) + s.q[2];
    type Step<'a> = &'a dyn Fn(&State) -> Result<State, CoreError>;
    let by_rattle = |s: &State| rattle.step(s, h);
    let methods: [(&str, Step); 3] =
        [("rattle", &by_rattle), ("projection", &project), ("differentiated", &drift_off)];
    for (name, step) in methods {
        let mut state = start.clone();
        for _ in 0..steps {
            let q = &state.q;
            let off = dot(q, q).sqrt() - 1.0;
            let error = energy(&state) - energy(&start);
            println!("{name},{},{},{},{},{off},{error}", state.t, q[0], q[1], q[2]);
            state = step(&state)?;
        }
    }
    Ok(())
}
