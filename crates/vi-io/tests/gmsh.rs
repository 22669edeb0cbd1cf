//! Tests Gmsh files: groups, node orders, and errors that name their place.

use std::path::Path;

use vi_io::{IoError, Place, parse_msh};
use vi_mesh::CellKind;

const TWO: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 \"clamp\"\n3 2 \"steel\"\n\
$EndPhysicalNames\n$Nodes\n4\n10 0 0 0\n7 1 0 0\n1000000 0 1 0\n2 0 0 1\n$EndNodes\n$Elements\n4\n\
1 2 2 1 5 10 7 1000000\n2 2 2 9 5 7 1000000 10\n3 2 2 0 6 7 2 10\n4 4 2 2 1 10 7 1000000 2\n$EndElements\n\
$NodeData\n1\n\"velocity\"\n1\n0.0\n3\n0\n3\n4\n10 1 2 3\n7 4 5 6\n1000000 7 8 9\n2 -1 -2 -3\n$EndNodeData\n";

const FOUR: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 2 \"steel\"\n$EndPhysicalNames\n\
$Entities\n0 0 1 1\n5 0 0 0 1 1 0 2 4 9 0\n1 0 0 0 1 1 1 1 2 1 5\n$EndEntities\n$Nodes\n2 4 1 40\n\
2 5 0 3\n40\n30\n20\n0 0 0\n1 0 0\n0 1 0\n3 1 0 1\n1\n0 0 1\n$EndNodes\n$Elements\n2 2 1 2\n2 5 2 1\n1 40 30 20\n\
3 1 4 1\n2 40 30 20 1\n$EndElements\n";

fn parse(text: &str) -> Result<vi_io::MeshFile, IoError> {
    parse_msh(text.as_bytes(), Path::new("some.msh"))
}

#[test]
fn version_2_copies_of_an_element_become_one_cell_in_several_groups() {
    let file = parse(TWO).unwrap();
    assert_eq!(file.mesh.points, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert_eq!(file.mesh.blocks.len(), 2);
    assert_eq!(file.mesh.blocks[0].nodes, [0, 1, 2, 1, 3, 0]);
    assert_eq!(
        (file.mesh.blocks[1].kind, &file.mesh.blocks[1].nodes[..]),
        (CellKind::Tet4, &[0, 1, 2, 3][..])
    );
    let group = |name| file.region(name).unwrap();
    assert_eq!((group("clamp").dimension, &group("clamp").cells[..]), (2, &[0][..]));
    assert_eq!((group("9").dimension, &group("9").cells[..]), (2, &[0][..]));
    assert_eq!((group("steel").dimension, &group("steel").cells[..]), (3, &[2][..]));
    assert_eq!(file.mesh.regions.len(), 3);
    assert_eq!(file.notes.len(), 1);
    let velocity = file.point_array("velocity").unwrap();
    assert_eq!((velocity.components, velocity.values[9]), (3, -1.0));
}

#[test]
fn version_4_entities_put_their_elements_into_several_groups() {
    let file = parse(FOUR).unwrap();
    let names: Vec<_> = file
        .mesh
        .regions
        .iter()
        .map(|group| (group.name.as_str(), group.dimension, group.cells.clone()))
        .collect();
    assert_eq!(names, [("4", 2, vec![0]), ("9", 2, vec![0]), ("steel", 3, vec![1])]);
    assert_eq!(file.mesh.blocks[1].nodes, [0, 1, 2, 3]);
}

#[test]
fn errors_name_the_line() {
    let wrong = parse(&TWO.replace("7 1 0 0\n", "7 1 x 0\n")).unwrap_err();
    assert!(matches!(wrong, IoError::Syntax { place: Place::Line(12), .. }), "{wrong}");
    let wrong = parse(&TWO.replace("7 1 0 0\n", "7 1 nan 0\n")).unwrap_err();
    assert!(matches!(wrong, IoError::NotFinite { place: Place::Line(12), node: 7, .. }), "{wrong}");
    let wrong = parse(&TWO.replace("3 2 2 0 6 7 2 10", "3 2 2 0 6 7 3 10")).unwrap_err();
    assert!(
        matches!(wrong, IoError::UnknownNode { place: Place::Line(20), cell: 3, node: 3, .. }),
        "{wrong}"
    );
    let wrong = parse(&TWO.replace("3 2 2 0 6 7 2 10", "3 21 2 0 6 7 2 10")).unwrap_err();
    assert!(matches!(wrong, IoError::UnsupportedCell { place: Place::Line(20), code: 21, .. }), "{wrong}");
    let wrong = parse(&TWO.replace("$Nodes\n4\n", "$Nodes\n1000000000000\n")).unwrap_err();
    assert!(
        matches!(wrong, IoError::CountTooLarge { place: Place::Line(10), count: 1_000_000_000_000, .. }),
        "{wrong}"
    );
    let wrong = parse(&TWO[..200]).unwrap_err();
    assert!(matches!(wrong, IoError::Truncated { .. } | IoError::CountTooLarge { .. }), "{wrong}");
}
