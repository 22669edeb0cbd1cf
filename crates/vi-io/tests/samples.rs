//! Reads the sample files, each written by another program in one of its dialects (`data/make.py`), and checks their
//! content.

use std::path::{Path, PathBuf};

use vi_io::{MeshFile, read_mesh};
use vi_mesh::CellKind;

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")
}

fn read(name: &str) -> MeshFile {
    read_mesh(&data().join(name)).unwrap_or_else(|error| panic!("{error}"))
}

fn names_beginning(start: &str) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(data())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with(start))
        .collect();
    names.sort();
    names
}

#[test]
fn every_encoding_of_vtk_holds_the_same_mesh() {
    let names = names_beginning("cells-");
    assert!(names.len() >= 27, "{names:?}");
    let text = read("cells-vtk-text-32.vtu");
    for name in names {
        let file = read(&name);
        assert_eq!(file.mesh.points.len(), 9, "{name}");
        assert_eq!(file.mesh.points[8], [0.5, 0.5, 2.0], "{name}");
        let kinds: Vec<_> = file.mesh.blocks.iter().map(|block| (block.kind, block.cell_count())).collect();
        assert_eq!(kinds, [(CellKind::Hex8, 1), (CellKind::Pyramid5, 1), (CellKind::Tri3, 2)], "{name}");
        assert_eq!(file.mesh.blocks[0].nodes, [0, 1, 2, 3, 4, 5, 6, 7], "{name}");
        assert_eq!(file.mesh.blocks[1].nodes, [4, 5, 6, 7, 8], "{name}");
        assert_eq!(file.mesh.blocks[2].nodes, [0, 1, 2, 0, 2, 3], "{name}");
        let displacement = file.point_array("displacement").unwrap();
        assert_eq!(displacement.components, 3, "{name}");
        // Legacy text and meshio's text hold fewer digits.
        let tolerance = if name.ends_with("text.vtk") {
            1e-5
        } else if name.contains("meshio-text") {
            1e-11
        } else {
            0.0
        };
        for (x, u) in file.mesh.points.iter().zip(displacement.values.as_chunks::<3>().0) {
            for (u, expected) in u.iter().zip([x[0] * 0.1, x[1] * -0.2, x[2] * (1.0 / 3.0)]) {
                assert!((u - expected).abs() <= tolerance, "{name}: {u} {expected}");
            }
        }
        assert_eq!(file.cell_array("material_id").unwrap().values, [3.0, 4.0, 3.0, 3.0], "{name}");
        assert_eq!(file.mesh.regions, text.mesh.regions, "{name}");
        assert_eq!(file.region("material_id=3").unwrap().cells, [0], "{name}: the volume comes first");
        assert!(file.notes.is_empty(), "{name}: {:?}", file.notes);
    }
}

#[test]
fn every_version_of_gmsh_holds_the_same_box() {
    for (start, kind, least) in [
        ("tetra-", CellKind::Tet4, 6),
        ("tetra10-", CellKind::Tet10, 6),
        ("hexahedron-", CellKind::Hex8, 1),
        ("hexahedron20-", CellKind::Hex20, 1),
        ("hexahedron27-", CellKind::Hex27, 1),
        ("wedge-", CellKind::Wedge6, 2),
        ("wedge15-", CellKind::Wedge15, 2),
    ] {
        let names = names_beginning(start);
        assert!(!names.is_empty(), "{start}");
        let first = read(&names[0]);
        for name in names {
            let file = read(&name);
            let volumes: Vec<_> =
                file.mesh.blocks.iter().filter(|block| block.kind.dimension() == 3).collect();
            assert!(volumes.iter().all(|block| block.kind == kind), "{name}");
            let steel = file.region("steel").unwrap();
            assert_eq!(steel.dimension, 3, "{name}");
            assert!(steel.cells.len() >= least, "{name}");
            assert_eq!(
                steel.cells.len(),
                volumes.iter().map(|block| block.cell_count()).sum::<usize>(),
                "{name}"
            );
            assert_eq!(file.region("tip").unwrap().dimension, 0, "{name}");
            // "clamp" is one of the three surfaces of group 7.
            let (clamp, seven) = (file.region("clamp").unwrap(), file.region("7").unwrap());
            assert_eq!((clamp.dimension, seven.dimension), (2, 2), "{name}");
            assert!(
                !clamp.cells.is_empty() && clamp.cells.iter().all(|cell| seven.cells.contains(cell)),
                "{name}"
            );
            assert!(seven.cells.len() > clamp.cells.len(), "{name}");
            assert_eq!(volume(&file, &steel.cells), 0.25, "{name}");
            middles_lie_between_corners(&name, &file);
            assert_eq!(file.mesh.points.len(), first.mesh.points.len(), "{name}");
            for group in &first.mesh.regions {
                let other =
                    file.mesh.regions.iter().find(|g| g.name == group.name && g.dimension == group.dimension);
                assert_eq!(other.unwrap().cells.len(), group.cells.len(), "{name} {}", group.name);
            }
        }
    }
}

