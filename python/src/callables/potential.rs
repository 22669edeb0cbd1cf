//! Potentials that are written in Python.

use std::ops::Range;
use std::sync::Mutex;

use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use variational::core::{Account, Fault, HessianKind, Potential, Stencils, Traits};
use variational::model::BodyModel;

use super::{Last, Raised, lock, name_of, numbers, packed};
use crate::errors;

/// A potential Σ V_s with `nodes` (m, k), `energy(x)` (m,), `gradient(x)` (m, k, 3) and, optionally, `hessian(x)`
/// (m, k, 3, k, 3), for positions x (m, k, 3). With `time_dependent = True` the methods take (x, t).
pub(crate) struct CallablePotential {
    name: String,
    object: Py<PyAny>,
    /// Numbers of the nodes in the component.
    nodes: Vec<u32>,
    arity: usize,
    time_dependent: bool,
    has_hessian: bool,
    /// Step of the differences of the gradient, m.
    difference: f64,
    raised: Raised,
    energies: Mutex<Last>,
    gradients: Mutex<Last>,
    hessians: Mutex<Last>,
}

impl CallablePotential {
    /// Reads the attributes of the Python object.
    pub(crate) fn new(object: &Bound<'_, PyAny>, body: &BodyModel, raised: Raised) -> PyResult<Self> {
        for method in ["nodes", "energy", "gradient"] {
            if !object.hasattr(method)? {
                let class = object.get_type();
                return Err(errors::value(format!(
                    "{} has no `{method}`: a potential has nodes, energy and gradient",
                    class.name()?
                )));
            }
        }
        let (nodes, arity) = nodes_of(object, body)?;
        let flag = |name: &str| -> PyResult<bool> {
            object.getattr_opt(name)?.map_or(Ok(false), |flag| flag.is_truthy())
        };
        let points = &body.mesh.points;
        let extent = (0..3).map(|k| {
            let along = || points.iter().map(|x| x[k]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        });
        Ok(Self {
            name: name_of(object)?,
            object: object.clone().unbind(),
            nodes,
            arity,
            time_dependent: flag("time_dependent")?,
            has_hessian: object.hasattr("hessian")?,
            difference: 1e-6 * extent.fold(0.0, f64::max),
            raised,
            energies: Mutex::default(),
            gradients: Mutex::default(),
            hessians: Mutex::default(),
        })
    }

    fn count(&self) -> usize {
        self.nodes.len() / self.arity
    }

    /// Returns the positions of the nodes of these stencils.
    fn local(&self, range: Range<usize>, x: &[f64]) -> impl Iterator<Item = f64> {
        let nodes = &self.nodes[range.start * self.arity..range.end * self.arity];
        nodes.iter().flat_map(move |&node| (0..3).map(move |k| x[3 * node as usize + k]))
    }

    /// Writes `width` numbers per stencil of `range` from the last result, or from a new one if positions or time of
    /// these stencils have changed since.
    fn serve(
        &self,
        last: &Mutex<Last>,
        range: Range<usize>,
        (x, t): (&[f64], f64),
        out: &mut [f64],
        evaluate: impl FnOnce(&[f64]) -> Option<Vec<f64>>,
    ) {
        let mut last = lock(last);
        let (size, width) = (3 * self.arity, out.len() / range.len().max(1));
        let is_known = last.values.len() == width * self.count()
            && (!self.time_dependent || last.t == t)
            && last.local[size * range.start..size * range.end]
                .iter()
                .copied()
                .eq(self.local(range.clone(), x));
        if !is_known {
            let local: Vec<f64> = self.local(0..self.count(), x).collect();
            match evaluate(&local) {
                Some(values) => *last = Last { t, local, values },
                None => return out.fill(f64::NAN),
            }
        }
        out.copy_from_slice(&last.values[width * range.start..width * range.end]);
    }

    /// Calls a method at the positions `local` of all stencils.
    fn call(&self, method: &str, local: &[f64], t: f64, shapes: &[&[usize]]) -> Option<Vec<f64>> {
        self.raised.guard(|py| {
            let x = PyArray1::from_slice(py, local).reshape([self.count(), self.arity, 3])?;
            let object = self.object.bind(py);
            if self.time_dependent {
                numbers(object, method, (x, t), shapes)
            } else {
                numbers(object, method, (x,), shapes)
            }
        })
    }

    fn gradient_at(&self, local: &[f64], t: f64) -> Option<Vec<f64>> {
        self.call("gradient", local, t, &[&[self.count(), self.arity, 3]])
    }

    /// Returns the packed Hessians, from the method or from central differences of the gradient.
    fn hessian_at(&self, local: &[f64], t: f64) -> Option<Vec<f64>> {
        let (m, k, n) = (self.count(), self.arity, 3 * self.arity);
        let full = if self.has_hessian {
            self.call("hessian", local, t, &[&[m, k, 3, k, 3], &[m, n, n]])?
        } else {
            let mut full = vec![0.0; m * n * n];
            for column in 0..n {
                let moved = |by: f64| {
                    let mut moved = local.to_vec();
                    (0..m).for_each(|s| moved[n * s + column] += by);
                    self.gradient_at(&moved, t)
                };
                let (ahead, behind) = (moved(self.difference)?, moved(-self.difference)?);
                for (entry, (a, b)) in ahead.iter().zip(&behind).enumerate() {
                    full[entry * n + column] = (a - b) / (2.0 * self.difference);
                }
            }
            full
        };
        Some(packed(&full, n))
    }
}

/// Returns the attribute `nodes` (m, k) as numbers of the component, and k.
fn nodes_of(object: &Bound<'_, PyAny>, body: &BodyModel) -> PyResult<(Vec<u32>, usize)> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("ascontiguousarray", (object.getattr("nodes")?, "int64"))?;
    let array = array.cast_into::<PyArrayDyn<i64>>()?;
    let &[_, arity] = array.shape() else {
        let shape = array.shape();
        return Err(errors::value(format!("nodes: expected an array of shape (m, k), found {shape:?}")));
    };
    let count = body.mesh.points.len();
    let number = |&node: &i64| match usize::try_from(node).ok().filter(|&node| node < count) {
        Some(node) => Ok(body.node(node) as u32),
        None => Err(errors::value(format!(
            "nodes: body '{}' has nodes 0 to {}, not {node}",
            body.name,
            count - 1
        ))),
    };
    let nodes = array.readonly().to_vec().map_err(errors::value)?;
    Ok((nodes.iter().map(number).collect::<PyResult<_>>()?, arity.max(1)))
}

impl Potential for CallablePotential {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Load
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: self.time_dependent }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let count = self.count();
        self.serve(&self.energies, range, (x, t), out, |local| self.call("energy", local, t, &[&[count]]));
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.serve(&self.gradients, range, (x, t), out, |local| self.gradient_at(local, t));
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.serve(&self.hessians, range, (x, t), out, |local| self.hessian_at(local, t));
    }

    fn fault(&self, stencil: usize, x: &[f64], t: f64) -> Option<Fault> {
        let mut energy = [0.0];
        self.energies(stencil..stencil + 1, x, t, &mut energy);
        let domain = "must be finite";
        let [value] = energy;
        (!value.is_finite()).then_some(Fault {
            element: stencil,
            quantity: "energy",
            value,
            domain,
            at_any_state: false,
        })
    }
}
