//! Measures the memory of ranks: it falls with their number.
#![cfg(target_os = "linux")]

mod launch;

use std::path::{Path, PathBuf};

use launch::files::assert_in_parts;
use launch::memory::peaks;
use launch::scenes::{BLOCK, BOX_OF_BLOCK, FIX_OF_BLOCK};
use launch::{part, room, run_well, scene_in};

/// A block of little memory, and one of 331 776 tetrahedra. Both run long enough to be seen at their peaks.
const SIZES: [(&str, &str, &str); 2] = [("small", "[8, 8, 8]", "0.01"), ("large", "[72, 32, 24]", "2e-3")];

/// Numbers of ranks, and the memory that the first and another may need for a mesh, as parts of that of one process. Measured:
/// .54 and .44 on two ranks, .26 and .28 on four, with a parted mesh, too. Open MPI 4.1 has larger buffers, which take up to .13 more.
const LIMITS: [(usize, f64, f64); 2] = [(2, 0.66, 0.65), (4, 0.42, 0.42)];

/// Returns the scene of a block of so many cells.
fn block(cells: &str, end: &str) -> String {
    let text = BLOCK.replace("[24, 6, 6]", cells).replace("end = 0.02", &format!("end = {end}"));
    text.replace("step = 2.5e-4", "step = 2e-5").replace("interval = 0.01\n", "")
}

/// Asserts that the memory of a large mesh, beyond that of a small one, falls.
fn assert_falls(room: &Path, [small, large]: &[PathBuf; 2]) {
    let mesh_needs = |ranks: usize| {
        let (base, peaks) = (peaks(ranks, small, &room.join("s")), peaks(ranks, large, &room.join("l")));
        if ranks > 1 {
            assert_in_parts(&room.join("l"));
        }
        (peaks[0] - base[0], peaks[ranks - 1] - base[ranks - 1])
    };
    let (one, _) = mesh_needs(1);
    for (ranks, largest, smallest) in LIMITS {
        let (first, other) = mesh_needs(ranks);
        let facts = format!(
            "{ranks} ranks: {first:.0} MiB on the first, {other:.0} MiB on another, {one:.0} MiB on one"
        );
        assert!(first <= largest * one && other <= smallest * one, "{facts}");
    }
}

#[test]
fn memory_of_a_generated_box_falls_with_the_number_of_ranks() {
    let room = room("memory");
    assert_falls(&room, &SIZES.map(|(name, cells, end)| scene_in(&room.join(name), &block(cells, end))));
}

/// The mesh is a frame of a block at the start.
#[test]
fn memory_of_a_parted_mesh_falls_with_the_number_of_ranks() {
    let room = room("parted-memory");
    let of_mesh = |(name, cells, end): (&str, &str, &str)| {
        let in_output = "[output]\ninterval = 1.0\nprecision = \"f64\"\n";
        let directory = room.join(name);
        let scene = scene_in(&directory, &block(cells, "2e-4").replace("[output]\n", in_output));
        run_well(0, &scene, &directory.join("frames"));
        let index = part(&directory.join("frames/scene_000000.vtu"), 8, directory.join("block.parted"));
        let mesh = format!("mesh = {index:?}\n");
        let shape = BOX_OF_BLOCK.replace("[24, 6, 6]", cells);
        scene_in(&directory, &block(cells, end).replace(&shape, &mesh).replace(FIX_OF_BLOCK, ""))
    };
    assert_falls(&room, &SIZES.map(of_mesh));
}
