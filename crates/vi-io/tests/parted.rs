//! A parted mesh is the whole mesh, in parts of any number of processes and from any number of pieces; files that do not belong
//! together are refused by name.

use std::fs;
use std::path::{Path, PathBuf};

use vi_io::{DataArray, IoError, MeshFile, PartedMesh, parse_mesh, read_mesh, write_parted};
use vi_mesh::{BoxMesh, CellKind, Mesh, MeshPart, Region, Runs, sort_by_place};

const RUN_LENGTH: usize = 64;

/// Returns a box whose facets are before its elements and between them, as programs may write them.
fn source() -> MeshFile {
    let shape = BoxMesh {
        size: [1.0, 0.3, 0.4],
        cells: [9, 6, 7],
        element: CellKind::Tet4,
        origin: [0.1, -0.7, 0.2],
    };
    let shape = shape.build().unwrap();
    let facets = shape.cells_of_dimension(2);
    let elements = shape.cells_of_dimension(3);
    let (half, third) = (facets.len() / 2, elements.len() / 3);
    let order = [&facets[..half], &elements[..third], &facets[half..], &elements[third..]].concat();
    let mut mesh = Mesh { points: shape.points.clone(), ..Mesh::default() };
    for &cell in &order {
        let (kind, nodes) = shape.cell(cell as usize).unwrap();
        mesh.push_cell(kind, nodes);
    }
    let new = |old: &u32| order.iter().position(|cell| cell == old).unwrap() as u32;
    for region in &shape.regions {
        let mut cells: Vec<u32> = region.cells.iter().map(new).collect();
        cells.sort_unstable();
        mesh.regions.push(Region { cells, ..region.clone() });
    }
    let values = (0..3 * mesh.points.len()).map(|k| f64::from(k as u32) / 3.0).collect();
    let point_data = vec![DataArray { name: "displacement".into(), components: 3, values }];
    MeshFile { mesh, point_data, notes: vec!["a note".into()], ..MeshFile::default() }
}

fn parted(directory: &Path, count: usize) -> (MeshFile, PathBuf, Vec<PathBuf>) {
    let (file, index) = (source(), directory.join("block.parted"));
    let files = write_parted(&index, &file, count, RUN_LENGTH).unwrap();
    (file, index, files)
}

fn open(index: &Path) -> PartedMesh {
    PartedMesh::open(index).unwrap().unwrap()
}

fn runs_of(mesh: &PartedMesh, length: usize, processes: usize) -> Runs {
    Runs::in_equal_shares(mesh.pieces().element_count(), length, processes)
}

/// Reads the part of the first of several processes.
fn part_of(mesh: &PartedMesh, processes: usize) -> Result<MeshPart, IoError> {
    mesh.part(0, &runs_of(mesh, RUN_LENGTH, processes))
}

#[test]
fn parts_are_those_of_the_whole_mesh_from_any_number_of_pieces() {
    let directory = tempfile::tempdir().unwrap();
    for pieces in [1, 2, 5, 36] {
        let (file, index, files) = parted(directory.path(), pieces);
        assert_eq!(files.len(), pieces + 2);
        assert_eq!(read_mesh(&index).unwrap(), file);
        let mesh = open(&index);
        for count in [1, 2, 3, 4, 7] {
            // Runs of another length than that of the pieces belong to several of them.
            for run_length in [RUN_LENGTH, 100] {
                let runs = runs_of(&mesh, run_length, count);
                for process in 0..count {
                    let part = mesh.part(process, &runs).unwrap();
                    assert!(part == MeshPart::of_mesh(&file.mesh, process, &runs));
                }
            }
        }
    }
}

#[test]
fn elements_on_disk_are_those_of_the_whole_mesh() {
    let directory = tempfile::tempdir().unwrap();
    let (MeshFile { mesh, point_data, .. }, index, _) = parted(directory.path(), 5);
    let (nodes, far) = open(&index).without_elements().unwrap();
    assert_eq!((&nodes.mesh.points, &nodes.point_data), (&mesh.points, &point_data));
    assert!(nodes.mesh.cells_of_dimension(3).is_empty());
    for region in mesh.regions.iter().filter(|region| region.dimension < 3) {
        assert_eq!(nodes.mesh.region_nodes(&region.name), mesh.region_nodes(&region.name));
    }
    let volumes = mesh.cells_of_dimension(3);
    assert_eq!((far.kind(), far.count()), (CellKind::Tet4, volumes.len()));
    let nodes_of = |cell: u32| mesh.cell(cell as usize).unwrap().1;
    let mut all = Vec::new();
    far.add_nodes(0..far.count() as u32, &mut all);
    for (element, (&cell, nodes)) in (0..).zip(volumes.iter().zip(all.chunks(4))) {
        assert_eq!((far.cell(element), nodes), (cell, nodes_of(cell)));
    }
    let mut on_curve = volumes.clone();
    sort_by_place(&mesh, &mut on_curve);
    let runs: Vec<&[u32]> = on_curve.chunks(RUN_LENGTH).collect();
    let found: Vec<u32> =
        far.of_runs(&[0, 9, runs.len() - 1], RUN_LENGTH).into_iter().map(|one| far.cell(one)).collect();
    assert_eq!(found, [runs[0], runs[9], runs[runs.len() - 1]].concat());
    let of_processes = far.nodes_of_processes(&Runs::in_equal_shares(far.count(), RUN_LENGTH, 3));
    for (process, found) in of_processes.iter().enumerate() {
        let own = runs.iter().enumerate().filter(|(run, _)| run * 3 / runs.len() == process);
        let mut nodes: Vec<u32> =
            own.flat_map(|(_, run)| run.iter().flat_map(|&cell| nodes_of(cell))).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        assert_eq!(*found, nodes);
    }
    assert_eq!(far.fault(), None);
}

