//! The VTU reader returns exactly the data that the writer was given, bit for bit in double precision.

use std::io::Cursor;
use std::path::Path;

use vi_io::{
    IoError, Precision, PvdSeries, VtuArray, VtuEncoding, VtuFrame, VtuOptions, VtuValues, encode_vtu,
    parse_vtu, write_vtu,
};
use vi_mesh::{CellBlock, CellKind, Region};

/// Returns numbers without a pattern, over many orders of magnitude.
fn noise(count: usize) -> Vec<f64> {
    let mut state = 7u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 11
    };
    (0..count).map(|i| (next() as f64 - (1u64 << 52) as f64) * 10f64.powi(i as i32 % 40 - 30)).collect()
}

#[test]
fn frames_come_back_bit_for_bit_in_every_encoding() {
    // The largest has several compressed blocks and a partial last one.
    for n in [8, 1000, 20_000] {
        let points: Vec<[f64; 3]> = noise(3 * n).as_chunks::<3>().0.to_vec();
        let velocity = noise(3 * n + 5).split_off(5);
        let tets: Vec<u32> = (0..4 * n as u32).map(|i| i * 7 % n as u32).collect();
        let blocks = [
            CellBlock { kind: CellKind::Tet4, nodes: tets },
            CellBlock { kind: CellKind::Hex8, nodes: (0..8).collect() },
        ];
        let material: Vec<i32> = (0..=n as i32).map(|i| i % 3).collect();
        let groups = [Region { name: "cl & <amp>".into(), dimension: 3, cells: vec![1, 3] }];
        let frame = VtuFrame {
            points: &points,
            blocks: &blocks,
            far: &[],
            regions: &groups,
            point_data: &[VtuArray {
                name: "a \"b\" & <c>",
                components: 3,
                values: VtuValues::Real(&velocity),
            }],
            cell_data: &[VtuArray {
                name: "material_id",
                components: 1,
                values: VtuValues::Integer(&material),
            }],
            time: Some(0.1 + 0.2),
            field_data: &[],
        };
        for encoding in [VtuEncoding::AppendedRaw, VtuEncoding::InlineBase64] {
            for precision in [Precision::Single, Precision::Double] {
                for compression in [0, 1, 6] {
                    let mut bytes = Cursor::new(Vec::new());
                    encode_vtu(&mut bytes, &frame, VtuOptions { encoding, precision, compression }).unwrap();
                    let file = parse_vtu(bytes.get_ref(), Path::new("frame.vtu")).unwrap();
                    let round =
                        |x: &f64| if precision == Precision::Single { f64::from(*x as f32) } else { *x };
                    let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                    let rounded =
                        |values: &[f64]| values.iter().map(|x| round(x).to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(file.mesh.points.as_flattened()), rounded(points.as_flattened()));
                    assert_eq!(bits(&file.point_array("a \"b\" & <c>").unwrap().values), rounded(&velocity));
                    assert_eq!(file.mesh.blocks, blocks);
                    assert_eq!(file.region("cl & <amp>").unwrap().cells, [1, 3]);
                    assert_eq!(file.region("material_id=2").unwrap().cells.len(), (n + 1) / 3);
                    assert_eq!(file.time, Some(0.1 + 0.2));
                    assert!(file.notes.is_empty());
                }
            }
        }
    }
}

#[test]
fn an_empty_mesh_is_a_file_too() {
    for encoding in [VtuEncoding::AppendedRaw, VtuEncoding::InlineBase64] {
        for compression in [0, 1] {
            let mut bytes = Cursor::new(Vec::new());
            let options = VtuOptions { encoding, compression, ..VtuOptions::default() };
            encode_vtu(&mut bytes, &VtuFrame::default(), options).unwrap();
            let file = parse_vtu(bytes.get_ref(), Path::new("empty.vtu")).unwrap();
            assert_eq!((file.mesh.points.len(), file.mesh.cell_count()), (0, 0));
        }
    }
}

