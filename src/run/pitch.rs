//! Finds the pitch of a probe: the frequency of its strongest oscillation.

use rustfft::algorithm::Radix4;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection};

use serde_json::json;

use super::checkpoint::CheckpointError;
use super::error::RunError;
use super::observer::{Observer, Purpose, Sight};
use super::report::Report;
use crate::record::{Bytes, record};
use crate::scene::{Axis, Probe};
use crate::simulation::{Observation, Simulation};

/// Collects the displacements of the probes with `pitch`.
pub struct PitchFinder {
    tracks: Vec<Track>,
    times: Vec<f64>,
}

/// Snapshot of a finder.
struct Samples {
    count: u64,
    /// Times, and the values of each track. `None` in a snapshot to go back to, which keeps the first `count` samples
    /// of the finder.
    values: Option<(Vec<f64>, Vec<Vec<f64>>)>,
}

record!(Samples { count: u64, values: Option<(Vec<f64>, Vec<Vec<f64>>)> });

struct Track {
    name: String,
    probe: usize,
    axis: Axis,
    values: Vec<f64>,
}

impl PitchFinder {
    /// Makes a finder for the node probes with `pitch`.
    pub fn new<'a>(probes: impl Iterator<Item = &'a Probe>) -> Self {
        let tracks = probes
            .enumerate()
            .filter_map(|(i, probe)| {
                let axis = probe.pitch?;
                Some(Track { name: probe.name.clone(), probe: i, axis, values: Vec::new() })
            })
            .collect();
        Self { tracks, times: Vec::new() }
    }

    /// Adds an observation.
    pub fn enter(&mut self, seen: &Observation) {
        if self.tracks.is_empty() {
            return;
        }
        self.times.push(seen.t);
        for track in &mut self.tracks {
            track.values.push(seen.probes[track.probe].displacement[track.axis as usize]);
        }
    }

    /// Returns name and pitch (Hz) of each probe with `pitch`; `None` if its record is too short.
    pub fn pitches(&self) -> Vec<(String, Option<f64>)> {
        let n = self.times.len();
        let interval = if n > 1 { (self.times[n - 1] - self.times[0]) / (n - 1) as f64 } else { 0.0 };
        self.tracks.iter().map(|track| (track.name.clone(), pitch(&track.values, interval))).collect()
    }
}

impl Observer for PitchFinder {
    fn name(&self) -> &'static str {
        "pitch"
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        if let Sight::Row(row) = sight {
            self.enter(row.seen);
        }
        Ok(())
    }

    fn snapshot(&self, purpose: Purpose) -> Bytes {
        let all = || (self.times.clone(), self.tracks.iter().map(|track| track.values.clone()).collect());
        Bytes::of(&Samples { count: self.times.len() as u64, values: (purpose == Purpose::Resume).then(all) })
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        let Samples { count, values } = snapshot.value()?;
        if let Some((times, values)) = values {
            if values.len() != self.tracks.len() || values.iter().any(|track| track.len() != times.len()) {
                return Err(CheckpointError::Unfit("its samples are those of other probes".to_owned()).into());
            }
            self.times = times;
            self.tracks.iter_mut().zip(values).for_each(|(track, values)| track.values = values);
        }
        self.times.truncate(count as usize);
        self.tracks.iter_mut().for_each(|track| track.values.truncate(count as usize));
        Ok(())
    }

    fn report(&self, _: &Simulation, report: &mut Report) {
        report.pitch = self.pitches().into_iter().map(|(name, pitch)| (name, json!(pitch))).collect();
    }
}

/// Returns the frequency (Hz) of the strongest oscillation in equally spaced samples (`interval` in s): the peak of the
/// spectrum under a Hann window, zero-padded fourfold and refined by a parabola through the logarithms of the three
/// highest bins.
pub fn pitch(samples: &[f64], interval: f64) -> Option<f64> {
    let n = samples.len();
    if n < 16 || interval <= 0.0 {
        return None;
    }
    let mean = samples.iter().sum::<f64>() / n as f64;
    let size = (4 * n).next_power_of_two();
    let mut spectrum = vec![Complex::default(); size];
    for (i, sample) in samples.iter().enumerate() {
        let window = (std::f64::consts::PI * (i as f64 + 0.5) / n as f64).sin().powi(2);
        spectrum[i].re = (sample - mean) * window;
    }
    // Calls one algorithm instead of a planner, whose algorithms for every length and instruction set made up a third of
    // the code of this crate.
    Radix4::new(size, FftDirection::Forward).process(&mut spectrum);
    let power: Vec<f64> = spectrum[..size / 2].iter().map(Complex::norm_sqr).collect();
    // An oscillation with fewer than two periods in the window cannot be distinguished from drift.
    let lowest = 2 * size / n;
    let peak = (lowest..power.len() - 1).max_by(|&a, &b| power[a].total_cmp(&power[b]))?;
    if power[peak] <= 0.0 {
        return None;
    }
    let [left, top, right] = [peak - 1, peak, peak + 1].map(|i| power[i].max(f64::MIN_POSITIVE).ln());
    let bend = left - 2.0 * top + right;
    let shift = if bend < 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
    Some((peak as f64 + shift) / (size as f64 * interval))
}

#[cfg(test)]
mod tests {
    use super::pitch;

    #[test]
    fn a_sine_is_found_between_the_bins() {
        for frequency in [12.3, 440.0, 441.37] {
            let interval = 1e-4;
            let samples: Vec<f64> = (0..5000)
                .map(|i| 0.3 + (std::f64::consts::TAU * frequency * i as f64 * interval).sin())
                .collect();
            let found = pitch(&samples, interval).unwrap();
            assert!((found / frequency - 1.0).abs() < 1e-4, "{found} for {frequency}");
        }
    }

    #[test]
    fn silence_has_no_pitch() {
        assert_eq!(pitch(&[1.0; 100], 0.1), None);
        assert_eq!(pitch(&[1.0, 2.0], 0.1), None);
    }
}
