//! Runs the scenes of scenes/validation on meshes that take seconds, against published and independent numbers.
//! docs/validation.md lists all digits.

use std::path::{Path, PathBuf};

use variational::prelude::{Scene, Simulation};
use variational::scene::MassKind;
use variational::study::modes::scene_modes;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/validation").join(name)
}

fn scene(name: &str, overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    let parsed = Scene::read(&file(name), &overrides).unwrap();
    assert!(parsed.problems.is_empty(), "{name}: {:?}", parsed.problems);
    parsed.scene.unwrap()
}

/// Runs a scene to its end.
fn run(name: &str, overrides: &[&str]) -> Simulation {
    let mut simulation = Simulation::new(scene(name, overrides)).unwrap();
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    simulation
}

/// Returns the displacement of the first probe at the end.
fn displacement(name: &str, overrides: &[&str]) -> [f64; 3] {
    run(name, overrides).observe().probes[0].displacement
}

/// Checks that `found` is `exact` within a relative tolerance.
fn close(found: f64, exact: f64, tolerance: f64, what: &str) {
    let error = (found / exact - 1.0).abs();
    assert!(error < tolerance, "{what}: {found:.8e} instead of {exact:.8e}, off by {error:.1e}");
}

fn frequencies(name: &str, overrides: &[&str], count: usize) -> Vec<f64> {
    let mut simulation = Simulation::new(scene(name, overrides)).unwrap();
    let modes = scene_modes(&mut simulation, count, MassKind::Consistent).unwrap().modes;
    modes.iter().map(|found| found.mode.frequency()).collect()
}

#[test]
fn every_scene_is_sound() {
    let mut count = 0;
    for entry in std::fs::read_dir(file("")).unwrap() {
        let path = entry.unwrap().path();
        let parsed = Scene::read(&path, &[]).unwrap();
        assert!(parsed.problems.is_empty(), "{}: {:?}", path.display(), parsed.problems);
        count += 1;
    }
    assert!(count >= 15);
}

#[test]
fn b1_turek_hron_csm1_and_csm2() {
    for (name, u, v) in [("csm1.toml", -7.1878e-3, -66.103e-3), ("csm2.toml", -0.46901e-3, -16.974e-3)] {
        let [ux, uy, _] = displacement(name, &[]);
        close(ux, u, 2e-4, name);
        close(uy, v, 1e-4, name);
    }
}

#[test]
fn c1_cook_membrane_in_plane_stress_and_plane_strain() {
    let [_, v, _] = displacement("cook-plane-stress.toml", &["body.0.refine=0"]);
    close(v, 23.968, 2e-4, "plane stress");
    let [_, v, _] = displacement("cook-plane-strain.toml", &["body.0.refine=0"]);
    close(v, 30.749, 3e-4, "plane strain");
}

#[test]
fn c1_cook_membrane_of_neo_hookean_matter() {
    let mut simulation = run("cook-neo-hookean.toml", &["body.0.refine=0"]);
    let seen = simulation.observe();
    let [u, v, _] = seen.probes[0].displacement;
    close(u, -4.2875, 1e-3, "u");
    close(v, 7.8927, 1e-3, "v");
    close(seen.elastic / 0.1, 372.91, 1e-3, "energy");
}

/// At ν = 0.4999 plain hex8 lock. With mean dilation they come as close as hex20 on the same mesh.
#[test]
fn nearly_incompressible_cook_membrane_does_not_lock() {
    let v = |overrides: &[&str]| displacement("cook-incompressible.toml", overrides)[1];
    let reference = v(&["body.0.refine=0", "body.0.order=2", "body.0.locking='none'"]);
    let cured = v(&["body.0.refine=0"]);
    let locked = v(&["body.0.refine=0", "body.0.locking='none'"]);
    assert!((cured / reference - 1.0).abs() < 0.03, "{cured} {reference}");
    assert!(locked / reference < 0.75, "{locked} {reference}");
}

/// A cylinder of incompressible neo-Hookean material satisfies r² = R² + a² − A² and p = ∫ μ(λ² − λ⁻²)/r dr, with
/// λ = r/R.
#[test]
fn nearly_incompressible_cylinder_does_not_lock() {
    let (inner, outer, at) = (1.0_f64, 2.0_f64, 1.25_f64);
    let count = 2000;
    let shear = 1.0 / (2.0 * 1.4999);
    let term = |k: usize| {
        let rest = inner + (outer - inner) * (k as f64 + 0.5) / f64::from(count);
        let r = (rest * rest + at * at - inner * inner).sqrt();
        // The integral is over R: dr = R/r dR.
        shear * ((r / rest).powi(2) - (rest / r).powi(2)) / r * (rest / r)
    };
    let pressure: f64 = (0..count as usize).map(term).sum::<f64>() * (outer - inner) / f64::from(count);
    let load = format!("load.0.pressure={pressure:.12}");
    let with = |cure: &str| {
        let cure = format!("body.0.locking='{cure}'");
        displacement("cylinder.toml", &["body.0.material.poisson=0.4999", &load, &cure])[0]
    };
    // Quadratic elements are slightly too stiff; mean dilation removes that.
    close(with("none"), 0.25, 1e-2, "hex27");
    close(with("mean-dilation"), 0.25, 1e-3, "mean dilation");
}