/// Returns the corners that each midside node lies between, in VTK's order.
fn edges(kind: CellKind) -> (usize, &'static [[usize; 2]]) {
    const HEXAHEDRON: &[[usize; 2]] =
        &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
    match kind {
        CellKind::Tet10 => (4, &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]),
        CellKind::Hex20 | CellKind::Hex27 => (8, HEXAHEDRON),
        CellKind::Wedge15 => (6, &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]]),
        CellKind::Tri6 => (3, &[[0, 1], [1, 2], [2, 0]]),
        CellKind::Quad8 | CellKind::Quad9 => (4, &[[0, 1], [1, 2], [2, 3], [3, 0]]),
        CellKind::Line3 => (2, &[[0, 1]]),
        _ => (0, &[]),
    }
}

fn middles_lie_between_corners(name: &str, file: &MeshFile) {
    for (kind, nodes) in file.mesh.cells() {
        let (corners, edges) = edges(kind);
        let x = |i: usize| file.mesh.points[nodes[i] as usize];
        for (i, &[a, b]) in edges.iter().enumerate() {
            for k in 0..3 {
                let middle = (x(a)[k] + x(b)[k]) / 2.0;
                assert!((x(corners + i)[k] - middle).abs() < 1e-12, "{name}: {} edge {i}", kind.name());
            }
        }
        if kind == CellKind::Hex27 {
            // The faces −x +x −y +y −z +z in the axes of the cell; a face node is the mean of four corners.
            let faces = [[0, 3, 7, 4], [1, 2, 6, 5], [0, 1, 5, 4], [3, 2, 6, 7], [0, 1, 2, 3], [4, 5, 6, 7]];
            for (i, face) in faces.iter().enumerate() {
                for k in 0..3 {
                    let middle = face.iter().map(|&corner| x(corner)[k]).sum::<f64>() / 4.0;
                    assert!((x(20 + i)[k] - middle).abs() < 1e-12, "{name}: face {i}");
                }
            }
        }
    }
}

/// Returns the volume of straight-sided cells, to twelve digits, from tetrahedra at their corners. Every cell must be
/// positive.
fn volume(file: &MeshFile, cells: &[u32]) -> f64 {
    let all: Vec<_> = file.mesh.cells().collect();
    let mut sum = 0.0;
    for &cell in cells {
        let (kind, nodes) = all[cell as usize];
        let tets: &[[usize; 4]] = match kind {
            CellKind::Tet4 | CellKind::Tet10 => &[[0, 1, 2, 3]],
            CellKind::Wedge6 | CellKind::Wedge15 => &[[0, 1, 2, 3], [1, 2, 3, 4], [2, 3, 4, 5]],
            _ => &[[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7]],
        };
        for (i, tet) in tets.iter().enumerate() {
            let [o, a, b, c] = tet.map(|i| file.mesh.points[nodes[i] as usize]);
            let edge = |to: [f64; 3]| [to[0] - o[0], to[1] - o[1], to[2] - o[2]];
            let [a, b, c] = [edge(a), edge(b), edge(c)];
            let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            let six = normal[0] * c[0] + normal[1] * c[1] + normal[2] * c[2];
            assert!(i > 0 || six > 0.0, "cell {cell} is turned inside out");
            sum += six.abs() / 6.0;
        }
    }
    (sum * 1e12).round() / 1e12
}

#[test]
fn views_of_gmsh_become_point_data() {
    for name in ["view-text.msh", "view-binary.msh"] {
        let file = read(name);
        let displacement = file.point_array("displacement").unwrap_or_else(|| panic!("{name}"));
        for (x, u) in file.mesh.points.iter().zip(displacement.values.as_chunks::<3>().0) {
            for k in 0..3 {
                assert!((u[k] - (k + 1) as f64 * x[k]).abs() < 1e-12, "{name}: {x:?} {u:?}");
            }
        }
    }
}

