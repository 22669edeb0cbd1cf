//! From fixes to prescribed coordinates. It must not know where the nodes came from.

use std::collections::HashMap;

use vi_core::{Coordinates, CoreError, Fixed, Path, Prescribed};
use vi_fem::{FemError, Motion};

use crate::scene::{Fix, Problem};

/// A fix with its nodes found.
pub(super) struct NodalFix<'a> {
    /// Number of the fix in the scene, for messages.
    pub(super) index: usize,
    pub(super) fix: &'a Fix,
    /// Their numbers in the component, and in the mesh of the body.
    pub(super) nodes: Vec<(u32, u32)>,
}

/// The coordinates of a component whose nodes start at x (m, 3 a node), with `others` prescribed too.
///
/// The same coordinate may be named by several fixes if they agree on its motion.
pub(super) fn coordinates(
    fixes: &[NodalFix],
    others: Vec<Prescribed>,
    x: &[f64],
) -> Result<Coordinates, Problem> {
    let mut owner: HashMap<u32, usize> = HashMap::new();
    let mut groups = others;
    let mut held = Vec::new();
    for (i, nodal) in fixes.iter().enumerate() {
        let mut dofs = Vec::new();
        for &(number, node) in &nodal.nodes {
            for &axis in &nodal.fix.axes {
                let dof = 3 * number + axis as u32;
                match owner.get(&dof) {
                    None => {
                        owner.insert(dof, i);
                        dofs.push(dof);
                    }
                    Some(&other) if fixes[other].fix.motion == nodal.fix.motion => {}
                    Some(&other) => {
                        return Err(Problem::new(
                            format!("fix[{}]", nodal.index),
                            format!(
                                "prescribes node {node} along {axis:?} with another motion than fix[{}]; \
                                 let each coordinate follow one",
                                fixes[other].index
                            ),
                        ));
                    }
                }
            }
        }
        match &nodal.fix.motion {
            None => held.extend(dofs),
            Some(motion) => {
                if !dofs.is_empty() {
                    let path = path(motion, &dofs, x).map_err(|error| {
                        Problem::new(format!("fix[{}].motion", nodal.index), error.to_string())
                    })?;
                    groups.push(Prescribed { dofs, path });
                }
            }
        }
    }
    if !held.is_empty() {
        let places = held.iter().map(|&dof| x[dof as usize]).collect();
        groups.push(Prescribed { dofs: held, path: Box::new(Fixed(places)) });
    }
    Coordinates::new(x.len(), groups).map_err(|error: CoreError| Problem::new("fix", error.to_string()))
}

fn path(motion: &Motion, dofs: &[u32], x: &[f64]) -> Result<Box<dyn Path>, FemError> {
    let start = |&dof: &u32| {
        let node = dof as usize / 3;
        (std::array::from_fn(|k| x[3 * node + k]), dof as usize % 3)
    };
    motion.path(dofs.iter().map(start).collect())
}
