//! Tests scenes with `mass = "filtered"`: momenta, free fall, equal bits, longer steps, an error of long waves that falls
//! with the square of the size of elements, and clear errors where the mass must be lumped.

use crate::consistent_mass::{assert_momenta, simulation};
use crate::program::Program;
use variational::prelude::{Scene, settle};
use variational::simulation::stability::highest;

const FREE: &str = r#"
    [time]
    end = 0.2
    step = 5e-4
    scheme = "SCHEME"
    [solver]
    mass = "filtered"
    [[body]]
    name = "block"
    box = { size = [1.0, 0.5, 0.25], cells = [4, 2, 1], element = "ELEMENT" }
    material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
    velocity = [1.0, -0.5, 2.0]
    angular_velocity = [4.0, -3.0, 2.0]
    [[body]]
    name = "cloth"
    sheet = { size = [0.6, 0.4], cells = [6, 4], origin = [0.0, 0.0, 1.0] }
    material = { law = "st-venant-kirchhoff", young = 1e4, poisson = 0.3, density = 500.0, thickness = 1e-3 }
    angular_velocity = [1.0, 2.0, 3.0]
    [[spring]]
    from = { body = "block", node = 0 }
    to = { body = "cloth", node = 0 }
    stiffness = 50.0
"#;

#[test]
fn free_bodies_of_every_kind_keep_their_momenta() {
    for (scheme, element) in [
        ("stormer-verlet", "tet4"),
        ("blanes-moan-4", "hex8"),
        ("symplectic-euler-a", "tet10"),
        ("stormer-verlet", "hex20"),
        ("blanes-moan-6", "wedge6"),
    ] {
        let mut simulation = simulation(&FREE.replace("SCHEME", scheme).replace("ELEMENT", element));
        let before = simulation.observe();
        // The sum of the momenta is that of lumped mass.
        let (m, v) = (125.0_f64, [1.0, -0.5, 2.0_f64]);
        for k in 0..3 {
            assert!((before.momentum[k] - m * v[k]).abs() < 1e-10 * m, "{element}: {:?}", before.momentum);
        }
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let after = simulation.observe();
        assert_momenta(&before, &after, 1e-11, &format!("{scheme} {element}"));
        let drift = (after.total() - before.total()).abs() / before.kinetic;
        assert!(drift < 1e-2, "{scheme} {element}: {drift:e}");
    }
}

#[test]
fn free_fall_keeps_the_shape_and_the_parabola() {
    let scene = FREE
        .replace("SCHEME", "stormer-verlet")
        .replace("ELEMENT", "tet10")
        .replace("angular_velocity = [4.0, -3.0, 2.0]", "")
        .replace("angular_velocity = [1.0, 2.0, 3.0]", "velocity = [1.0, -0.5, 2.0]");
    let mut simulation = simulation(&format!("gravity = [0.0, 0.0, -9.81]\n{scene}"));
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let t: f64 = 0.2;
    let fallen = [1.0 * t, -0.5 * t, 2.0 * t - 0.5 * 9.81 * t * t];
    for body in 0..2 {
        for (x, rest) in simulation.positions(body).iter().zip(&simulation.bodies()[body].mesh.points) {
            for k in 0..3 {
                assert!((x[k] - rest[k] - fallen[k]).abs() < 1e-11, "{body}: {x:?} {rest:?}");
            }
        }
    }
}

fn cantilever(mass: &str, cells: usize) -> String {
    format!(
        r#"
        [time]
        end = 0.1
        step = 1e-4
        scheme = "stormer-verlet"
        [solver]
        mass = "{mass}"
        [[body]]
        name = "beam"
        box = {{ size = [1.0, 0.25, 0.25], cells = [{}, {cells}, {cells}] }}
        material = {{ law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0 }}
        velocity = [0.0, "0.1*sin(1.5708*x)*sin(1.5708*x)", 0.0]
        [[fix]]
        body = "beam"
        region = "x-min"
        "#,
        4 * cells
    )
}

/// The kinetic energy of given momenta p = M v is ½ pᵀM⁻¹p with lumped mass and ½ pᵀW p with a filter. For a smooth v, they
/// differ by (½ P'(0) + …) vᵀL v, which falls with the square of the size of elements.
#[test]
fn long_waves_are_changed_by_the_square_of_the_size_of_elements() {
    let difference = |cells: usize| {
        let energies = ["lumped", "filtered"].map(|mass| {
            let simulation = simulation(&cantilever(mass, cells));
            let component = &simulation.components()[0];
            let (system, state) = (component.system(), component.state());
            let velocity = system.velocity(&state.p);
            let p: Vec<f64> = velocity.iter().zip(system.free_mass()).map(|(v, m)| v * m).collect();
            kinetic_of(system, &p)
        });
        (energies[0] - energies[1]) / energies[0]
    };
    let [coarse, middle, fine] = [2, 4, 8].map(difference);
    assert!(fine > 0.0 && fine < 0.01, "{fine}");
    assert!(coarse / middle > 3.3 && middle / fine > 3.6, "{coarse} {middle} {fine}");
}

