//! The law of the lever as virtual work: the arm of the third of three masses is varied; the lever is in equilibrium
//! if Σ m r = 0. Prints `arm,virtual_work,moment,rest_angle`.

use nalgebra::DVector;
use vi_core::generalised::Embedded;
use vi_core::problems::Lever;
use vi_core::statics::{AtRest, equilibria, virtual_work};

fn main() {
    println!("arm,virtual_work,moment,rest_angle");
    for k in 0..=40 {
        let arm = 4.0 + 0.2 * k as f64;
        let lever = Lever { loads: vec![(2.0, -3.0), (1.0, 2.0), (0.5, arm)], gravity: 9.81 };
        let moment = lever.moment();
        let energy = AtRest(Embedded(lever));
        let level = DVector::zeros(1);
        let work = virtual_work(&energy, 0.0, &level, &DVector::from_element(1, 1.0));
        // If unbalanced, the only stable equilibrium has the heavy side straight down.
        let starts: Vec<Vec<f64>> = (0..7).map(|k| vec![-1.4 + 0.47 * k as f64]).collect();
        let found = equilibria(&energy, 0.0, &starts, 1e-6);
        let rest = found.iter().find(|e| e.is_stable()).map_or(f64::NAN, |e| e.q[0]);
        println!("{arm},{work},{moment},{rest}");
    }
}