#[test]
fn poly_data_are_taken_apart_and_their_arrays_follow() {
    for name in [
        "surface-4.2-text.vtk",
        "surface-4.2-binary.vtk",
        "surface-5.1-text.vtk",
        "surface-5.1-binary.vtk",
        "surface.vtp",
    ] {
        let file = read(name);
        let kinds: Vec<_> = file.mesh.blocks.iter().map(|block| (block.kind, block.cell_count())).collect();
        let expected =
            [(CellKind::Point, 1), (CellKind::Line2, 2), (CellKind::Quad4, 6), (CellKind::Tri3, 2)];
        assert_eq!(kinds, expected, "{name}");
        let number = &file.cell_array("file cell").unwrap().values;
        assert_eq!(*number, [0.0, 1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 8.0], "{name}");
        assert_eq!(file.notes.len(), 1, "{name}: {:?}", file.notes);
    }
}

#[test]
fn stl_corners_are_welded() {
    for name in ["cube-text.stl", "cube-binary.stl"] {
        let file = read(name);
        assert_eq!((file.mesh.points.len(), file.mesh.cell_count()), (8, 12), "{name}");
        assert!(file.notes[0].contains("36 corners"), "{:?}", file.notes);
    }
    assert_eq!(read("cube-text.stl").region("cube").unwrap().cells.len(), 12);
}

#[test]
fn obj_polygons_negative_numbers_groups_and_texture_coordinates() {
    let file = read("cube.obj");
    assert_eq!((file.mesh.points.len(), file.mesh.cell_count()), (8, 14));
    assert_eq!(file.mesh.blocks[0].nodes[..6], [0, 3, 2, 0, 2, 1]);
    assert_eq!(file.mesh.blocks[0].nodes[6..12], [4, 5, 6, 4, 6, 7], "counted from the end");
    assert_eq!(file.region("sides").unwrap().cells, [0, 1, 2, 3, 4, 5]);
    assert_eq!(file.region("all").unwrap().cells.len(), 12);
    let uv = file.point_array("uv").unwrap();
    assert_eq!(uv.components, 2);
    for (x, uv) in file.mesh.points.iter().zip(uv.values.as_chunks::<2>().0) {
        assert_eq!(x[..2], uv[..]);
    }
    assert_eq!(file.notes, ["6 faces of more than three corners were cut into triangles"]);
}

#[test]
fn an_obj_face_that_names_its_group_twice_is_in_it_once() {
    let text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\no all\ng all all\nf 1 2 3 4\n";
    let file = vi_io::parse_obj(text, Path::new("twice.obj")).unwrap();
    assert_eq!(file.region("all").unwrap().cells, [0, 1]);
}

#[test]
fn decks_of_abaqus_hold_the_same_box_as_gmsh_files() {
    let names = names_beginning("box-");
    assert_eq!(names.len(), 6, "{names:?}");
    for name in names {
        let file = read(&name);
        let stem = name.trim_start_matches("box-").trim_end_matches(".inp");
        let same = read(&format!("{stem}-4.1-binary.msh"));
        middles_lie_between_corners(&name, &file);
        assert_eq!(file.mesh.points.len(), same.mesh.points.len(), "{name}");
        // Compares the positions of the nodes of each cell in order, so that every wrong order shows.
        let places = |file: &MeshFile, group: &str| {
            let all: Vec<_> = file.mesh.cells().collect();
            let group = file.region(group).unwrap_or_else(|| panic!("{name}: {group}"));
            let mut cells: Vec<Vec<[i64; 3]>> = group
                .cells
                .iter()
                .map(|&cell| all[cell as usize].1)
                .map(|nodes| {
                    nodes
                        .iter()
                        .map(|&node| file.mesh.points[node as usize].map(|x| (1e9 * x).round() as i64))
                        .collect()
                })
                .collect();
            cells.sort();
            cells
        };
        for (deck, gmsh) in
            [("steel", "steel"), ("clamp", "clamp"), ("PhysicalSurface7", "7"), ("tip", "tip")]
        {
            assert_eq!(places(&file, deck), places(&same, gmsh), "{name}: {deck}");
        }
        assert_eq!(volume(&file, &file.region("steel").unwrap().cells), 0.25, "{name}");
        assert!(file.notes.is_empty(), "{name}: {:?}", file.notes);
    }
}