fn kinetic_of(system: &variational::core::System, p: &[f64]) -> f64 {
    0.5 * system.velocity(p).iter().zip(p).map(|(v, p)| v * p).sum::<f64>()
}

#[test]
fn the_limit_of_solids_and_sheets_is_more_than_twice_as_long() {
    let cloth = |mass: &str| {
        format!(
            r#"
            [time]
            end = 0.1
            step = 1e-5
            scheme = "stormer-verlet"
            [solver]
            mass = "{mass}"
            [[body]]
            name = "cloth"
            sheet = {{ size = [1.0, 1.0], cells = [12, 12] }}
            material = {{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }}
            [[fix]]
            body = "cloth"
            region = "x-min"
            "#
        )
    };
    let omega = |scene: &str| highest(&simulation(scene)).unwrap().unwrap();
    for [lumped, filtered] in
        [["lumped", "filtered"].map(|mass| cantilever(mass, 4)), ["lumped", "filtered"].map(cloth)]
    {
        let ratio = omega(&lumped) / omega(&filtered);
        assert!(ratio > 2.0 && ratio < 3.0, "{ratio}");
    }
}

#[test]
fn threads_do_not_change_the_bits() {
    let scene = FREE
        .replace("SCHEME", "stormer-verlet")
        .replace("ELEMENT", "tet4")
        .replace("[4, 2, 1]", "[16, 8, 8]")
        .replace("[6, 4]", "[40, 30]")
        .replace("step = 5e-4", "step = 1e-4")
        .replace("end = 0.2", "end = 0.01");
    for history in [0, 1] {
        let output = format!(
            "[output]\nhistory = {history}\ninterval = 0.005\nfields = [\"displacement\", \"velocity\"]\n"
        );
        let scene = format!("{scene}{output}");
        Program::assert_same_on_threads(&scene);
    }
}

#[test]
fn auto_chooses_among_explicit_schemes() {
    let scene = cantilever("filtered", 2)
        .replace("scheme = \"stormer-verlet\"", "scheme = \"auto\"")
        .replace("step = 1e-4", "tolerance = 1e-2");
    let (settled, _) = settle(Scene::parse(&scene, &[]).scene.unwrap(), &mut ()).unwrap();
    assert!(settled.time.method().unwrap().facts().is_explicit);
}

#[test]
fn what_needs_lumped_mass_says_so() {
    let scene = cantilever("filtered", 1);
    let implicit = scene.replace("stormer-verlet", "implicit-midpoint");
    let statics = format!("{scene}\n[static]\n");
    let damped = format!("{scene}\n[damping]\nmass_rate = 1.0\n");
    let moving = scene.replace(
        "region = \"x-min\"",
        "region = \"x-min\"\nmotion = { kind = \"sine\", amplitude = [0.1, 0.0, 0.0], frequency = 1.0 }",
    );
    let rigid = format!(
        "{scene}\n[[rigid]]\nname = \"ball\"\nshape = {{ kind = \"sphere\", radius = 0.1 }}\nmass = 1.0\n[[attach]]\nbody = \
         \"beam\"\nregion = \"x-max\"\nto = \"ball\"\n"
    );
    for (scene, word) in [
        (implicit, "stormer-verlet"),
        (statics, "static"),
        (damped, "damping"),
        (moving, "supports move"),
        (rigid, "rigid"),
    ] {
        let program = Program::try_run(&scene, &[]);
        let said = program.errors();
        assert!(program.output.status.code() == Some(2) && said.contains("solver.mass"), "{said}");
        assert!(said.contains(word), "{said}");
    }
}

/// On a coarse mesh the filter makes moments of inertia larger. A note says by how much, which is what angular momenta show; a held
/// body does not turn, and needs none.
#[test]
fn a_note_tells_how_much_inertia_grows() {
    let beam = |mass: &str, spin: [f64; 3], fix: &str| {
        let scene = format!(
            r#"
            [time]
            end = 0.1
            step = 1e-3
            scheme = "stormer-verlet"
            [solver]
            mass = "{mass}"
            [[body]]
            name = "beam"
            box = {{ size = [1.0, 0.3, 0.3], cells = [6, 2, 2], element = "hex8" }}
            material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
            angular_velocity = {spin:?}
            {fix}
            "#
        );
        simulation(&scene)
    };
    let mut largest = 0.0_f64;
    for axis in 0..3 {
        let mut spin = [0.0; 3];
        spin[axis] = 3.0;
        let [filtered, lumped] =
            ["filtered", "lumped"].map(|mass| beam(mass, spin, "").observe().angular_momentum[axis]);
        largest = largest.max(filtered / lumped - 1.0);
    }
    assert!(largest > 1.0, "{largest}");
    let told = beam("filtered", [0.0; 3], "").notes().join("\n");
    assert!(told.contains(&format!("'beam' larger by {:.1} %", 100.0 * largest)), "{largest}: {told}");
    for other in [
        beam("lumped", [0.0; 3], ""),
        beam("filtered", [0.0; 3], "[[fix]]\nbody = \"beam\"\nregion = \"x-min\""),
    ] {
        assert!(!other.notes().join("\n").contains("inertia"));
    }
}
