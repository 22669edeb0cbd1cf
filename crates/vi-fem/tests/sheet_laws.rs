//! Tests the laws that every membrane × bending model must obey, on flat and curved rest shapes.

use vi_core::{HessianKind, Potential, packed_len};
use vi_fem::{Bending, Direction, FemError, IsotropicSheet, Sheet, SheetLaw};
use vi_mesh::{CellBlock, CellKind, Mesh, SheetMesh, SheetPattern};

fn sheet_mesh(size: [f64; 2], cells: [u32; 2], pattern: SheetPattern) -> Mesh {
    let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    SheetMesh { size, cells, pattern, seed: 7, origin: [0.0; 3], directions }.build().unwrap()
}

/// Returns a saddle, so that the rest shape has curvature of both signs.
fn curved(mut mesh: Mesh) -> Mesh {
    for p in &mut mesh.points {
        p[2] = 0.4 * p[0] * p[0] - 0.3 * p[1] * p[1] + 0.2 * p[0] * p[1];
    }
    mesh
}

fn potentials(
    mesh: &Mesh,
    law: &SheetLaw,
    clamped: &[[u32; 2]],
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let elements = mesh.cells_of_dimension(2);
    Sheet { clamped, ..Sheet::new(mesh, &elements, law, 0, "flag") }.potentials()
}

/// Returns positions with a large smooth deformation and a deterministic ripple.
fn deformed(mesh: &Mesh) -> Vec<f64> {
    let mut x = Vec::new();
    for (n, p) in mesh.points.iter().enumerate() {
        let ripple = |k: usize| 0.01 * ((3 * n + k) as f64 * 1.7).sin();
        x.push(1.1 * p[0] + 0.2 * p[1] + ripple(0));
        x.push(0.95 * p[1] - 0.1 * p[0] + ripple(1));
        x.push(p[2] + 0.3 * (2.0 * p[0] + p[1]).sin() + ripple(2));
    }
    x
}

/// Returns the deformed positions with the part beyond x = ½ folded back over the rest by `angle`, rad.
fn folded(mesh: &Mesh, angle: f64) -> Vec<f64> {
    let mut x = deformed(mesh);
    let (sine, cosine) = angle.sin_cos();
    for p in x.chunks_exact_mut(3).filter(|p| p[0] > 0.5) {
        let (along, up) = (p[0] - 0.5, p[2]);
        (p[0], p[2]) = (0.5 + along * cosine - up * sine, along * sine + up * cosine);
    }
    x
}

fn count(potential: &dyn Potential) -> usize {
    potential.stencils().count()
}

fn gradients(potential: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; count(potential) * potential.stencils().size()];
    potential.gradients(0..count(potential), x, 0.0, &mut out);
    out
}

fn energies(potential: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; count(potential)];
    potential.energies(0..count(potential), x, 0.0, &mut out);
    out
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

fn first_law(bending: Bending) -> SheetLaw {
    SheetLaw::examples().remove(0).with_bending(bending)
}

fn tension_fields() -> Vec<SheetLaw> {
    let relax = |law: SheetLaw| law.with_bending(Bending::None).with_tension_field(true);
    SheetLaw::examples().into_iter().map(relax).collect()
}

/// Returns every law × bending model on every rest shape that it accepts, and the tension fields.
fn cases() -> Vec<(SheetLaw, Mesh)> {
    let flat = sheet_mesh([1.0, 0.8], [4, 3], SheetPattern::Random);
    let mut cases = Vec::new();
    for law in SheetLaw::examples() {
        for &bending in Bending::ALL {
            let law = law.clone().with_bending(bending);
            cases.push((law.clone(), flat.clone()));
            if bending != Bending::Quadratic {
                cases.push((law, curved(flat.clone())));
            }
        }
    }
    cases.extend(tension_fields().into_iter().map(|law| (law, flat.clone())));
    cases
}

/// Returns the edge of the first line cell, on `x-min`.
fn first_side(mesh: &Mesh) -> [u32; 2] {
    let block = mesh.blocks.iter().find(|block| block.kind == CellKind::Line2).unwrap();
    [block.nodes[0], block.nodes[1]]
}

