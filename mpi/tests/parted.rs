//! Runs the program on 1 to 4 ranks with a mesh that was parted beforehand, and compares its files with those of one process that reads
//! the whole mesh.

mod launch;

use std::path::{Path, PathBuf};
use std::process::Command;

use launch::files::assert_same_files;
#[cfg(target_os = "linux")]
use launch::memory::peaks;
use launch::{program_of_one_process, room, run, scene, text};

/// A rubber bracket of 11 632 tetrahedra, held at its bolts.
const BRACKET: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 2e-4
step = 1e-5
scheme = "stormer-verlet"
[[body]]
name = "bracket"
mesh = "MESH"
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [1.0, 0.0, 2.0]
[[fix]]
body = "bracket"
region = "bolts"
[[probe]]
name = "corner"
body = "bracket"
point = [0.0, 0.0, 0.0]
[output]
interval = 1e-4
history = 7
fields = ["displacement", "velocity", "stress", "reaction_force"]
[checkpoint]
interval = 1e-4
"#;

const MESH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../meshes/bracket.msh");

/// Parts a mesh; returns the index.
fn part(mesh: &str, pieces: usize, index: PathBuf) -> PathBuf {
    let mut command = Command::new(program_of_one_process());
    command.args(["part", mesh, "--parts", &pieces.to_string(), "--quiet", "--out"]).arg(&index);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    index
}

/// Writes the scene of a mesh beside the others; returns its path.
fn scene_of(room: &Path, text_of_scene: &str, mesh: &Path) -> PathBuf {
    let directory = room.join("scene-of").join(mesh.file_stem().unwrap());
    std::fs::create_dir_all(&directory).unwrap();
    scene(&directory, &text_of_scene.replace("MESH", mesh.to_str().unwrap()))
}

/// Runs a scene with the mesh by one process; returns its directory, and the scene. The report names the file of the mesh, which a
/// parted mesh may replace.
fn one(room: &Path, text_of_scene: &str) -> (PathBuf, PathBuf) {
    let (mesh, out) = (room.join("mesh"), room.join("one"));
    std::fs::copy(MESH, &mesh).unwrap();
    let scene = scene_of(room, text_of_scene, &mesh);
    let output = run(0, &scene, &out);
    assert!(output.status.success(), "{}", text(&output.stderr));
    (out, scene)
}

fn assert_in_parts(out: &Path) {
    let report = std::fs::read_to_string(out.join("report.json")).unwrap();
    assert!(report.contains("\"in_parts\": true"), "{report}");
}

#[test]
fn parted_meshes_have_the_files_of_the_whole_mesh() {
    let room = room("parted");
    let (expected, scene) = one(&room, BRACKET);
    for pieces in [1, 3, 12] {
        part(MESH, pieces, room.join("mesh"));
        for ranks in [0, 1, 2, 3, 4] {
            let out = room.join(format!("{pieces}-{ranks}"));
            let output = run(ranks, &scene, &out);
            assert!(output.status.success(), "{ranks} ranks: {}", text(&output.stderr));
            assert_same_files(&out, &expected, &format!("{pieces} pieces on {ranks} ranks"));
            if ranks > 1 {
                assert_in_parts(&out);
            }
        }
    }
}

/// What one process must read whole, because it is implicit, it reads from the same files.
#[test]
fn implicit_runs_read_a_parted_mesh_whole() {
    let room = room("parted-whole");
    let implicit = BRACKET.replace("stormer-verlet", "implicit-midpoint") + "[solver]\nlinear = \"pcg\"\n";
    let (expected, scene) = one(&room, &implicit);
    part(MESH, 4, room.join("mesh"));
    let out = room.join("out");
    let output = run(2, &scene, &out);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_same_files(&out, &expected, "implicit");
}