#[test]
fn c2_elastica() {
    let mut simulation = Simulation::new(scene("elastica.toml", &["body.0.box.cells=[64,1,1]"])).unwrap();
    let mut exact = [(1.0, 0.05643324, 0.30172077), (2.0, 0.16064172, 0.49345748)].into_iter().peekable();
    while let Some(&(t, u, w)) = exact.peek() {
        simulation.step().unwrap();
        if (simulation.time() - t).abs() < 1e-9 {
            let [ux, uy, _] = simulation.observe().probes[0].displacement;
            close(-ux, u, 5e-4, "shortening");
            close(-uy, w, 5e-4, "deflection");
            exact.next();
        }
    }
}

#[test]
fn c4_thick_shells_under_following_pressure() {
    for (name, outer, overrides) in
        [("cylinder.toml", 2.166355317, &["time.step=0.5"]), ("sphere.toml", 2.105691444, &["time.step=1.0"])]
    {
        let seen = run(name, overrides).observe();
        close(seen.probes[0].position[0], 1.25, 1e-5, name);
        close(seen.probes[1].position[0], outer, 1e-5, name);
    }
}

#[test]
fn c6_uniaxial_stretch_and_its_reactions() {
    let simulation = run("uniaxial.toml", &[]);
    let mesh = &simulation.bodies()[0].mesh;
    let (x, held) = (simulation.positions(0), simulation.reactions(0));
    let far = mesh.region_nodes("x-max").unwrap();
    let force: f64 = far.iter().map(|&node| held[node as usize][0]).sum();
    close(force, 0.6467446602, 1e-9, "P11/E");
    for (x, rest) in x.iter().zip(&mesh.points) {
        for k in 1..3 {
            assert!((x[k] - 0.7980775445 * rest[k]).abs() < 1e-9, "{x:?}");
        }
    }
}

/// If the m-th derivative of a wave jumps, a scheme of order 2 converges with order 2m/3 in the maximum norm (Brenner,
/// Thomée & Wahlbin 1975): 4/3 under gravity, 2/3 under a tip force. Steps are in units of ℓ/c.
#[test]
fn b5_bar_waves() {
    let gravity = |t: f64| 1e-3 * (0.5 * t * t - (t - 1.0).max(0.0).powi(2));
    let force = |t: f64| 1e-3 * (2.0 - (t - 2.0).abs());
    let largest_error = |name: &str, mass: &str, step: f64, halved: u32, exact: &dyn Fn(f64) -> f64| {
        let (cells, step) = (20 << halved, step / f64::from(20 << halved));
        let overrides = [
            format!("body.0.box.cells=[{cells},1,1]"),
            format!("time.step={step}"),
            format!("solver.mass=\"{mass}\""),
        ];
        let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
        let mut simulation = Simulation::new(scene(name, &overrides)).unwrap();
        let mut worst = 0.0_f64;
        while !simulation.is_done() {
            simulation.step().unwrap();
            let tip = simulation.observe().probes[0].displacement[0];
            worst = worst.max((tip - exact(simulation.time())).abs());
        }
        worst / exact(2.0)
    };
    for (name, exact, order, bounds) in [
        ("bar-gravity.toml", &gravity as &dyn Fn(f64) -> f64, 4.0 / 3.0, [4.2e-4, 2.7e-4, 4e-5]),
        ("bar-force.toml", &force, 2.0 / 3.0, [1.2e-2, 1e-2, 4e-3]),
    ] {
        for (mass, bound) in [("lumped", bounds[0]), ("consistent", bounds[1])] {
            let errors = [0, 1, 2].map(|halved| largest_error(name, mass, 0.4, halved, exact));
            let found = [0, 1].map(|k| (errors[k] / errors[k + 1]).log2());
            assert!(
                errors[2] < bound && found.iter().all(|found| (found - order).abs() < 0.1),
                "{name}, {mass}: {errors:?} {found:?}"
            );
        }
        // The phase error of consistent mass (κ²/24, too fast) cancels that of the midpoint rule with h = ℓ/(√2 c) (too
        // slow).
        let least = largest_error(name, "consistent", std::f64::consts::FRAC_1_SQRT_2, 2, exact);
        assert!(least < bounds[2], "{name}: {least}");
    }
}

#[test]
fn e2_lame_mode_of_the_free_cube() {
    let omega: Vec<f64> = frequencies("cube-modes-octant.toml", &["body.0.box.cells=[4,4,4]"], 6)
        .iter()
        .map(|frequency| std::f64::consts::TAU * frequency)
        .collect();
    // The exact Lamé frequency is √2 π √(G/ρ) with G = 1/2.6; it belongs to a pair of modes.
    let exact = 2.0_f64.sqrt() * std::f64::consts::PI * (1.0 / 2.6_f64).sqrt();
    close(omega[0], exact, 5e-5, "Lamé");
    close(omega[1], exact, 5e-5, "Lamé");
}

#[test]
fn e4_nafems_fv32() {
    let exact = [44.617, 130.01, 162.69, 245.98, 379.71, 391.40];
    for (found, exact) in frequencies("fv32.toml", &[], 6).into_iter().zip(exact) {
        close(found, exact, 1.5e-3, "FV32");
    }
}