#[test]
fn derivatives_are_those_of_the_energy() {
    let shapes = |mesh: &Mesh| [deformed(mesh), folded(mesh, 2.8)];
    for (law, mesh, x) in
        cases().into_iter().flat_map(|(law, mesh)| shapes(&mesh).map(|x| (law.clone(), mesh.clone(), x)))
    {
        for potential in potentials(&mesh, &law, &[first_side(&mesh)]).unwrap() {
            let (size, total, step) = (potential.stencils().size(), count(&*potential), 1e-6);
            let what = format!("{} {law:?}", potential.name());
            let gradient = gradients(&*potential, &x);
            let mut hessian = vec![0.0; total * packed_len(size)];
            potential.hessians(0..total, &x, 0.0, &mut hessian);
            let (force, stiffness) = (largest(&gradient), largest(&hessian));
            for stencil in [0, total / 2, total - 1] {
                let nodes = potential.stencils().of(stencil).to_vec();
                for n in 0..size {
                    let dof = 3 * nodes[n / 3] as usize + n % 3;
                    let at = |h: f64| {
                        let mut x = x.clone();
                        x[dof] += h;
                        let (mut energy, mut slope) = ([0.0], vec![0.0; size]);
                        potential.energies(stencil..stencil + 1, &x, 0.0, &mut energy);
                        potential.gradients(stencil..stencil + 1, &x, 0.0, &mut slope);
                        (energy[0], slope)
                    };
                    let (plus, minus) = (at(step), at(-step));
                    let slope = (plus.0 - minus.0) / (2.0 * step);
                    let entry = gradient[stencil * size + n];
                    let allowed = 1e-7 * force + 1e-9 * stiffness;
                    assert!((slope - entry).abs() < allowed, "{what}: gradient {n}: {slope} {entry}");
                    for m in 0..=n {
                        let slope = (plus.1[m] - minus.1[m]) / (2.0 * step);
                        let entry = hessian[stencil * packed_len(size) + n * (n + 1) / 2 + m];
                        assert!(
                            (slope - entry).abs() < 1e-6 * stiffness,
                            "{what}: hessian {n} {m}: {slope} {entry}"
                        );
                    }
                }
            }
        }
    }
}

/// Without contact a fold can pass through itself. The work of the forces on the way equals the gain of energy.
#[test]
fn bending_is_smooth_where_a_fold_goes_through_itself() {
    for bending in [Bending::Hinge, Bending::Shell] {
        for pattern in [SheetPattern::Diagonal, SheetPattern::Random] {
            let flat = sheet_mesh([1.0, 0.8], [4, 3], pattern);
            for mesh in [flat.clone(), curved(flat)] {
                let all = potentials(&mesh, &first_law(bending), &[]).unwrap();
                let bend = all.iter().filter(|potential| potential.name().contains("bending"));
                let (mut gain, mut work, mut force) = (0.0, 0.0, 0.0);
                for potential in bend {
                    let (from, to, count) = (2.9, 3.5, 600);
                    let energy = |angle| energies(&**potential, &folded(&mesh, angle)).iter().sum::<f64>();
                    gain += energy(to) - energy(from);
                    let step = (to - from) / f64::from(count);
                    for k in 0..count {
                        let at = |part: f64| folded(&mesh, from + (f64::from(k) + part) * step);
                        let (before, middle, after) = (at(0.0), at(0.5), at(1.0));
                        let stencils = potential.stencils();
                        let gradient = gradients(&**potential, &middle);
                        for (stencil, block) in gradient.chunks_exact(stencils.size()).enumerate() {
                            for (n, g) in block.iter().enumerate() {
                                let dof = 3 * stencils.of(stencil)[n / 3] as usize + n % 3;
                                work += g * (after[dof] - before[dof]);
                                force += (g * (after[dof] - before[dof])).abs();
                            }
                        }
                    }
                }
                assert!((work - gain).abs() < 1e-6 * force, "{bending:?} {pattern:?}: {work} {gain} {force}");
            }
        }
    }
}

