//! Nodes with their own axes: their coordinates are the components y_k in x_i = Σ_k y_k e_k with orthonormal e_k. A
//! roller on an inclined plane is such a node, with y_0 prescribed along the normal e_0. The lumped mass of a node is
//! isotropic, so it is the same along any axes.

use crate::error::CoreError;

/// Largest deviation of axes from orthonormality.
const ORTHONORMAL: f64 = 1e-9;

/// The axes of one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeAxes {
    /// The node.
    pub node: u32,
    /// e_0, e_1, e_2: orthonormal vectors.
    pub axes: [[f64; 3]; 3],
}

/// All nodes with their own axes, ascending.
#[derive(Debug, Clone, Default)]
pub(crate) struct AllNodeAxes(Vec<NodeAxes>);

impl AllNodeAxes {
    pub(crate) fn new(dof_count: usize, mut list: Vec<NodeAxes>) -> Result<Self, CoreError> {
        list.sort_unstable_by_key(|own| own.node);
        let what = "nodes with axes of their own";
        for (k, NodeAxes { node, axes }) in list.iter().enumerate() {
            let dof = 3 * *node as usize;
            if dof + 3 > dof_count || k > 0 && list[k - 1].node == *node {
                return Err(CoreError::Coordinate { what, dof, count: dof_count });
            }
            for a in 0..3 {
                for b in 0..=a {
                    let product: f64 = (0..3).map(|i| axes[a][i] * axes[b][i]).sum();
                    let expected = f64::from(u8::from(a == b));
                    let error = (product - expected).abs();
                    if error.is_nan() || error >= ORTHONORMAL {
                        return Err(CoreError::Axes { node: *node as usize, product, axes: [b, a] });
                    }
                }
            }
        }
        Ok(Self(list))
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn list(&self) -> &[NodeAxes] {
        &self.0
    }

    pub(crate) fn of(&self, node: u32) -> Option<&[[f64; 3]; 3]> {
        let place = self.0.binary_search_by_key(&node, |own| own.node).ok()?;
        Some(&self.0[place].axes)
    }

    /// Computes y_k = e_k · x.
    pub(crate) fn to_own(&self, x: &mut [f64]) {
        for NodeAxes { node, axes } in &self.0 {
            let own = &mut x[3 * *node as usize..][..3];
            let v = [own[0], own[1], own[2]];
            for (y, e) in own.iter_mut().zip(axes) {
                *y = e[0] * v[0] + e[1] * v[1] + e[2] * v[2];
            }
        }
    }

    /// Computes x = Σ_k y_k e_k.
    pub(crate) fn to_space(&self, y: &mut [f64]) {
        for NodeAxes { node, axes: [a, b, c] } in &self.0 {
            let own = &mut y[3 * *node as usize..][..3];
            let v = [own[0], own[1], own[2]];
            for i in 0..3 {
                own[i] = a[i] * v[0] + b[i] * v[1] + c[i] * v[2];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Coordinates, Fixed, Prescribed};

    fn axes() -> [[f64; 3]; 3] {
        [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]
    }

    /// A component prescribed along a direction keeps its value, and free components move normal to it; S and Sᵀ are
    /// adjoint.
    #[test]
    fn coordinates_count_along_own_axes() {
        let held = Prescribed { dofs: vec![3], path: Box::new(Fixed(vec![2.0])) };
        let own = vec![NodeAxes { node: 1, axes: axes() }];
        let coordinates = Coordinates::new(6, vec![held]).unwrap().with_axes(own).unwrap();
        assert!(!coordinates.is_plain() && coordinates.free_count() == 5);
        let q = [1.0, 2.0, 3.0, 4.0, 5.0];
        let mut x = [0.0; 6];
        coordinates.embed(&q, 0.0, &mut x);
        let along = |v: &[f64], e: [f64; 3]| (0..3).map(|k| v[k] * e[k]).sum::<f64>();
        assert!((along(&x[3..], axes()[0]) - 2.0).abs() < 1e-15);
        assert!((along(&x[3..], axes()[1]) - 4.0).abs() < 1e-15);
        let mut back = [0.0; 5];
        coordinates.coordinates_of(&x, &mut back);
        assert!(q.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-14));
        let force = [1.0, -2.0, 3.0, 0.5, 0.25, -4.0];
        let (mut velocity, mut pulled, mut on_free) = ([0.0; 6], force, [0.0; 5]);
        coordinates.embed_velocity(&q, 0.0, &mut velocity);
        coordinates.pull_back(&mut pulled);
        coordinates.restrict(&pulled, &mut on_free);
        let power: f64 = force.iter().zip(velocity).map(|(f, v)| f * v).sum();
        let by_free: f64 = on_free.iter().zip(q).map(|(f, v)| f * v).sum();
        assert!((power - by_free).abs() < 1e-13);
    }

    #[test]
    fn axes_that_are_not_orthonormal_are_refused() {
        let all = || Coordinates::all_free(6);
        let skew = NodeAxes { node: 1, axes: [[1.0, 0.0, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]] };
        assert!(matches!(all().with_axes(vec![skew]), Err(CoreError::Axes { node: 1, axes: [0, 1], .. })));
        let far = NodeAxes { node: 2, axes: axes() };
        assert!(matches!(all().with_axes(vec![far]), Err(CoreError::Coordinate { .. })));
    }
}