#[test]
fn what_cannot_be_written_leaves_the_old_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("frame.vtu");
    std::fs::write(&path, "old").unwrap();
    let points = [[0.0, f64::NAN, 0.0]];
    let nan = write_vtu(&path, &VtuFrame { points: &points, ..VtuFrame::default() }, VtuOptions::default());
    assert!(matches!(nan, Err(IoError::BadOutput { .. })), "{nan:?}");
    let far = VtuArray { name: "u", components: 1, values: VtuValues::Real(&[1e39]) };
    let frame = VtuFrame { points: &[[0.0; 3]], point_data: &[far], ..VtuFrame::default() };
    let single = VtuOptions { precision: Precision::Single, ..VtuOptions::default() };
    assert!(matches!(write_vtu(&path, &frame, single), Err(IoError::BadOutput { .. })));
    let short = VtuArray { name: "u", components: 3, values: VtuValues::Real(&[1.0, 2.0]) };
    let frame = VtuFrame { points: &[[0.0; 3]], point_data: &[short], ..VtuFrame::default() };
    assert!(matches!(write_vtu(&path, &frame, VtuOptions::default()), Err(IoError::BadOutput { .. })));
    let nowhere =
        write_vtu(&directory.path().join("no/frame.vtu"), &VtuFrame::default(), VtuOptions::default());
    assert!(matches!(nowhere, Err(IoError::System { .. })));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1, "nothing temporary stays");
}

#[test]
fn a_series_is_whole_after_every_frame_and_can_be_continued() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run.pvd");
    let mut series = PvdSeries::new(&path);
    for i in 0..3 {
        series.push(0.1 * f64::from(i), &format!("frame & {i}.vtu")).unwrap();
        assert_eq!(PvdSeries::open(&path).unwrap(), series);
    }
    let mut again = PvdSeries::open(&path).unwrap();
    again.set_frames(series.frames()[..2].to_vec()).unwrap();
    assert_eq!(PvdSeries::open(&path).unwrap(), again);
    again.push(0.15, "other.vtu").unwrap();
    let times: Vec<f64> = PvdSeries::open(&path).unwrap().frames().iter().map(|frame| frame.0).collect();
    assert_eq!(times, [0.0, 0.1, 0.15]);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
}

/// The cost of n pushes to a series grows with n, not with n², because each appends one entry.
#[test]
fn a_long_series_is_appended_to() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run.pvd");
    let mut series = PvdSeries::new(&path);
    for i in 0..20_000 {
        series.push(f64::from(i), &format!("run_{i:06}.vtu")).unwrap();
    }
    let mut whole = PvdSeries::new(&directory.path().join("whole.pvd"));
    whole.set_frames(series.frames().to_vec()).unwrap();
    let [appended, replaced] =
        ["run.pvd", "whole.pvd"].map(|name| std::fs::read(directory.path().join(name)).unwrap());
    assert!(appended == replaced);
    // A replaced file would have another inode.
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let inode = || std::fs::metadata(&path).unwrap().ino();
        let before = inode();
        series.push(20_000.0, "run_020000.vtu").unwrap();
        assert_eq!(before, inode());
    }
}

/// If the file of a series was removed, truncated or changed, the next push writes it as a whole.
#[test]
fn a_series_whose_file_was_changed_is_repaired() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run.pvd");
    let mut series = PvdSeries::new(&path);
    series.push(0.0, "a.vtu").unwrap();
    let cut = |bytes: Vec<u8>| bytes[..bytes.len() - 5].to_vec();
    for (i, spoilt) in
        [None, Some(cut(std::fs::read(&path).unwrap())), Some(b"short".to_vec())].iter().enumerate()
    {
        match spoilt {
            None => std::fs::remove_file(&path).unwrap(),
            Some(bytes) => std::fs::write(&path, bytes).unwrap(),
        }
        series.push(i as f64 + 1.0, "b.vtu").unwrap();
        assert_eq!(PvdSeries::open(&path).unwrap(), series);
    }
}