#[test]
fn energies_feel_no_rigid_motion_and_forces_have_no_sum_and_no_torque() {
    // A rotation by 2 rad about (1, 2, 2)/3.
    let axis = [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
    let (s, c) = 2f64.sin_cos();
    let rotate = |p: &[f64]| -> [f64; 3] {
        let dot: f64 = (0..3).map(|i| axis[i] * p[i]).sum();
        std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            c * p[i] + s * (axis[j] * p[k] - axis[k] * p[j]) + (1.0 - c) * dot * axis[i]
        })
    };
    for (law, mesh) in cases() {
        let x = deformed(&mesh);
        let shift = [5.0, -3.0, 1.0];
        let moved: Vec<f64> =
            x.chunks_exact(3).flat_map(|p| [0, 1, 2].map(|i| rotate(p)[i] + shift[i])).collect();
        for potential in potentials(&mesh, &law, &[]).unwrap() {
            let what = format!("{} {law:?}", potential.name());
            let here: f64 = energies(&*potential, &x).iter().sum();
            let there: f64 = energies(&*potential, &moved).iter().sum();
            assert!((here - there).abs() < 1e-10 * here, "{what}: {here} {there}");
            let size = potential.stencils().size();
            let gradient = gradients(&*potential, &x);
            for (stencil, block) in gradient.chunks_exact(size).enumerate() {
                let (mut force, mut torque) = ([0.0; 3], [0.0; 3]);
                for (g, &node) in block.chunks_exact(3).zip(potential.stencils().of(stencil)) {
                    let p = &x[3 * node as usize..][..3];
                    for i in 0..3 {
                        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                        force[i] += g[i];
                        torque[i] += p[j] * g[k] - p[k] * g[j];
                    }
                }
                let worst = largest(&force).max(largest(&torque));
                assert!(worst < 1e-11 * largest(&gradient), "{what}: {worst}");
            }
        }
    }
}

#[test]
fn a_sheet_at_rest_has_no_force_flat_or_curved() {
    for (law, mesh) in cases() {
        let x = mesh.points.as_flattened();
        for potential in potentials(&mesh, &law, &[first_side(&mesh)]).unwrap() {
            let scale = largest(&gradients(&*potential, &deformed(&mesh)));
            let worst = largest(&gradients(&*potential, x));
            assert!(worst <= 1e-12 * scale, "{} {law:?}: {worst} of {scale}", potential.name());
        }
    }
}

#[test]
fn blocks_do_not_depend_on_the_batch_and_projected_ones_are_not_negative() {
    for (law, mesh) in cases() {
        let x = deformed(&mesh);
        for potential in potentials(&mesh, &law, &[]).unwrap() {
            let (size, total) = (potential.stencils().size(), count(&*potential));
            let whole = gradients(&*potential, &x);
            for stencil in 0..total {
                let mut one = vec![0.0; size];
                potential.gradients(stencil..stencil + 1, &x, 0.0, &mut one);
                assert_eq!(one, whole[stencil * size..][..size]);
            }
            let mut blocks = vec![0.0; total * packed_len(size)];
            potential.projected_hessians(0..total, &x, 0.0, &mut blocks);
            for block in blocks.chunks_exact(packed_len(size)) {
                let full = nalgebra::DMatrix::from_fn(size, size, |i, j| {
                    let (row, column) = (i.max(j), i.min(j));
                    block[row * (row + 1) / 2 + column]
                });
                let values = full.symmetric_eigenvalues();
                assert!(values.min() >= -1e-12 * values.max(), "{} {law:?}", potential.name());
            }
            let is_constant = potential.traits().hessian == HessianKind::Constant;
            let is_quadratic = law.parameters().common().bending == Bending::Quadratic;
            assert_eq!(is_constant, is_quadratic && potential.name() == "flag: bending");
        }
    }
}

/// On right-angled triangles with diagonals along (1, 1), a cylinder in the direction α bends the three hinges of a
/// cell by κl(c² + cs), κl(s² + cs) and −√2 κl cs. The energy is thus 1 + sin 2α + sin² 2α times that of the plate:
/// exact along the legs, ¾ to 3 times in other directions.
#[test]
fn hinges_depend_on_the_mesh_as_they_must() {
    let (cells, radius) = (40, 5.0);
    let mesh = sheet_mesh([1.0, 1.0], [cells, cells], SheetPattern::Diagonal);
    for bending in [Bending::Hinge, Bending::Quadratic] {
        let law = first_law(bending);
        let stiffness = law.parameters().common().thickness.powi(3) / 12.0 * law.parameters().moduli()[0][0];
        let bent = &potentials(&mesh, &law, &[]).unwrap()[1];
        for step in 0..12 {
            let angle = f64::from(step) * std::f64::consts::PI / 12.0;
            let (s, c) = angle.sin_cos();
            let roll = |p: &[f64; 3]| {
                let (along, across) = ((c * p[0] + s * p[1]) / radius, c * p[1] - s * p[0]);
                let x = radius * along.sin();
                let z = radius * (1.0 - along.cos());
                [c * x - s * across, s * x + c * across, z]
            };
            let x: Vec<f64> = mesh.points.iter().flat_map(roll).collect();
            let mut energy = 0.0;
            for (stencil, value) in energies(&**bent, &x).into_iter().enumerate() {
                // Select edges with midpoints in a square of 20 × 20 cells: one hinge of each kind per cell.
                let [a, b] = [0, 1].map(|k| mesh.points[bent.stencils().of(stencil)[k] as usize]);
                if (0..2).all(|i| (0.25 - 1e-9..0.75 - 1e-9).contains(&(0.5 * (a[i] + b[i])))) {
                    energy += value;
                }
            }
            let ratio = energy / (0.5 * stiffness * 0.25 / (radius * radius));
            let twice = (2.0 * angle).sin();
            let expected = 1.0 + twice + twice * twice;
            assert!((ratio / expected - 1.0).abs() < 1e-3, "{bending:?} at {angle} rad: {ratio} {expected}");
        }
    }
}