#[test]
fn sets_and_surfaces_of_a_deck_become_groups() {
    let file = read("sets.inp");
    assert_eq!(file.mesh.points.len(), 14);
    let cells: Vec<_> = file.mesh.cells().collect();
    let nodes = |name: &str| {
        let group = file.region(name).unwrap_or_else(|| panic!("{name}: {:?}", file.mesh.regions));
        let mut nodes: Vec<u32> =
            group.cells.iter().flat_map(|&cell| cells[cell as usize].1.to_vec()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        (group.dimension, nodes)
    };
    // Indices count from 0; the numbers 11 to 16 follow 8.
    assert_eq!(nodes("Root"), (0, vec![0, 2, 4, 6, 7]), "a range and a second definition of other case");
    assert_eq!(nodes("Some"), (0, vec![0, 2, 4, 6, 7, 13]), "a set of a set");
    assert_eq!(nodes("Set-1.elements"), (3, (0..14).collect()), "one name for two sets");
    assert_eq!(nodes("Set-1.nodes"), (0, vec![0, 1]));
    assert!(file.region("Set-1").is_none() && file.region("_Top_S2").is_none());
    assert_eq!(nodes("Both Sides"), (3, (0..14).collect()));
    assert_eq!(nodes("Top"), (2, vec![4, 5, 6, 7, 10, 11, 13]));
    assert_eq!(nodes("Shell"), (2, vec![4, 5, 6, 7]));
    assert_eq!(nodes("Rim"), (1, vec![6, 7]));
    assert_eq!(nodes("Tips"), (0, vec![12, 13]));
    assert_eq!(file.region("Skin").unwrap().cells, file.region("Shell").unwrap().cells);
    // ∮ x·n dA = 3 V: the faces S1 … S6 of bricks and S1 … S4 of the wedge form a closed surface with outward normals.
    let outside = &file.region("Outside").unwrap().cells;
    let mut sum = 0.0;
    for &cell in outside {
        let x: Vec<[f64; 3]> =
            cells[cell as usize].1.iter().map(|&node| file.mesh.points[node as usize]).collect();
        for k in 1..x.len() - 1 {
            let (a, b, c) = (x[0], x[k], x[k + 1]);
            let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            sum += 0.5 * (0..3).map(|i| a[i] * n[i]).sum::<f64>();
        }
    }
    // The faces S3 and S4 of the wedge are its slanted ones; S5 lies on the second brick.
    assert!((sum - 3.0 * 2.5).abs() < 1e-12, "{sum}");
    let notes = file.notes.join("\n");
    for word in ["MATERIAL", "ELASTIC", "SOLID SECTION", "BOUNDARY", "MASS", "T3D2", "\"Set-1\""] {
        assert!(notes.contains(word), "{word}: {notes}");
    }
}

#[test]
fn what_would_change_the_mesh_of_a_deck_is_refused_with_its_line() {
    let good = std::fs::read_to_string(data().join("sets.inp")).unwrap();
    // Each case: a text of the deck, its replacement, the number of lines from there to the line named, and words of
    // the message.
    for (from, to, further, words) in [
        ("*End Part", "*Include, input=more.inp", 0, "data in another file"),
        ("*End Part", "*Part, name=Second", 0, "a second *PART"),
        ("*End Part", "*Instance, name=I, part=P\n 1., 0., 0.", 1, "an instance that is moved"),
        ("*Node, nset=ALL", "*Node, system=C", 0, "cylindrical"),
        ("C3D8R", "C3D27", 0, "C3D27"),
        ("10, 1, 2, 3, 4, 5,\n 6, 7, 8\n", "10, 1, 2, 3, 4, 5,\n 6, 7\n", 0, "16 nodes"),
        ("50, 1, 5", "50, 1, 99", 0, "99"),
        ("*Nset, nset=root\n8", "*Nset, nset=root\n88", 0, "names node 88"),
        ("*Nset, nset=Some, instance=Part-1-1\n Root", "*Nset, nset=Some\n Rooot", 0, "Rooot"),
        ("*Surface, type=ELEMENT, name=Top\n_Top_S2, S2", "*Surface, name=Top\n_Top_S2, S7", 0, "side S7 of"),
        ("*Surface, type=ELEMENT, name=Top\n_Top_S2, S2", "*Surface, name=Top\n_Top_S2", 0, "which side"),
        ("1, 7, 2", "7, 1, 2", 0, "first, last"),
        ("2.,  0.,  0.", "2.,  nan,  0.", 0, "NaN"),
        ("2.,  0.,  0.", "2.,  x,  0.", 0, "a coordinate"),
        ("20, 2, 11, 12,", "10, 2, 11, 12,", 0, "occurs twice"),
    ] {
        let line = good.find(from).map(|at| 1 + good[..at].matches('\n').count() + further);
        let line = line.unwrap_or_else(|| panic!("{from}"));
        let text = good.replacen(from, to, 1);
        let said = vi_io::parse_inp(text.as_bytes(), Path::new("deck.inp")).unwrap_err().to_string();
        assert!(said.starts_with(&format!("deck.inp: line {line}: ")), "{to}: line {line}: {said}");
        assert!(said.contains(words), "{to}: {said}");
    }
}
