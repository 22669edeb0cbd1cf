//! Observes the extremes of the probes over the rows of history.csv.

use super::error::RunError;
use super::observer::{Observer, Purpose, Sight};
use super::report::Report;
use super::results::{ColumnRange, Results};
use crate::record::{Bytes, record};
use crate::scene::{Probe, Scene};
use crate::simulation::{Observation, Simulation};

/// Extremes so far: displacements of the node probes, then the columns of the other probes.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Extremes {
    /// Per column: minimum, its time, maximum, its time.
    ranges: Vec<[f64; 4]>,
}

record!(Extremes { ranges: Vec<[f64; 4]> });

impl Extremes {
    /// Records a row of history.csv: an observation, and the columns of probes over parts of bodies.
    fn enter(&mut self, seen: &Observation, measures: &[f64]) {
        let displacements = seen.probes.iter().flat_map(|probe| probe.displacement);
        let values: Vec<f64> = displacements.chain(measures.iter().copied()).collect();
        if self.ranges.is_empty() {
            self.ranges = values.iter().map(|&value| [value, seen.t, value, seen.t]).collect();
        }
        for (range, value) in self.ranges.iter_mut().zip(values) {
            if value < range[0] {
                (range[0], range[1]) = (value, seen.t);
            }
            if value > range[2] {
                (range[2], range[3]) = (value, seen.t);
            }
        }
    }

    /// Returns the extremes with the names of their columns.
    fn of_columns(&self, scene: &Scene) -> Vec<ColumnRange> {
        let of_nodes = scene
            .node_probes()
            .flat_map(|probe| ["ux", "uy", "uz"].map(|component| format!("{}.{component}", probe.name)));
        let names = of_nodes.chain(scene.probes.iter().flat_map(Probe::columns));
        let range = |(column, &[min, at_min, max, at_max]): (String, &[f64; 4])| ColumnRange {
            column,
            min,
            at_min,
            max,
            at_max,
        };
        names.zip(&self.ranges).map(range).collect()
    }
}

impl Observer for Extremes {
    fn name(&self) -> &'static str {
        "extremes"
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        if let Sight::Row(row) = sight {
            self.enter(row.seen, row.measures);
        }
        Ok(())
    }

    fn snapshot(&self, _: Purpose) -> Bytes {
        Bytes::of(self)
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        *self = snapshot.value()?;
        Ok(())
    }

    fn report(&self, simulation: &Simulation, report: &mut Report) {
        report.results = Results::of(simulation, self.of_columns(simulation.scene()));
    }
}