#[test]
fn curvature_of_both_signs_and_twist_is_exact_for_small_quadratic_shapes() {
    // w = ½ (κ₁₁x² + 2κ₁₂xy + κ₂₂y²), so small that the sheet hardly stretches.
    let law = first_law(Bending::Shell);
    let moduli = law.parameters().moduli();
    let inertia = law.parameters().common().thickness.powi(3) / 12.0;
    for pattern in [SheetPattern::Diagonal, SheetPattern::Cross, SheetPattern::Random] {
        let mesh = sheet_mesh([1.0, 1.0], [12, 12], pattern);
        for curvature in [[1e-4, 0.0, 0.0], [1e-4, -1e-4, 0.0], [0.0, 0.0, 2e-4], [1e-4, 1e-4, 0.5e-4]] {
            let lift = |p: &[f64; 3]| {
                let twist = curvature[2] * p[0] * p[1];
                [p[0], p[1], 0.5 * (curvature[0] * p[0] * p[0] + twist + curvature[1] * p[1] * p[1])]
            };
            let x: Vec<f64> = mesh.points.iter().flat_map(lift).collect();
            let form = |i: usize| (0..3).map(|j| curvature[i] * moduli[i][j] * curvature[j]).sum::<f64>();
            let density = 0.5 * inertia * (0..3).map(form).sum::<f64>();
            let mut checked = 0;
            for potential in potentials(&mesh, &law, &[]).unwrap().iter().skip(1) {
                for (stencil, energy) in energies(&**potential, &x).into_iter().enumerate() {
                    let nodes = potential.stencils().of(stencil);
                    let corners: Vec<[f64; 3]> = nodes.iter().map(|&n| mesh.points[n as usize]).collect();
                    if corners.iter().any(|p| p[..2].iter().any(|&c| !(1e-9..=1.0 - 1e-9).contains(&c))) {
                        continue;
                    }
                    let [a, b, c] = [corners[0], corners[1], corners[2]];
                    let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
                    let ratio = energy / (density * area);
                    assert!((ratio - 1.0).abs() < 1e-6, "{pattern:?} {curvature:?}: {ratio}");
                    checked += 1;
                }
            }
            assert!(checked > 100);
        }
    }
}

#[test]
fn a_wrinkled_sheet_bears_no_compression() {
    for mut law in tension_fields() {
        if let SheetLaw::Orthotropic(parameters) = &mut law {
            parameters.warp = Direction::Constant([1.0, 0.0, 0.0]);
        }
        let mesh = sheet_mesh([1.0, 1.0], [2, 2], SheetPattern::Cross);
        let scaled = |x: f64, y: f64| -> Vec<f64> {
            mesh.points.iter().flat_map(|p| [x * p[0], y * p[1], 0.0]).collect()
        };
        let (squeezed, pulled) = (scaled(0.9, 0.8), scaled(1.1, 0.5));
        let membrane = &potentials(&mesh, &law, &[]).unwrap()[0];
        assert!(energies(&**membrane, &squeezed).iter().all(|&e| e == 0.0));
        assert!(energies(&**membrane, &pulled).iter().all(|&e| e > 0.0));
        let sideways: Vec<f64> = gradients(&**membrane, &pulled).chunks_exact(3).map(|g| g[1]).collect();
        assert!(largest(&sideways) < 1e-9, "{law:?}");
    }
}

