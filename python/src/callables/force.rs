//! Forces without a potential that are written in Python.

use std::ops::Range;
use std::sync::Mutex;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use variational::core::{Force, ForceAccount, Stencils};
use variational::model::BodyModel;

use super::{Last, Raised, lock, name_of, numbers, packed};
use crate::errors;

/// A force without a potential, `f(x, v, t)` (n, 3) in N for all n nodes of a body. `stiffness(x, v, t)` and
/// `damping(x, v, t)` (n, 3, 3) are −∂f/∂x and −∂f/∂v of each node, zero if missing.
pub(crate) struct CallableForce {
    name: String,
    object: Py<PyAny>,
    nodes: Vec<u32>,
    account: ForceAccount,
    depends_on_velocity: bool,
    has: [bool; 2],
    raised: Raised,
    last: [Mutex<Last>; 3],
}

impl CallableForce {
    /// Reads the attributes of the Python object.
    pub(crate) fn new(object: &Bound<'_, PyAny>, body: &BodyModel, raised: Raised) -> PyResult<Self> {
        if !object.is_callable() {
            return Err(errors::value("a force is a callable f(x, v, t) that returns an array (n, 3)"));
        }
        let removes = object.getattr_opt("is_damping")?.map_or(Ok(false), |flag| flag.is_truthy())?;
        let on_velocity =
            object.getattr_opt("depends_on_velocity")?.map_or(Ok(true), |flag| flag.is_truthy())?;
        Ok(Self {
            name: name_of(object)?,
            object: object.clone().unbind(),
            nodes: (0..body.mesh.points.len()).map(|node| body.node(node) as u32).collect(),
            account: if removes { ForceAccount::Damping } else { ForceAccount::Force },
            depends_on_velocity: on_velocity,
            has: [object.hasattr("stiffness")?, object.hasattr("damping")?],
            raised,
            last: Default::default(),
        })
    }

    /// Writes the numbers of `method` for the nodes of `range`. The force of a node may depend on all nodes.
    fn serve(&self, method: usize, range: Range<usize>, at: (&[f64], &[f64], f64), out: &mut [f64]) {
        let (x, v, t) = at;
        let mut last = lock(&self.last[method]);
        let width = out.len() / range.len().max(1);
        let gathered = |of: &[f64]| -> Vec<f64> {
            self.nodes.iter().flat_map(|&node| of[3 * node as usize..][..3].to_vec()).collect()
        };
        let (x, v) = (gathered(x), gathered(v));
        let is_known = last.values.len() == width * self.nodes.len()
            && last.t == t
            && last.local.iter().eq(x.iter().chain(&v));
        if !is_known {
            let count = self.nodes.len();
            let found = self.raised.guard(|py| {
                let place = PyArray1::from_slice(py, &x).reshape([count, 3])?;
                let speed = PyArray1::from_slice(py, &v).reshape([count, 3])?;
                let (name, shape): (_, &[usize]) = match method {
                    0 => ("__call__", &[count, 3]),
                    1 => ("stiffness", &[count, 3, 3]),
                    _ => ("damping", &[count, 3, 3]),
                };
                let values = numbers(self.object.bind(py), name, (place, speed, t), &[shape])?;
                Ok(if method == 0 { values } else { packed(&values, 3) })
            });
            match found {
                Some(values) => *last = Last { t, local: x.into_iter().chain(v).collect(), values },
                None => return out.fill(f64::NAN),
            }
        }
        out.copy_from_slice(&last.values[width * range.start..width * range.end]);
    }
}

impl Force for CallableForce {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> ForceAccount {
        self.account
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 3, nodes: &self.nodes }
    }

    fn depends_on_velocity(&self) -> bool {
        self.depends_on_velocity
    }

    fn forces(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]) {
        self.serve(0, range, (x, v, t), out);
    }

    fn stiffness(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]) {
        if self.has[0] { self.serve(1, range, (x, v, t), out) } else { out.fill(0.0) }
    }

    fn damping(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]) {
        if self.has[1] { self.serve(2, range, (x, v, t), out) } else { out.fill(0.0) }
    }
}
