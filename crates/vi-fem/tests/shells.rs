//! Tests the `shell` model against reference cases, on structured and unstructured meshes that are as coarse as the
//! limits allow; `examples/shell_validation.rs` refines them further.

#[path = "plates/cases.rs"]
mod cases;
#[path = "plates/cloth.rs"]
mod cloth;
#[path = "plates/skyline.rs"]
mod skyline;
#[path = "plates/structure.rs"]
mod structure;

use cases::Outcome;
use vi_mesh::SheetPattern;

fn within(limit: f64, run: impl Fn(SheetPattern) -> Outcome) {
    for pattern in [SheetPattern::Diagonal, SheetPattern::Random] {
        let outcome = run(pattern);
        for (what, value, reference, error) in &outcome.values {
            assert!(
                *error <= limit,
                "{pattern:?}, {} triangles, {what}: {value} for {reference}, {error:.2e} off",
                outcome.triangles
            );
        }
    }
}

#[test]
fn a_cantilever_under_end_shear_is_an_elastica() {
    within(0.005, |pattern| cases::end_shear([20, 2], pattern));
}

#[test]
fn a_cantilever_under_end_moment_rolls_up_to_a_circle() {
    within(0.01, |pattern| cases::end_moment([48, 2], pattern));
}

#[test]
fn a_strip_hangs_under_its_own_weight_as_an_elastica() {
    within(0.005, |pattern| cases::self_weight([32, 2], pattern));
}

#[test]
fn a_strip_on_edge_buckles_sideways_at_its_critical_load() {
    within(0.01, |pattern| cases::lateral_buckling([100, 2], pattern));
}

#[test]
fn plates_sound_at_kirchhoff_frequencies() {
    within(0.01, |pattern| cases::plate("free", 30, pattern));
    within(0.01, |pattern| cases::plate("CFFF", 30, pattern));
    within(0.01, |pattern| cases::plate("supported", 40, pattern));
    within(0.01, |pattern| cases::plate("clamped", 48, pattern));
}

#[test]
fn frequencies_converge_at_second_order_on_any_mesh() {
    for pattern in [SheetPattern::Diagonal, SheetPattern::Cross, SheetPattern::Random] {
        for supports in ["free", "supported"] {
            let [coarse, fine] = [12, 24].map(|cells| cases::plate(supports, cells, pattern).worst());
            let order = (coarse / fine).log2();
            assert!(order > 1.8, "{pattern:?}, {supports}: order {order}");
        }
    }
}

#[test]
fn a_stiff_strip_hangs_as_a_catenary() {
    within(0.005, |pattern| cloth::catenary([32, 2], pattern));
}

#[test]
fn a_hanging_strip_swings_as_a_chain() {
    within(0.01, |pattern| cloth::chain([80, 1], pattern));
}

#[test]
fn a_circular_drum_sounds_at_the_zeros_of_bessels_functions() {
    within(0.01, |pattern| cloth::drum([24, 24], pattern));
}

#[test]
fn a_rolled_sheet_has_the_energy_of_its_curvature_in_any_direction() {
    within(0.01, |pattern| cloth::rolled([40, 40], pattern));
}
