//! Laws of every mesh that a reader returns, for any file. The tests and the fuzz targets share them.

use std::path::Path;

use vi_io::{IoError, MeshFile};

/// Panics if the result of reading `file` breaks a law.
pub(crate) fn hold(file: &Path, result: &Result<MeshFile, IoError>) {
    let read = match result {
        Ok(read) => read,
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with(&*file.to_string_lossy()), "no file in: {message}");
            assert!(message.len() < 1000 && !message.contains('\n'), "no single line: {message}");
            return;
        }
    };
    assert!(read.mesh.points.as_flattened().iter().all(|x| x.is_finite()), "a coordinate is not finite");
    for (kind, nodes) in read.mesh.cells() {
        assert_eq!(nodes.len(), kind.node_count());
        assert!(nodes.iter().all(|&node| (node as usize) < read.mesh.points.len()), "a node is out of range");
    }
    for block in &read.mesh.blocks {
        assert!(
            !block.nodes.is_empty() && block.nodes.len() % block.kind.node_count() == 0,
            "a broken block"
        );
    }
    let cell_count = read.mesh.cell_count();
    for group in &read.mesh.regions {
        assert!(group.dimension <= 3 || group.cells.is_empty());
        assert!(group.cells.is_sorted_by(|a, b| a < b), "the cells of a group are not ascending");
        assert!(
            group.cells.iter().all(|&cell| (cell as usize) < cell_count),
            "a cell of a group is out of range"
        );
    }
    for (arrays, count) in [(&read.point_data, read.mesh.points.len()), (&read.cell_data, cell_count)] {
        for array in arrays {
            assert!(array.components > 0);
            assert_eq!(
                array.values.len(),
                count * array.components,
                "an array has another length than its mesh"
            );
        }
    }
}
