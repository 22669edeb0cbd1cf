//! Tests that an independent reader, the crate `vtkio`, reads the files written here, and that its model is converted
//! without loss.

use std::path::Path;

use vi_io::{
    IoError, MeshFile, Precision, VtuArray, VtuEncoding, VtuFrame, VtuOptions, VtuValues, write_vtu,
};
use vi_mesh::{CellBlock, CellKind, Region};
use vtkio::Vtk;
use vtkio::model::{Attribute, DataSet, Piece, UnstructuredGridPiece};

/// Returns a cell of every kind that has faces or edges, each on separate nodes, with arrays and overlapping regions.
fn sample() -> MeshFile {
    let mut file = MeshFile::default();
    for &kind in CellKind::ALL {
        let first = file.mesh.points.len() as u32;
        let place = 3.0 * f64::from(kind.vtk_code());
        file.mesh
            .points
            .extend(kind.reference_nodes().iter().map(|x| [x[0] + place, x[1] / 3.0, x[2] - 1e-9]));
        let nodes = (first..file.mesh.points.len() as u32).collect();
        file.mesh.blocks.push(CellBlock { kind, nodes });
    }
    let volumes: Vec<u32> = (0..)
        .zip(file.mesh.cells())
        .filter(|(_, (kind, _))| kind.dimension() == 3)
        .map(|(cell, _)| cell)
        .collect();
    file.mesh.regions.push(Region { name: "first".into(), dimension: 3, cells: volumes[..1].to_vec() });
    file.mesh.regions.push(Region { name: "the <volumes>".into(), dimension: 3, cells: volumes });
    let points = file.mesh.points.len();
    let array = |name: &str, components: usize, count: usize| vi_io::DataArray {
        name: name.into(),
        components,
        values: (0..components * count).map(|k| (k as f64).sin() * 1e-3).collect(),
    };
    file.point_data.push(array("displacement", 3, points));
    file.cell_data.push(array("von_mises", 1, file.mesh.cell_count()));
    file
}

/// vtkio reads every piece of a frame; together they have its cells, and each has no more points than asked.
#[test]
fn vtkio_reads_the_pieces_of_a_frame() {
    let points: Vec<[f64; 3]> = (0..9).map(|k| [f64::from(k % 3), f64::from(k / 3), 0.5]).collect();
    let corners = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]];
    let blocks = [CellBlock { kind: CellKind::Quad4, nodes: corners.concat() }];
    let heights: Vec<f64> = points.iter().map(|x| x[0] + 10.0 * x[1]).collect();
    let numbers = [5, 6, 7, 8];
    let frame = VtuFrame {
        points: &points,
        blocks: &blocks,
        point_data: &[VtuArray { name: "height", components: 1, values: VtuValues::Real(&heights) }],
        cell_data: &[VtuArray { name: "number", components: 1, values: VtuValues::Integer(&numbers) }],
        ..VtuFrame::default()
    };
    let options =
        VtuOptions { encoding: VtuEncoding::InlineBase64, precision: Precision::Double, compression: 0 };
    let directory = tempfile::tempdir().unwrap();
    let list = directory.path().join("frame.pvtu");
    vi_io::write_pvtu(&list, &frame, options, 6).unwrap();
    let text = std::fs::read_to_string(&list).unwrap();
    let pieces: Vec<&str> =
        text.split("Source=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    assert_eq!(pieces, ["frame_p000.vtu", "frame_p001.vtu"]);
    let mut cells = Vec::new();
    for piece in pieces {
        let vtk = Vtk::import(directory.path().join(piece)).unwrap();
        let MeshFile { mesh, point_data, cell_data, .. } = MeshFile::try_from(&vtk).unwrap();
        assert!(mesh.points.len() <= 6);
        for (cell, (_, nodes)) in mesh.cells().enumerate() {
            let at = |&node: &u32| (mesh.points[node as usize], point_data[0].values[node as usize]);
            cells.push((cell_data[0].values[cell], nodes.iter().map(at).collect::<Vec<_>>()));
        }
    }
    let expected = corners.iter().zip([5.0, 6.0, 7.0, 8.0]).map(|(nodes, number)| {
        (number, nodes.iter().map(|&node| (points[node as usize], heights[node as usize])).collect())
    });
    assert_eq!(cells, expected.collect::<Vec<_>>());
}

