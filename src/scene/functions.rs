//! The functions of time of a scene: amplitudes of loads and of weight, and motions of supports, rigid bodies and attachments.

use vi_fem::{Amplitude, Motion};

use super::Scene;

/// A point that is not on any usual axis of rotation.
const POINT: [f64; 3] = [0.31, 0.57, 0.83];

/// Times that differ by less than this fraction of an interval are the same.
const SAME: f64 = 1e-9;

/// A function of time with one component or three.
#[derive(Debug, Clone)]
pub(crate) enum FunctionOfTime {
    /// A factor.
    Amplitude(Amplitude),
    /// The displacement of a point, m.
    Motion(Motion),
}

impl FunctionOfTime {
    /// Returns the number of components.
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Amplitude(_) => 1,
            Self::Motion(_) => 3,
        }
    }

    /// Returns a component at t (s).
    pub(crate) fn at(&self, component: usize, t: f64) -> f64 {
        match self {
            Self::Amplitude(amplitude) => amplitude.at(t),
            Self::Motion(motion) => motion.position(POINT, t)[component],
        }
    }

    /// Returns the times at which it has kinks, as far as the scene names them, s: those of tables, and the start and the end of
    /// motions.
    pub(crate) fn kinks(&self) -> Vec<f64> {
        let ends = |start: f64, end: Option<f64>| [Some(start), end].into_iter().flatten().collect();
        match self {
            Self::Amplitude(amplitude) => amplitude.times().collect(),
            Self::Motion(Motion::Translate(translate)) => ends(translate.start, translate.end),
            Self::Motion(Motion::Rotate(rotate)) => ends(rotate.start, rotate.end),
            Self::Motion(Motion::Sine(sine)) => ends(sine.start, sine.end),
            Self::Motion(Motion::Table(table)) => table.times.clone(),
            Self::Motion(_) => Vec::new(),
        }
    }

    /// Returns (t, value) of a component at `count` + 1 times at equal distances (s) and at kinks between them, in order.
    pub(crate) fn points(&self, component: usize, [from, to]: [f64; 2], count: usize) -> Vec<[f64; 2]> {
        let mut times: Vec<f64> =
            (0..=count).map(|k| from + (to - from) * (k as f64 / count as f64)).collect();
        times.extend(self.kinks().into_iter().filter(|t| (from..to).contains(t)));
        times.sort_by(f64::total_cmp);
        times.dedup_by(|t, before| *t - *before < SAME * (to - from));
        times.into_iter().map(|t| [t, self.at(component, t)]).collect()
    }
}

/// Returns the integral over time of a function of the values at points (t, value), by trapezia.
pub(crate) fn integral(points: &[[f64; 2]], of: impl Fn(f64) -> f64) -> f64 {
    points.windows(2).map(|pair| 0.5 * (of(pair[0][1]) + of(pair[1][1])) * (pair[1][0] - pair[0][0])).sum()
}

impl Scene {
    /// Returns the functions of time, each with the body on which it acts; `None` for all bodies.
    pub(crate) fn functions_of_time(&self) -> Vec<(Option<&str>, FunctionOfTime)> {
        let amplitude = |amplitude: &Amplitude| FunctionOfTime::Amplitude(amplitude.clone());
        let motion = |motion: &Option<Motion>| motion.clone().map(FunctionOfTime::Motion);
        let mut found: Vec<(Option<&str>, FunctionOfTime)> = Vec::new();
        found.extend(self.loads.iter().map(|load| (Some(load.body()), amplitude(load.amplitude()))));
        found.extend(self.gravity_amplitude.iter().map(|factor| (None, amplitude(factor))));
        let fixes = self.fixes.iter().map(|fix| (&fix.body, &fix.motion));
        let rigids = self.rigids.iter().map(|rigid| (&rigid.name, &rigid.motion));
        let attachments = self.attachments.iter().map(|attach| (&attach.body, &attach.motion));
        let moved = fixes.chain(rigids).chain(attachments);
        found.extend(moved.filter_map(|(body, moved)| Some((Some(body.as_str()), motion(moved)?))));
        found
    }
}