/// The general tension field of an orthotropic law agrees with Pipkin's if the law is isotropic.
#[test]
fn tension_fields_agree_where_laws_do() {
    let mesh = sheet_mesh([1.0, 0.8], [6, 5], SheetPattern::Random);
    let isotropic = SheetLaw::examples().remove(0).with_bending(Bending::None).with_tension_field(true);
    let SheetLaw::StVenantKirchhoff(IsotropicSheet { young, poisson, .. }) = isotropic else { panic!() };
    let text = format!(
        r#"{{ "law": "orthotropic", "young_warp": {young}, "young_weft": {young}, "poisson": {poisson},
              "shear": {}, "warp": [1.0, 0.3, 0.0], "density": 1000.0, "thickness": 1e-2,
              "bending": "none", "tension_field": true }}"#,
        young / (2.0 * (1.0 + poisson))
    );
    let woven: SheetLaw = serde_json::from_str(&text).unwrap();
    let [one, two] = [isotropic, woven].map(|law| potentials(&mesh, &law, &[]).unwrap().remove(0));
    // In-plane waves give taut, wrinkled and slack triangles.
    let x: Vec<f64> = mesh
        .points
        .iter()
        .flat_map(|p| [p[0] + 0.05 * (9.0 * p[0] + 4.0 * p[1]).sin(), p[1] + 0.04 * (7.0 * p[1]).cos(), 0.0])
        .collect();
    let [a, b] = [&one, &two].map(|potential| (energies(&**potential, &x), gradients(&**potential, &x)));
    assert!(a.0.contains(&0.0) && a.0.iter().any(|&e| e > 0.0));
    let scale = (largest(&a.0), largest(&a.1));
    assert!(a.0.iter().zip(&b.0).all(|(a, b)| (a - b).abs() < 1e-10 * scale.0));
    assert!(a.1.iter().zip(&b.1).all(|(a, b)| (a - b).abs() < 1e-9 * scale.1));
}

#[test]
fn what_a_model_cannot_do_is_said() {
    let mesh = curved(sheet_mesh([1.0, 1.0], [3, 3], SheetPattern::Diagonal));
    let message = potentials(&mesh, &first_law(Bending::Quadratic), &[]).err().unwrap().to_string();
    assert!(message.contains("flat at rest"), "{message}");
    let message = potentials(&mesh, &first_law(Bending::Hinge), &[[0, 15]]).err().unwrap().to_string();
    assert!(message.contains("not the ends of a boundary edge"), "{message}");
}

#[test]
fn leaves_of_a_book_bend_as_hinges() {
    let points = vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.5, 0.0], [-0.5, 0.5, 0.8], [-0.5, 0.5, -0.8]];
    let blocks = vec![CellBlock { kind: CellKind::Tri3, nodes: vec![0, 1, 2, 0, 1, 3, 0, 1, 4] }];
    let mesh = Mesh { points, blocks, regions: vec![] };
    for bending in [Bending::Hinge, Bending::Shell] {
        let bent = potentials(&mesh, &first_law(bending), &[]).unwrap();
        let pairs: usize = bent.iter().skip(1).map(|potential| count(&**potential)).sum();
        assert_eq!(pairs, 3);
        let mut x = mesh.points.as_flattened().to_vec();
        assert!(largest(&gradients(&*bent[1], &x)) < 1e-12);
        x[8] += 0.1;
        assert!(energies(&*bent[1], &x).iter().sum::<f64>() > 0.0);
    }
}

/// A reported quantity is really outside its domain: for collapsed, overflowing and NaN positions.
#[test]
fn a_fault_names_a_quantity_that_is_outside_its_domain() {
    let mesh = sheet_mesh([1.0, 1.0], [1, 1], SheetPattern::Diagonal);
    let rest: Vec<f64> = mesh.points.as_flattened().to_vec();
    let states: Vec<Vec<f64>> =
        [[0.0, 1.0], [3.9e9, 1.0], [1e9, 1e-9], [1e12, 1e-7], [1e160, 1.0], [f64::NAN, 1.0]]
            .iter()
            .flat_map(|stretch| {
                // Stretch along the axes, and in a direction in which the strain of a line loses its width to
                // round-off.
                let place = |p: &[f64], turn: f64| {
                    let (along, across) = (p[0] + turn * p[1], p[1] - turn * p[0]);
                    [stretch[0] * along, stretch[1] * across, p[2]]
                };
                [0.0, 0.37].map(|turn| rest.chunks_exact(3).flat_map(|p| place(p, turn)).collect())
            })
            .collect();
    let mut faults = 0;
    for law in SheetLaw::examples() {
        for term in potentials(&mesh, &law, &[]).unwrap().iter().filter(|term| term.stencils().arity == 3) {
            for x in &states {
                for stencil in 0..term.stencils().count() {
                    let Some(fault) = term.fault(stencil, x, 0.0) else { continue };
                    let is_inside = fault.value.is_finite()
                        && (fault.value > 0.0 || !fault.domain.starts_with("must be positive"));
                    assert!(!is_inside, "{}: {fault:?}", term.name());
                    faults += 1;
                }
            }
        }
    }
    assert!(faults > 10, "{faults}");
}
