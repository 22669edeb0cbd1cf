//! Measures the rate of change of the functions of time that act on a component: amplitudes of loads and weight, and
//! motions of supports. These functions are known in advance, so adaptive steps resolve them in each interval, whether
//! it is run forwards or backwards.
//!
//! With a step h, the impulse of a function f over an interval has an error of h²V/12, where V = ∫|f̈| dt is the total variation
//! of ḟ, kinks included. It is compared with the impulse S of the deviation of f from its mean,
//! ```text
//! ν² = V/S,   S = max(∫|f − f̄| dt over the interval, its length × the mean of |f − f̄| over the run).
//! ```
//! For a sine of frequency ν this is ν, in every interval, and for a ramp zero. The second bound keeps functions that begin
//! slowly from asking for many steps, and still resolves a pulse that is short compared with the interval. Kinks are
//! distinguished from smooth changes, because no scheme has an order above 2 there.

use crate::scene::{FunctionOfTime, Scene, integral};

/// Number of samples per interval. A pulse of an expression that is shorter than the distance between two of them may be missed;
/// tables also give their times.
const SAMPLES: usize = 256;
/// Number of samples of the run for the mean of a function.
const SAMPLES_OF_RUN: usize = 4096;
/// A change of slope is that of a kink if it is this many times the smaller one beside it.
const KINK: f64 = 4.0;
/// Fraction of the size of a function below which its deviation is round-off.
const ROUND_OFF: f64 = 1e-9;

/// A component of a function of time that changes.
#[derive(Debug, Clone)]
struct Driver {
    function: FunctionOfTime,
    component: usize,
    /// The mean f̄ over the run, and the mean of |f − f̄|.
    mean: f64,
    deviation: f64,
}

/// The functions of time that act on a component.
#[derive(Debug, Clone, Default)]
pub(super) struct Driven(Vec<Driver>);

/// Rates of change of the functions of time in an interval, rad/s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Rates {
    /// Rate of change away from kinks.
    pub(super) smooth: f64,
    /// Rate of change at kinks, where no scheme has an order above 2.
    pub(super) kinked: f64,
}

impl Driven {
    /// Returns the functions of time of a scene that act on the bodies that `acts` selects. Omits functions without a
    /// finite value; the force that they scale reports them.
    pub(super) fn new(scene: &Scene, acts: impl Fn(&str) -> bool) -> Self {
        let mut found = Vec::new();
        for (body, function) in scene.functions_of_time() {
            if !body.is_none_or(&acts) {
                continue;
            }
            let drivers: Vec<Driver> =
                (0..function.count()).map(|component| Driver::new(scene, &function, component)).collect();
            let size = drivers.iter().map(|driver| driver.deviation).fold(0.0, f64::max);
            let changes = |driver: &Driver| {
                driver.deviation.is_finite() && driver.deviation > ROUND_OFF * size.max(driver.mean.abs())
            };
            found.extend(drivers.into_iter().filter(changes));
        }
        Self(found)
    }

    /// Returns the largest rates of change between two times (s).
    pub(super) fn rates(&self, from: f64, to: f64) -> Rates {
        self.0.iter().map(|driver| driver.rates(from, to)).fold(Rates::default(), |a, b| Rates {
            smooth: a.smooth.max(b.smooth),
            kinked: a.kinked.max(b.kinked),
        })
    }
}

impl Driver {
    fn new(scene: &Scene, function: &FunctionOfTime, component: usize) -> Self {
        let mut driver = Self { function: function.clone(), component, mean: 0.0, deviation: 0.0 };
        let points = function.points(component, [0.0, scene.time.end], SAMPLES_OF_RUN);
        driver.mean = integral(&points, |f| f) / scene.time.end;
        driver.deviation = integral(&points, |f| (f - driver.mean).abs()) / scene.time.end;
        driver
    }