#[test]
fn the_model_of_vtkio_holds_all_of_a_mesh() {
    let file = sample();
    let vtk = Vtk::from(&file);
    assert_eq!(MeshFile::try_from(&vtk).unwrap(), file);
    // Write a file with vtkio and read it with the reader of this crate.
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("grid.vtu");
    vtk.export(&path).unwrap();
    assert_eq!(vi_io::read_mesh(&path).unwrap(), file);
}

#[test]
fn vtkio_reads_our_frames() {
    let file = sample();
    let directory = tempfile::tempdir().unwrap();
    for (precision, compression) in [(Precision::Double, 0), (Precision::Double, 1), (Precision::Single, 1)] {
        let path = directory.path().join(format!("frame-{precision:?}-{compression}.vtu"));
        let arrays = |arrays: &'static str, from: &[vi_io::DataArray]| (arrays, from[0].values.clone());
        let (displacement, stress) =
            (arrays("displacement", &file.point_data), arrays("von_mises", &file.cell_data));
        let frame = VtuFrame {
            points: &file.mesh.points,
            blocks: &file.mesh.blocks,
            far: &[],
            regions: &file.mesh.regions,
            point_data: &[VtuArray {
                name: displacement.0,
                components: 3,
                values: VtuValues::Real(&displacement.1),
            }],
            cell_data: &[VtuArray { name: stress.0, components: 1, values: VtuValues::Real(&stress.1) }],
            time: Some(0.25),
            field_data: &[],
        };
        let options = VtuOptions { encoding: VtuEncoding::InlineBase64, precision, compression };
        write_vtu(&path, &frame, options).unwrap();
        let vtk = Vtk::import(&path).unwrap();
        // Read the file with vtkio alone.
        let DataSet::UnstructuredGrid { pieces, .. } = &vtk.data else { panic!("{vtk:?}") };
        let piece: UnstructuredGridPiece = pieces[0].load_piece_data(None).unwrap();
        assert_eq!((pieces.len(), piece.num_points()), (1, file.mesh.points.len()));
        assert_eq!(piece.cells.num_cells(), file.mesh.cell_count());
        // Convert it to a mesh of this crate.
        let found = MeshFile::try_from(&vtk).unwrap();
        let rounded = |values: &[f64]| -> Vec<f64> {
            let single = precision == Precision::Single;
            values.iter().map(|&x| if single { f64::from(x as f32) } else { x }).collect()
        };
        assert_eq!(found.mesh.blocks, file.mesh.blocks);
        assert_eq!(found.mesh.regions, file.mesh.regions);
        assert_eq!(found.mesh.points.as_flattened(), rounded(file.mesh.points.as_flattened()));
        for (found, own) in [(&found.point_data, &file.point_data), (&found.cell_data, &file.cell_data)] {
            assert_eq!(found.len(), 1);
            assert_eq!((&found[0].name, found[0].components), (&own[0].name, own[0].components));
            assert_eq!(found[0].values, rounded(&own[0].values));
        }
    }
}

/// Data that are not a mesh give an error that names the contradiction.
#[test]
fn contradictions_are_named() {
    let change = |change: fn(&mut UnstructuredGridPiece)| {
        let mut vtk = Vtk::from(&sample());
        let DataSet::UnstructuredGrid { pieces, .. } = &mut vtk.data else { panic!() };
        let [Piece::Inline(piece)] = &mut pieces[..] else { panic!() };
        change(piece);
        vtk.file_path = Some(Path::new("grid.vtu").into());
        MeshFile::try_from(&vtk).unwrap_err()
    };
    let error = change(|piece| piece.points = vtkio::IOBuffer::F64(vec![0.0; 3]));
    assert!(matches!(error, IoError::UnknownNode { .. }), "{error}");
    let error = change(|piece| piece.data.point = vec![Attribute::generic("short", 3).with_data(vec![1.0])]);
    assert!(error.to_string().contains("grid.vtu: piece 0: the array \"short\""), "{error}");
    let error = change(|piece| piece.cells.types.truncate(2));
    assert!(error.to_string().contains("offsets for"), "{error}");
    let mut vtk = Vtk::from(&sample());
    vtk.data = DataSet::PolyData { meta: None, pieces: Vec::new() };
    let error = MeshFile::try_from(&vtk).unwrap_err();
    assert!(error.to_string().contains("unstructured grid"), "{error}");
}
