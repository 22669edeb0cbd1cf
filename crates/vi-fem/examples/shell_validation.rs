//! Compares plates and shells with reference cases on refined meshes, structured and unstructured, and prints
//! Markdown: `cargo run --release -p vi-fem --example shell_validation > docs/validation-shells.md`. Arguments: the
//! name of a case, or a case and a pattern.

#[path = "../tests/plates/annulus.rs"]
mod annulus;
#[path = "../tests/plates/cases.rs"]
mod cases;
#[path = "../tests/plates/cloth.rs"]
mod cloth;
#[path = "../tests/plates/skyline.rs"]
mod skyline;
#[path = "../tests/plates/structure.rs"]
mod structure;

use cases::Outcome;
use vi_mesh::SheetPattern;

const PATTERNS: [(SheetPattern, &str); 3] =
    [(SheetPattern::Diagonal, "diagonal"), (SheetPattern::Cross, "cross"), (SheetPattern::Random, "random")];

/// Prints a table of the largest error on each mesh with the observed order, and the values on the finest mesh.
fn table(title: &str, limit: f64, cells: &[[u32; 2]], run: impl Fn([u32; 2], SheetPattern) -> Outcome) {
    println!("\n## {title}\n\nRequired: {:.1} %.\n", 100.0 * limit);
    println!("| pattern | cells | triangles | largest error | at | order |\n|---|---|---|---|---|---|");
    let mut finest = Vec::new();
    let wanted = std::env::args().nth(2);
    let patterns: Vec<_> = PATTERNS
        .into_iter()
        .filter(|(_, name)| wanted.as_deref().is_none_or(|wanted| wanted == *name))
        .collect();
    for &(pattern, name) in &patterns {
        let mut previous: Option<(f64, usize)> = None;
        for &mesh in cells {
            let outcome = run(mesh, pattern);
            let error = outcome.worst();
            let at = outcome.values.iter().find(|value| value.3 == error).map_or("", |value| &value.0);
            let order = previous.map_or("".into(), |(last, count)| {
                let refined = (outcome.triangles as f64 / count as f64).sqrt();
                format!("{:.2}", (last / error).ln() / refined.ln())
            });
            let [nx, ny] = mesh;
            println!(
                "| {name} | {nx} × {ny} | {} | {:.3} % | {at} | {order} |",
                outcome.triangles,
                100.0 * error
            );
            previous = Some((error, outcome.triangles));
            if Some(&mesh) == cells.last() {
                finest.push(outcome);
            }
        }
    }
    let names: Vec<&str> = patterns.iter().map(|(_, name)| *name).collect();
    println!("\nOn the finest meshes:\n\n| | reference | {} |", names.join(" | "));
    println!("|---|---|{}", "---|".repeat(names.len()));
    for row in 0..finest.first().map_or(0, |outcome| outcome.values.len()) {
        let (what, _, reference, _) = &finest[0].values[row];
        let found: Vec<String> =
            finest.iter().map(|outcome| format!("{:.6}", outcome.values[row].1)).collect();
        println!("| {what} | {reference:.6} | {} |", found.join(" | "));
    }
}

fn main() {
    let chosen = std::env::args().nth(1);
    let wants = |name: &str| chosen.as_deref().is_none_or(|chosen| chosen == name);
    println!("# Validation of the `shell` model\n");
    println!(
        "Made by `cargo run --release -p vi-fem --example shell_validation > docs/validation-shells.md`."
    );
    println!("Static equilibria by Newton's method, frequencies by subspace iteration, all with the");
    println!(
        "potentials of `bending = \"shell\"` and `law = \"st-venant-kirchhoff\"`. The error of a mesh is"
    );
    println!("its largest over all values of the case; `cells` are those of the sheet generator.");
    if wants("shear") {
        let cells = [[20, 2], [40, 4], [80, 8]];
        table("Cantilever, end shear (D1)", 0.005, &cells, cases::end_shear);
    }
    if wants("moment") {
        let cells = [[48, 2], [96, 4], [192, 8]];
        table("Cantilever, end moment to a full circle (D1)", 0.01, &cells, cases::end_moment);
    }
    if wants("weight") {
        let cells = [[32, 2], [64, 4], [128, 8]];
        table("Plate strip under its own weight (C3)", 0.005, &cells, cases::self_weight);
    }
    if wants("buckling") {
        let cells = [[100, 2], [200, 4], [400, 8]];
        table("Lateral buckling (D2)", 0.01, &cells, cases::lateral_buckling);
        println!(
            "\nThe reference is a beam's; the clamped end keeps a plate, here 100 times as long as deep,"
        );
        println!("from warping, so refinement ends at a load .55 % higher.");
    }
    for supports in ["free", "CFFF", "clamped", "supported"] {
        if wants(supports) {
            let run = |cells: [u32; 2], pattern| cases::plate(supports, cells[0], pattern);
            let cells = [[10, 10], [20, 20], [40, 40], [80, 80]];
            table(&format!("Square plate, {supports}: frequencies ω a² √(ρh/D) (E1)"), 0.01, &cells, run);
        }
    }
    if wants("catenary") {
        let cells = [[16, 2], [32, 2], [64, 4]];
        table("Catenary, a stiff strip of three lengths (D3)", 0.005, &cells, cloth::catenary);
    }
    if wants("chain") {
        let cells = [[20, 1], [40, 1], [80, 1], [160, 1]];
        table("Hanging chain: frequencies ω√(L/g) of a strip (D3)", 0.01, &cells, cloth::chain);
        println!("\nEach mode stands for as many as the strip has fibres; the worst of them is shown.");
    }
    if wants("drum") {
        let cells = [[12, 12], [24, 24], [48, 48]];
        table("Circular drum: frequencies ωR/c (D3)", 0.01, &cells, cloth::drum);
        println!("\nThe mesh is that of a square moved onto the disc.");
    }
    if wants("rolled") {
        let cells = [[10, 10], [20, 20], [40, 40], [80, 80]];
        table(
            "Rolled sheet: bending energy over ½ D A/R² in twelve directions (D3)",
            0.01,
            &cells,
            cloth::rolled,
        );
    }
    if wants("annulus") {
        let cells = [[60, 4], [120, 8], [240, 16]];
        table("Slit annulus (D1)", 0.015, &cells, annulus::slit_annulus);
    }
}