#[test]
fn files_that_do_not_belong_together_end_all_ranks_with_one_message() {
    let room = room("parted-damaged");
    let index = part(MESH, 4, room.join("pieces.parted"));
    let scene = scene_of(&room, BRACKET, &index);
    let refused = |reasons: [&str; 2]| {
        let output = run(4, &scene, &room.join("out"));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert_eq!(message.lines().filter(|line| line.starts_with("error")).count(), 1, "{message}");
        assert!(reasons.iter().all(|reason| message.contains(reason)), "{message}");
        assert!(!room.join("out").exists());
    };
    // The first rank needs all pieces once; the last one alone is not asked for the first.
    for piece in ["pieces_p000.bin", "pieces_p003.bin"] {
        let bytes = std::fs::read(room.join(piece)).unwrap();
        std::fs::remove_file(room.join(piece)).unwrap();
        refused([piece, "cannot read"]);
        let mut other = bytes.clone();
        other[100] ^= 1;
        std::fs::write(room.join(piece), other).unwrap();
        refused([piece, "belongs to another mesh"]);
        std::fs::write(room.join(piece), bytes).unwrap();
    }
    let text_of_index = std::fs::read_to_string(&index).unwrap();
    std::fs::write(&index, text_of_index.replacen("mesh 1", "mesh 7", 1)).unwrap();
    refused(["its format is \"7\"", "part the mesh again"]);
}

/// A block of 331 776 tetrahedra, of which a frame at the start becomes the mesh. It runs long enough to be seen at its peak.
#[cfg(target_os = "linux")]
const BLOCK: &str = r#"
[time]
end = 2e-4
step = 2e-5
scheme = "stormer-verlet"
[[body]]
name = "block"
box = { size = [1.0, 0.25, 0.25], cells = CELLS, element = "tet4" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [1.0, 0.0, 2.0]
[output]
interval = 1.0
precision = "f64"
"#;

/// Numbers of ranks, and the memory that the first and another may need for a parted mesh, as parts of that of one process. Measured:
/// .67 and .46 on two ranks, .46 and .24 on four.
#[cfg(target_os = "linux")]
const LIMITS: [(usize, f64, f64); 2] = [(2, 0.9, 0.65), (4, 0.7, 0.42)];

#[test]
#[cfg(target_os = "linux")]
fn memory_per_rank_falls_with_the_number_of_ranks() {
    let room = room("parted-memory");
    let of_cells = |name: &str, cells: &str, end: &str| {
        let text_of_box = BLOCK.replace("CELLS", cells);
        let place = room.join(name);
        let output = run(0, &scene_of(&room, &text_of_box, Path::new(name)), &place);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let frame = place.join("scene_000000.vtu");
        let index = part(frame.to_str().unwrap(), 8, room.join(format!("{name}-pieces.parted")));
        let shape = format!("box = {{ size = [1.0, 0.25, 0.25], cells = {cells}, element = \"tet4\" }}");
        let of_mesh = text_of_box.replace(&shape, "mesh = \"MESH\"").replace("interval = 1.0\n", "");
        scene_of(&room, &of_mesh.replace("end = 2e-4", end), &index)
    };
    let small = of_cells("small", "[8, 8, 8]", "end = 0.01");
    let large = of_cells("large", "[72, 32, 24]", "end = 2e-3");
    let mesh_needs = |ranks: usize| {
        let (base, peaks) = (peaks(ranks, &small, &room.join("s")), peaks(ranks, &large, &room.join("l")));
        (peaks[0] - base[0], peaks[ranks - 1] - base[ranks - 1])
    };
    assert!(run(2, &large, &room.join("in-parts")).status.success());
    assert_in_parts(&room.join("in-parts"));
    let (one, _) = mesh_needs(1);
    for (ranks, largest, smallest) in LIMITS {
        let (first, other) = mesh_needs(ranks);
        assert!(first <= largest * one, "{ranks} ranks: {first:.0} MiB on the first, {one:.0} MiB on one");
        assert!(other <= smallest * one, "{ranks} ranks: {other:.0} MiB on another, {one:.0} MiB on one");
    }
}
