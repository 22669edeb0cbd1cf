//! Poincaré sections of the Hénon–Heiles system at two energies: curves for regular motion, scattered points for
//! chaotic motion. Prints `energy,orbit,y,py`.

use vi_core::diagnostics::Section;
use vi_core::problems::HenonHeiles;
use vi_core::{CoreError, Scheme, State, reference};

fn main() -> Result<(), CoreError> {
    let system = HenonHeiles.system()?;
    let section = Section { coordinate: 0, level: 0.0 };
    let rate = |s: &State| {
        let slope = reference::gradient(&system, &s.q, s.t);
        (s.p.clone(), slope.iter().map(|slope| -slope).collect())
    };
    println!("energy,orbit,y,py");
    for energy in [1.0 / 12.0, 1.0 / 8.0] {
        let starts = [(-0.2, 0.0), (0.0, 0.05), (0.1, 0.1), (0.25, 0.0), (0.35, 0.0), (0.0, 0.3)];
        for (orbit, (y, p_y)) in starts.into_iter().enumerate() {
            let Some(mut state) = HenonHeiles.on_section(energy, y, p_y) else { continue };
            for _ in 0..20_000 {
                let next = reference::step(&system, &Scheme::stormer_verlet(), &state, 0.05)?;
                if let Some(hit) = section.crossing(&state, &next, rate) {
                    println!("{energy},{orbit},{},{}", hit.q[1], hit.p[1]);
                }
                state = next;
            }
        }
    }
    Ok(())
}
