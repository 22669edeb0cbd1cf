//! The state of a sum of live terms, from which a run continues with the same bits.

use vi_core::{Coordinates, Tube};

use crate::assemble::passage::Remembered;
use crate::memory::StepperMemory;
use crate::vectors;

/// A motion that is a larger multiple of the shortest reach is far: stencils are requested along it. With 4, 8 and 16
/// `scenes/contact/box-bounces.toml` makes 26 892, 18 827 and 18 756 searches; the blocks of `patch.toml` take .5, .5 and 1.7 s.
pub(super) const FAR: f64 = 8.0;
/// Reach of a region for the iterates of a step, as a fraction of its path, or of the extent of the bodies where the path is longer.
const ITERATES: f64 = 0.05;

/// The configurations for which stencils were requested, as places of nodes ([`vi_core::Coordinates::places`]): every node is within
/// `reach` (m) of the same part of its straight path, which begins at `about` (m) and leads along `motion` (m). The motion is empty if
/// the path is one place.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Region {
    pub(super) about: Vec<f64>,
    pub(super) motion: Vec<f64>,
    pub(super) reach: f64,
}

impl Region {
    /// Returns a region that contains x, the `others`, and what is within `shortest` (m) of x; `None` if places are not finite.
    ///
    /// If they are far apart, the region leads along the path from x to the last of the others: nodes that
    /// move together then have few more stencils than nodes at rest.
    pub(super) fn around<'a>(
        coordinates: &Coordinates,
        x: &[f64],
        others: impl IntoIterator<Item = &'a [f64]> + Clone,
        shortest: f64,
    ) -> Option<Self> {
        let apart = others.clone().into_iter().map(|other| distance(x, other)).fold(0.0, f64::max);
        if !apart.is_finite() || !vectors::all_finite(x) {
            return None;
        }
        let about = x.to_vec();
        let last = others.clone().into_iter().last();
        let Some(end) = last.filter(|_| apart > FAR * shortest && x.len().is_multiple_of(3)) else {
            return Some(Self { about, motion: Vec::new(), reach: shortest.max(1.0001 * apart) });
        };
        let motion = end.iter().zip(x).map(|(end, x)| end - x).collect();
        let path = Tube { start: about, motion, reach: vec![0.0; x.len() / 3] };
        let from_path = others.into_iter().flat_map(|other| path.distances(other)).fold(0.0, f64::max);
        let room = ITERATES * (2.0 * path.largest_reach()).min(coordinates.extent_and_reach(x)[0]);
        let Tube { start: about, motion, .. } = path;
        Some(Self { about, motion, reach: shortest.max(1.0001 * from_path).max(room) })
    }

    /// Returns whether no node is farther than the reach from its place at the start.
    pub(super) fn is_near(&self, x: &[f64]) -> bool {
        self.about.len() == x.len() && distance(x, &self.about) <= self.reach
    }

    /// Returns the region as a tube; `None` if its path is one place.
    pub(super) fn tube(&self) -> Option<Tube> {
        let (start, motion) = (self.about.clone(), self.motion.clone());
        let reach = vec![self.reach; start.len() / 3];
        (!motion.is_empty()).then_some(Tube { start, motion, reach })
    }

    fn save(&self, name: &str, memory: &mut StepperMemory) {
        memory.arrays.push((format!("{name}.about"), self.about.clone()));
        memory.arrays.push((format!("{name}.motion"), self.motion.clone()));
        memory.arrays.push((format!("{name}.reach"), vec![self.reach]));
    }

    fn restore(name: &str, memory: &StepperMemory, count: usize) -> Option<Self> {
        let array = |part: &str| {
            let found = memory.arrays.iter().find(|(key, _)| *key == format!("{name}.{part}"));
            found.map(|(_, values)| values.clone())
        };
        let (about, motion) = (array("about")?, array("motion")?);
        let &[reach] = array("reach")?.as_slice() else { return None };
        let fits = |values: &[f64]| values.is_empty() || values.len() == count;
        (fits(&about) && fits(&motion)).then_some(Self { about, motion, reach })
    }
}

/// Returns a bound on the distances of nodes between two configurations, m.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    // The distance is at most √3 times the largest change of a coordinate, for nodes in space.
    3.0_f64.sqrt() * vectors::max_abs(a.len(), |k| a[k] - b[k])
}

/// The configurations from which the stencils of live terms come. Two sums with equal values give equal bits.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct LiveState {
    /// The region of the stencils; empty before the first call.
    pub(super) region: Region,
    /// The region of the stencils from which the pattern of the sum of Hessians was built.
    pub(super) pattern: Region,
    /// The memory of the terms in the current step.
    pub(super) step: Remembered,
}

impl LiveState {
    /// Returns the memory of the terms alone, without the configurations of the stencils.
    pub(crate) fn of_memory(state: Self) -> Self {
        Self { step: state.step, ..Self::default() }
    }

    pub(crate) fn save(&self, name: &str, memory: &mut StepperMemory) {
        self.region.save(&format!("{name}.region"), memory);
        self.pattern.save(&format!("{name}.pattern"), memory);
        self.step.remember(name, memory);
    }

    /// Returns the configurations and the memory that [`LiveState::save`] recorded; `None` if they are not for `count`
    /// coordinates.
    pub(crate) fn restore(name: &str, memory: &StepperMemory, count: usize) -> Option<Self> {
        let region = Region::restore(&format!("{name}.region"), memory, count)?;
        let pattern = Region::restore(&format!("{name}.pattern"), memory, count)?;
        Some(Self { region, pattern, step: Remembered::recall(name, memory)? })
    }
}
