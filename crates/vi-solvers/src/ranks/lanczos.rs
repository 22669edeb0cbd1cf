//! The vectors of Lanczos' method for the highest frequency (`schemes/lanczos.rs`), restricted to the portion of one of
//! several ranks. The first rank computes only the sums over all ranks.

use vi_core::{Exchange, System};

use crate::assemble::assembler::Assembler;
use crate::vectors;

/// The vectors on the free coordinates of a portion.
pub(crate) struct Lanczos {
    t: f64,
    per_unit: f64,
    displacement: f64,
    q: Vec<f64>,
    previous: Vec<f64>,
    current: Vec<f64>,
    /// The product with the current vector, then the next vector before it is normalised.
    last: Vec<f64>,
}

impl Lanczos {
    /// Starts with a vector, about the free coordinates `q`. `scales` are the inverse of the unit of mass and the largest displacement
    /// of a difference.
    pub(crate) fn new(t: f64, scales: [f64; 2], q: Vec<f64>, vector: Vec<f64>) -> Self {
        let [per_unit, displacement] = scales;
        let (previous, current) = (vec![0.0; q.len()], vec![0.0; q.len()]);
        Self { t, per_unit, displacement, q, previous, current, last: vector }
    }

    /// Divides the last vector by its norm and multiplies it, together with the other ranks. Returns the terms of the product of
    /// both.
    pub(crate) fn multiply(
        &mut self,
        norm: f64,
        system: &System,
        assembler: &mut Assembler,
        exchange: &dyn Exchange,
    ) -> Vec<f64> {
        let Self { t, per_unit, displacement, q, previous, current, last } = self;
        let (n, mass, coordinates) = (q.len(), system.free_mass(), system.coordinates());
        std::mem::swap(previous, current);
        std::mem::swap(current, last);
        vectors::update(current, |_, v| *v /= norm);
        let root_mass = |k: usize| (mass[k] * *per_unit).sqrt();
        let direction = |k: usize| current[k] / root_mass(k);
        let own = vectors::max_abs(n, |k| direction(k) / *displacement);
        let of_ranks = exchange.pieces(&own.to_le_bytes());
        let of_ranks =
            of_ranks.iter().filter_map(|bytes| bytes.first_chunk().map(|&bytes| f64::from_le_bytes(bytes)));
        let epsilon = 1.0 / of_ranks.fold(0.0, f64::max);
        let (mut x, mut gradient) = (vec![0.0; coordinates.dof_count()], vec![0.0; coordinates.dof_count()]);
        let mut displaced = vec![0.0; n];
        vectors::fill(&mut displaced, |k| q[k] + epsilon * direction(k));
        coordinates.embed(&displaced, *t, &mut x);
        assembler.gradient(&x, *t, &mut gradient);
        coordinates.restrict(&gradient, last);
        vectors::fill(&mut displaced, |k| q[k] - epsilon * direction(k));
        coordinates.embed(&displaced, *t, &mut x);
        assembler.gradient(&x, *t, &mut gradient);
        let free = coordinates.free();
        vectors::update(last, |k, last| {
            *last = (*last - gradient[free[k] as usize]) / (2.0 * epsilon) / root_mass(k) * *per_unit;
        });
        last.iter().zip(current).map(|(last, current)| *last * *current).collect()
    }

    /// Subtracts the current and the earlier vector with these factors from the product; returns its squares.
    pub(crate) fn subtract(&mut self, [alpha, beta]: [f64; 2]) -> Vec<f64> {
        let Self { previous, current, last, .. } = self;
        vectors::update(last, |k, last| *last -= alpha * current[k] + beta * previous[k]);
        last.iter().map(|last| last * last).collect()
    }
}