    fn rates(&self, from: f64, to: f64) -> Rates {
        let points = self.function.points(self.component, [from, to], SAMPLES);
        let slopes: Vec<f64> =
            points.windows(2).map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).collect();
        let changes: Vec<f64> = slopes.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        // A kink between two samples changes the slope at both. Beside it, on one side at least, the slope hardly changes.
        let beside = |k: usize| {
            let at = |k: Option<usize>| k.and_then(|k| changes.get(k)).copied().unwrap_or(f64::INFINITY);
            at(k.checked_sub(2)).min(at(Some(k + 2)))
        };
        // Where a smooth slope is steepest its changes differ too, but are small.
        let mean = changes.iter().sum::<f64>() / changes.len() as f64;
        let (mut smooth, mut kinked) = (0.0, 0.0);
        for (k, &change) in changes.iter().enumerate() {
            let is_kink = change > KINK * beside(k) && change > mean;
            *(if is_kink { &mut kinked } else { &mut smooth }) += change;
        }
        let own = integral(&points, |f| (f - self.mean).abs());
        let size = own.max((to - from) * self.deviation);
        let [smooth, kinked] = [smooth, kinked].map(|variation| (variation / size).sqrt());
        Rates { smooth, kinked }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Time;
    use vi_fem::Amplitude;

    fn driven(amplitude: Amplitude) -> Driven {
        let scene = Scene::new(Time::new(2.0, 0.1, crate::scene::SchemeName::ImplicitMidpoint));
        Driven::new(&scene.gravity_amplitude(amplitude), |_| true)
    }

    fn formula(text: &str) -> Driven {
        driven(Amplitude::expression(text).unwrap())
    }

    /// The rate of a vibration is its own frequency, whatever its size and phase and wherever the interval is, and runs
    /// of the interval in both directions are the same.
    #[test]
    fn a_vibration_has_its_frequency() {
        for text in ["cos(60*t)", "7e5*sin(60*t+1)", "sin(60*t)"] {
            for from in [0.0, 0.3, 0.77, 1.8] {
                let rates = formula(text).rates(from, from + 0.2);
                assert!((0.85..1.15).contains(&(rates.smooth / 60.0)), "{text} {from}: {rates:?}");
                assert_eq!(rates.kinked, 0.0, "{text} {from}: {rates:?}");
            }
        }
        // Slow compared with the interval.
        let slow = formula("sin(pi*t)").rates(0.4, 0.5).smooth;
        assert!(slow < 1.5 * std::f64::consts::PI, "{slow}");
    }

    #[test]
    fn ramps_and_constants_ask_for_nothing() {
        assert_eq!(formula("3").rates(0.0, 0.2), Rates::default());
        let ramp = formula("5*t+1").rates(0.4, 0.6);
        assert!(ramp.smooth + ramp.kinked < 1e-3, "{ramp:?}");
        let table = driven(Amplitude::table(vec![[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]).unwrap());
        let between = table.rates(0.5, 0.7);
        assert!(between.smooth + between.kinked < 1e-3, "{between:?}");
    }

    /// A pulse of a table is seen however short it is, at its kinks; one of a formula if it is not shorter than the samples.
    #[test]
    fn short_pulses_are_resolved() {
        for width in [1e-2, 1e-4, 1e-6] {
            let points = vec![[0.0, 0.0], [1.1, 0.0], [1.1 + width, 1.0], [1.1 + 2.0 * width, 0.0]];
            let rates = driven(Amplitude::table(points).unwrap()).rates(1.0, 1.2);
            // V = 4/w and S = w.
            assert!((0.7..1.4).contains(&(rates.kinked * width / 2.0)), "{width}: {rates:?}");
        }
        let smooth = formula("exp(-((t-1.1)/0.01)^2)").rates(1.0, 1.2);
        assert!((0.5..2.0).contains(&(smooth.smooth * 0.01 / 1.4)), "{smooth:?}");
    }
}
