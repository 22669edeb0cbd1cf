//! A bead on a rotating hoop: follows its equilibria as the angular velocity grows, through the bifurcation at ω =
//! √(g/r), with their stability and the frequency of small oscillations. Prints
//! `branch,omega,angle,stable,frequency`.

use vi_core::CoreError;
use vi_core::problems::BeadOnHoop;
use vi_core::statics::{Equilibrium, bifurcation_between, equilibria, follow};

fn main() -> Result<(), CoreError> {
    let bead = BeadOnHoop { radius: 1.0, gravity: 9.81, omega: 0.0 };
    println!("branch,omega,angle,stable,frequency");
    let print = |name: &str, branch: &[Equilibrium]| {
        for e in branch {
            let frequency = e.curvatures[0].max(0.0).sqrt();
            println!("{name},{},{},{},{frequency}", e.parameter, e.q[0].to_degrees(), e.is_stable());
        }
    };
    let down = equilibria(&bead, 0.5, &[vec![3.1]], 1e-6).remove(0);
    let down = follow(&bead, &down, 0.1, 55)?;
    let up = equilibria(&bead, 0.5, &[vec![0.1]], 1e-6).remove(0);
    let tilted = equilibria(&bead, 6.0, &[vec![1.9]], 1e-6).remove(0);
    print("down", &down);
    print("up", &follow(&bead, &up, 0.1, 55)?);
    print("tilted", &follow(&bead, &tilted, -0.05, 55)?);
    for pair in down.windows(2).filter(|pair| pair[0].is_stable() != pair[1].is_stable()) {
        let at = bifurcation_between(&bead, &pair[0], &pair[1], 1e-12)?;
        eprintln!("bifurcation at ω = {:.10}, √(g/r) = {:.10}", at.parameter, 9.81_f64.sqrt());
    }
    Ok(())
}
