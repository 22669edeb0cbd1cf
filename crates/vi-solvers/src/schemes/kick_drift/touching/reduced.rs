//! The small system with bodies that have constraints: their coordinates are replaced by those of their tangent spaces. Blocks of
//! three are those of the other nodes in their order, followed by those of the bodies, so that the incomplete factor loses no
//! block between nodes that touch the same body.

use nalgebra::{DMatrix, Vector3};

use crate::index::NONE;
use crate::linear::block_rows::BlockRows;
use crate::schemes::constraint::middle::TangentSpace;

/// A part of a covector: the block or place of a node, and three numbers.
pub(super) type Part = (u32, Vector3<f64>);

/// A body with constraints in the small system.
struct Body {
    /// The places of its nodes begin here.
    first_place: usize,
    node_count: usize,
    /// Its blocks in the reduced system begin here.
    first_block: usize,
    space: TangentSpace,
}

impl Body {
    fn dimension(&self) -> usize {
        self.space.right.ncols()
    }

    fn block_count(&self) -> usize {
        self.dimension().div_ceil(3)
    }

    /// Returns blocks with these coordinates of the tangent space.
    fn blocks<'a>(&'a self, coordinates: &'a [f64]) -> impl Iterator<Item = Part> + 'a {
        let blocks = coordinates.chunks(3).enumerate();
        blocks.map(|(k, chunk)| {
            let value = Vector3::from_fn(|axis, _| chunk.get(axis).copied().unwrap_or(0.0));
            ((self.first_block + k) as u32, value)
        })
    }
}

/// The map between the coordinates of the small system and those in which it is solved.
pub(super) struct Reduced {
    /// The block of each place, or [`NONE`] if it belongs to a body with constraints.
    block_of: Vec<u32>,
    /// The body of each place; its number in `bodies`, or [`NONE`].
    body_of: Vec<u32>,
    bodies: Vec<Body>,
    block_count: usize,
    /// Left and right factors of a tangent in reduced coordinates.
    factors: [Vec<Part>; 2],
}

impl Reduced {
    /// Returns the map for `place_count` places. `bodies` has the first place and the number of nodes of each body with constraints.
    pub(super) fn new(
        place_count: usize,
        bodies: impl Iterator<Item = (usize, usize, TangentSpace)>,
    ) -> Self {
        let mut body_of = vec![NONE; place_count];
        let mut bodies: Vec<Body> = bodies
            .map(|(first_place, node_count, space)| Body { first_place, node_count, first_block: 0, space })
            .collect();
        for (body, number) in bodies.iter().zip(0..) {
            body_of[body.first_place..body.first_place + body.node_count].fill(number);
        }
        let mut block_count = 0;
        let mut next = || {
            block_count += 1;
            block_count - 1
        };
        let block_of = body_of.iter().map(|&body| if body == NONE { next() } else { NONE }).collect();
        let mut block_count = block_count as usize;
        for body in &mut bodies {
            body.first_block = block_count;
            block_count += body.block_count();
        }
        Self { block_of, body_of, bodies, block_count, factors: Default::default() }
    }

    /// Begins the matrix J/c with the inertia of all nodes; `mass` returns m/c at a place.
    pub(super) fn begin(&self, matrix: &mut BlockRows, mass: impl Fn(usize) -> Vector3<f64>) {
        let mut diagonal = vec![Vector3::zeros(); self.block_count];
        for (place, &block) in self.block_of.iter().enumerate().filter(|(_, block)| **block != NONE) {
            diagonal[block as usize] = mass(place);
        }
        // Coordinates that only fill the last block of a body stay zero.
        for body in &self.bodies {
            for k in body.dimension()..3 * body.block_count() {
                diagonal[body.first_block + k / 3][k % 3] = 1.0;
            }
        }
        matrix.begin(diagonal.into_iter());
        for body in &self.bodies {
            let mut unit = vec![0.0; body.dimension()];
            for k in 0..body.dimension() {
                unit[k] = 1.0;
                let row: Vec<f64> = body.space.inertia.row(k).iter().copied().collect();
                let [left, right] = [&unit, &row].map(|values| body.blocks(values).collect::<Vec<Part>>());
                matrix.add(&left, &right);
                unit[k] = 0.0;
            }
        }
    }