#[test]
fn a_fault_of_the_disk_is_kept() {
    let directory = tempfile::tempdir().unwrap();
    let (_, index, files) = parted(directory.path(), 5);
    let (_, far) = open(&index).without_elements().unwrap();
    let whole = &files[5];
    fs::OpenOptions::new().write(true).open(whole).unwrap().set_len(100).unwrap();
    let mut nodes = Vec::new();
    far.add_nodes(7..9, &mut nodes);
    assert_eq!(nodes.len(), 8);
    assert!(far.fault().is_some_and(|fault| fault.starts_with(&whole.display().to_string())));
}

#[test]
fn files_that_do_not_belong_together_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (_, index, files) = parted(directory.path(), 5);
    let part = || part_of(&open(&index), 5).unwrap_err();
    let (piece, bytes) = (&files[0], fs::read(&files[0]).unwrap());

    fs::remove_file(piece).unwrap();
    assert!(matches!(part(), IoError::System { file, action: "read", .. } if file == *piece));
    fs::copy(&files[1], piece).unwrap();
    assert!(matches!(part(), IoError::OtherPiece { file, .. } if file == *piece));
    let mut other = bytes.clone();
    other[100] ^= 1;
    fs::write(piece, other).unwrap();
    let error = part();
    assert!(matches!(&error, IoError::OtherPiece { file, .. } if file == piece));
    assert!(error.to_string().contains("it has the checksum"), "{error}");
    fs::write(piece, bytes).unwrap();
    assert!(part_of(&open(&index), 5).is_ok());

    let text = fs::read_to_string(&index).unwrap();
    assert!(matches!(parse_mesh(text.as_bytes(), &index), Err(IoError::Unsupported { .. })));
    fs::write(&index, text.replacen("mesh 1", "mesh 2", 1)).unwrap();
    assert!(matches!(read_mesh(&index), Err(IoError::OtherFormat { found, known: 1, .. }) if found == "2"));
    fs::write(&index, text.replace("end\n", "")).unwrap();
    assert!(matches!(read_mesh(&index), Err(IoError::Truncated { .. })));
    fs::write(&index, text.replacen("block_p", "../block_p", 1)).unwrap();
    assert!(matches!(read_mesh(&index), Err(IoError::Syntax { .. })));
}

/// A piece whose bytes have the sum that the index lists, but contradict it or themselves, is refused.
#[test]
fn a_piece_with_wrong_lists_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (_, index, files) = parted(directory.path(), 5);
    let (bytes, text) = (fs::read(&files[0]).unwrap(), fs::read_to_string(&index).unwrap());
    let sum_of = |bytes: &[u8]| {
        let mut sum = flate2::Crc::new();
        sum.update(bytes);
        format!("{:08x}", sum.sum())
    };
    // Seven regions follow the number of nodes.
    let first_element = 8 * 8;
    let wrong = |at: usize, to: &[u8]| {
        let mut other = bytes.clone();
        other[at..at + to.len()].copy_from_slice(to);
        fs::write(&files[0], &other).unwrap();
        fs::write(&index, text.replace(&sum_of(&bytes), &sum_of(&other))).unwrap();
        part_of(&open(&index), 5).unwrap_err()
    };
    let error = wrong(first_element, &u32::MAX.to_le_bytes());
    assert!(
        matches!(&error, IoError::Inconsistent { what, .. } if what.starts_with("elements: ")),
        "{error}"
    );
    // More nodes, and more or fewer members of the first region, than there are.
    for (at, count) in [(0, u64::MAX), (8, u64::MAX)] {
        let error = wrong(at, &count.to_le_bytes());
        assert!(matches!(error, IoError::Truncated { .. }), "{error}");
    }
    let error = wrong(8, &0_u64.to_le_bytes());
    assert!(matches!(error, IoError::Inconsistent { .. }), "{error}");
}

/// Any change of the index is refused or leads to an error of a file; nothing panics.
#[test]
fn a_damaged_index_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (_, index, _) = parted(directory.path(), 3);
    let bytes = fs::read(&index).unwrap();
    for at in 0..bytes.len() {
        for change in [1, 4, 16] {
            let mut other = bytes.clone();
            other[at] ^= change;
            fs::write(&index, &other).unwrap();
            if let Ok(Some(mesh)) = PartedMesh::open(&index) {
                let _ = (mesh.read(), part_of(&mesh, 2), mesh.without_elements());
            }
        }
    }
}

#[test]
fn a_mesh_that_cannot_be_parted_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let index = directory.path().join("block.parted");
    let refused = |file: &MeshFile, count| match write_parted(&index, file, count, RUN_LENGTH) {
        Err(IoError::BadOutput { what, .. }) => what,
        other => panic!("{other:?}"),
    };
    let mut file = source();
    assert!(refused(&file, 37).contains("choose 1 to 36"));
    assert!(refused(&file, 0).contains("choose 1 to 36"));
    file.mesh.push_cell(CellKind::Wedge6, &[0, 1, 2, 3, 4, 5]);
    assert!(refused(&file, 2).contains("tet4, wedge6"));
    let mut file = source();
    file.mesh.regions[0].name = "two\nlines".into();
    assert!(refused(&file, 2).contains("two\\nlines"));
    assert!(!index.exists());
}
