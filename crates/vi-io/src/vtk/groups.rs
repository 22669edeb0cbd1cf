//! Makes groups from cell arrays: VTK files have no named groups, so integer arrays with known names represent them.

use std::collections::BTreeMap;

use crate::mesh::{DataArray, MeshFile};
use vi_mesh::Region;

/// Arrays whose values are numbers of regions. Region 3 becomes the group "material_id=3"; in Gmsh's own array it
/// becomes "3", as an unnamed physical group of a .msh file does.
pub(crate) const REGION_ARRAYS: [&str; 5] =
    ["region_id", "material_id", "body_id", "gmsh:physical", "CellEntityIds"];
/// Arrays `group:<name>` hold 1 in the cells of the group, and 0 in the others.
const MEMBER_PREFIX: &str = "group:";
/// An array with more values than this is taken for a numbering of cells, not for regions.
const REGION_LIMIT: usize = 1000;

/// Returns the name of the array that marks the cells of a region.
pub(crate) fn array_of(region: &str) -> String {
    format!("{MEMBER_PREFIX}{region}")
}

/// Makes groups of the arrays that represent them. `group:…` arrays are consumed, the others are kept.
pub(crate) fn from_arrays(out: &mut MeshFile) {
    let dimensions: Vec<u8> = out.mesh.cells().map(|(kind, _)| kind.dimension() as u8).collect();
    let arrays = std::mem::take(&mut out.cell_data);
    for array in arrays {
        if let Some(name) = array.name.strip_prefix(MEMBER_PREFIX).filter(|_| is_integer(&array)) {
            let mut members: BTreeMap<u8, Vec<u32>> = BTreeMap::new();
            for (i, _) in array.values.iter().enumerate().filter(|(_, value)| **value != 0.0) {
                members.entry(dimensions[i]).or_default().push(i as u32);
            }
            out.mesh.regions.extend(members.into_iter().map(|(dimension, cells)| Region {
                name: name.into(),
                dimension: dimension.into(),
                cells,
            }));
            continue;
        }
        if REGION_ARRAYS.contains(&array.name.as_str()) && is_integer(&array) {
            let mut members: BTreeMap<(u8, i64), Vec<u32>> = BTreeMap::new();
            for (i, &value) in array.values.iter().enumerate() {
                members.entry((dimensions[i], value as i64)).or_default().push(i as u32);
            }
            if members.len() > REGION_LIMIT {
                out.notes.push(format!(
                    "\"{}\" has {} values: too many for regions",
                    array.name,
                    members.len()
                ));
            } else {
                out.mesh.regions.extend(members.into_iter().map(|((dimension, value), cells)| {
                    let gmsh = array.name == "gmsh:physical";
                    let name = if gmsh { value.to_string() } else { format!("{}={value}", array.name) };
                    Region { name, dimension: dimension.into(), cells }
                }));
            }
        }
        out.cell_data.push(array);
    }
}

fn is_integer(array: &DataArray) -> bool {
    array.components == 1 && array.values.iter().all(|value| value.fract() == 0.0)
}