    /// Adds a dyad of the small system.
    pub(super) fn add(&mut self, matrix: &mut BlockRows, left: &[Part], right: &[Part]) {
        let [mut a, mut b] = std::mem::take(&mut self.factors);
        self.reduce(left, |space| &space.left, &mut a);
        self.reduce(right, |space| &space.right, &mut b);
        matrix.add(&a, &b);
        self.factors = [a, b];
    }

    /// Writes a covector in reduced coordinates.
    fn reduce(&self, parts: &[Part], basis: impl Fn(&TangentSpace) -> &DMatrix<f64>, out: &mut Vec<Part>) {
        out.clear();
        let mut bodies: Vec<u32> = Vec::new();
        for &(place, value) in parts {
            match self.body_of[place as usize] {
                NONE => out.push((self.block_of[place as usize], value)),
                body if bodies.contains(&body) => {}
                body => bodies.push(body),
            }
        }
        for number in bodies {
            let body = &self.bodies[number as usize];
            let basis = basis(&body.space);
            let mut sum = vec![0.0; body.dimension()];
            for (place, value) in parts.iter().filter(|(place, _)| self.body_of[*place as usize] == number) {
                let first = 3 * (*place as usize - body.first_place);
                for (k, sum) in sum.iter_mut().enumerate() {
                    *sum += (0..3).map(|axis| basis[(first + axis, k)] * value[axis]).sum::<f64>();
                }
            }
            out.extend(body.blocks(&sum));
        }
    }

    /// Returns a residual of the small system in reduced coordinates.
    pub(super) fn residual(&self, full: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; 3 * self.block_count];
        for (place, &block) in self.block_of.iter().enumerate().filter(|(_, block)| **block != NONE) {
            let (from, to) = (3 * place, 3 * block as usize);
            out[to..to + 3].copy_from_slice(&full[from..from + 3]);
        }
        for body in &self.bodies {
            let first = 3 * body.first_place;
            for (k, column) in body.space.left.column_iter().enumerate() {
                let along = column.iter().zip(&full[first..first + 3 * body.node_count]);
                out[3 * body.first_block + k] = along.map(|(a, b)| a * b).sum();
            }
        }
        out
    }

    /// Writes the change of all coordinates of the small system for that of the reduced ones.
    pub(super) fn expand(&self, reduced: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.resize(3 * self.block_of.len(), 0.0);
        for (place, &block) in self.block_of.iter().enumerate().filter(|(_, block)| **block != NONE) {
            let (to, from) = (3 * place, 3 * block as usize);
            out[to..to + 3].copy_from_slice(&reduced[from..from + 3]);
        }
        for body in &self.bodies {
            let (first, from) = (3 * body.first_place, 3 * body.first_block);
            for (k, column) in body.space.right.column_iter().enumerate() {
                let value = reduced[from + k];
                out[first..].iter_mut().zip(&column).for_each(|(out, entry)| *out += value * entry);
            }
        }
    }

    /// Returns the square of the residual of the bodies in the norm of M⁻¹ with masses in a unit, in which their bases are orthonormal.
    pub(super) fn square_of_bodies(&self, reduced: &[f64]) -> f64 {
        let of = |body: &Body| &reduced[3 * body.first_block..3 * body.first_block + body.dimension()];
        self.bodies.iter().flat_map(of).map(|value| value * value).sum()
    }

    /// Returns whether a place belongs to a body with constraints.
    pub(super) fn is_of_body(&self, place: usize) -> bool {
        self.body_of[place] != NONE
    }
}
