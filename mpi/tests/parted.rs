//! Runs the program on 1 to 4 ranks with a mesh that was parted beforehand, and compares its files with those of one process that reads
//! the whole mesh.

mod launch;

use std::fs;
use std::path::Path;

use launch::files::{assert_in_parts, assert_same_files};
use launch::scenes::{BRACKET, BRACKET_MESH};
use launch::{assert_one_error, part, room, run, run_well, scene};

/// A probe at a node, which needs no elements on the first rank, and checkpoints.
const CORNER: &str = r#"
[[probe]]
name = "corner"
body = "bracket"
point = [0.0, 0.0, 0.0]
[checkpoint]
interval = 1e-4
"#;

/// Runs a scene with the whole mesh by one process, and then with the mesh parted into so many pieces on so many ranks: all files
/// must be the same. The report names the file of the mesh, which a parted mesh therefore replaces.
fn same_files(name: &str, text_of_scene: &str, of_pieces: &[usize], of_ranks: &[usize], in_parts: bool) {
    let room = room(name);
    let (mesh, expected) = (room.join("mesh"), room.join("one"));
    let scene = scene(&room, &text_of_scene.replace("MESH", mesh.to_str().unwrap()));
    fs::copy(BRACKET_MESH, &mesh).unwrap();
    run_well(0, &scene, &expected);
    for &pieces in of_pieces {
        part(Path::new(BRACKET_MESH), pieces, mesh.clone());
        for &ranks in of_ranks {
            let out = room.join(format!("{pieces}-{ranks}"));
            run_well(ranks, &scene, &out);
            assert_same_files(&out, &expected, &format!("{name}: {pieces} pieces on {ranks} ranks"));
            if in_parts && ranks > 1 {
                assert_in_parts(&out);
            }
        }
    }
}

#[test]
fn parted_meshes_have_the_files_of_the_whole_mesh() {
    same_files("parted", &(BRACKET.to_owned() + CORNER), &[1, 3, 12], &[0, 1, 2, 3, 4], true);
}

/// What one process must read whole, because it is implicit, it reads from the same files.
#[test]
fn implicit_runs_read_a_parted_mesh_whole() {
    let implicit = BRACKET.replace("stormer-verlet", "implicit-midpoint") + "[solver]\nlinear = \"pcg\"\n";
    same_files("parted-whole", &implicit, &[4], &[2], false);
}

#[test]
fn files_that_do_not_belong_together_end_all_ranks_with_one_message() {
    let room = room("parted-damaged");
    let index = part(Path::new(BRACKET_MESH), 4, room.join("pieces.parted"));
    let scene = scene(&room, &BRACKET.replace("MESH", index.to_str().unwrap()));
    let refused = |reasons: [&str; 2]| {
        assert_one_error(&run(4, &scene, &room.join("out")), Some(2), &reasons);
        assert!(!room.join("out").exists());
    };
    // The first rank needs all pieces once; the last one alone is not asked for the first.
    for piece in ["pieces_p000.bin", "pieces_p003.bin"] {
        let path = room.join(piece);
        let bytes = fs::read(&path).unwrap();
        fs::remove_file(&path).unwrap();
        refused([piece, "cannot read"]);
        let mut other = bytes.clone();
        other[100] ^= 1;
        fs::write(&path, other).unwrap();
        refused([piece, "belongs to another mesh"]);
        fs::write(&path, bytes).unwrap();
    }
    let text_of_index = fs::read_to_string(&index).unwrap();
    fs::write(&index, text_of_index.replacen("mesh 1", "mesh 7", 1)).unwrap();
    refused(["its format is \"7\"", "part the mesh again"]);
}
