//! The state of a sum of live terms, from which a run continues with the same bits.

use crate::assemble::passage::Remembered;
use crate::memory::StepperMemory;

/// The configurations from which the stencils of live terms come. Two sums with equal values give equal bits.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct LiveState {
    /// Positions about which the stencils were requested, and their reach, m. Empty before the first call.
    pub(super) about: Vec<f64>,
    pub(super) reach: f64,
    /// Positions and reach of the stencils from which the pattern of the sum of Hessians was built.
    pub(super) pattern_about: Vec<f64>,
    pub(super) pattern_reach: f64,
    /// The memory of the terms in the current step.
    pub(super) step: Remembered,
}

impl LiveState {
    /// Returns the memory of the terms alone, without the configurations of the stencils.
    pub(crate) fn of_memory(state: Self) -> Self {
        Self { step: state.step, ..Self::default() }
    }

    pub(crate) fn save(&self, name: &str, memory: &mut StepperMemory) {
        memory.arrays.push((format!("{name}.about"), self.about.clone()));
        memory.arrays.push((format!("{name}.pattern_about"), self.pattern_about.clone()));
        memory.arrays.push((format!("{name}.reaches"), vec![self.reach, self.pattern_reach]));
        self.step.remember(name, memory);
    }

    /// Returns what [`LiveState::save`] recorded; `None` if it is not for `count` coordinates.
    pub(crate) fn restore(name: &str, memory: &StepperMemory, count: usize) -> Option<Self> {
        let array = |part: &str| {
            let found = memory.arrays.iter().find(|(key, _)| *key == format!("{name}.{part}"));
            found.map(|(_, values)| values.clone())
        };
        let (about, pattern_about) = (array("about")?, array("pattern_about")?);
        let &[reach, pattern_reach] = array("reaches")?.as_slice() else { return None };
        let fits = |values: &[f64]| values.is_empty() || values.len() == count;
        let is_sound = fits(&about) && fits(&pattern_about);
        let step = Remembered::recall(name, memory)?;
        is_sound.then_some(Self { about, reach, pattern_about, pattern_reach, step })
    }
}
