//! The sequence of a bench: reference, ladders of steps, refinement at the required error, repeats.

use std::time::{Duration, Instant};

use vi_solvers::Method;

use super::reference::{Reference, find};
use super::tables::recommend;
use super::tenth::tenth;
use super::{BenchError, BenchOptions, BenchReport, BenchWatch, Measure, Row, Trials};
use crate::auto::settle;
use crate::auto::trial::{Choice, Limit, Norm, Trial, TrialError, run};
use crate::run::provenance::Provenance;
use crate::scene::{Scene, SchemeName};
use crate::simulation::Simulation;
use crate::simulation::stability::{Rates, limiting, rates};

const REFERENCE_SHARE: f64 = 0.35;
const ROWS_SHARE: f64 = 0.85;
/// Ladders end below this error; smaller errors are not relevant for the choice.
const FINEST: f64 = 1e-7;
const COARSEST_IMPLICIT: u64 = 16;
/// A row is repeated until its two smallest times differ by at most this fraction.
const AGREEMENT: f64 = 0.03;
/// Largest number of repeats of a row.
const MOST_REPEATS: u32 = 12;

/// Measures schemes × steps on `scene`.
///
/// # Errors
/// Returns [`BenchError`] if the scene is invalid or static, nothing moves, or no reference fits into the budget.
pub fn bench(
    scene: &Scene,
    options: &BenchOptions,
    watch: &mut dyn BenchWatch,
) -> Result<BenchReport, BenchError> {
    let begin = Instant::now();
    if scene.statics.is_some() {
        return Err(BenchError::Static);
    }
    let schemes = schemes(options)?;
    let (scene, _) = settle(scene.clone(), &mut Trials(watch))?;
    let simulation = Simulation::new(scene.clone()).map_err(BenchError::Scene)?;
    let rates = rates(&simulation).map_err(BenchError::Frequency)?;
    let omega = rates.iter().map(|rates| rates.omega).fold(0.0, f64::max);
    if omega == 0.0 {
        return Err(BenchError::NothingMoves);
    }
    let norm = Norm::new(&simulation);
    let free_coordinates = simulation.free_coordinates();
    let reference = find(&simulation, &scene, &norm, omega, options.budget.mul_f64(REFERENCE_SHARE), watch)?;
    drop(simulation);
    let mut sweep = Sweep {
        accuracy: options.accuracy.or(scene.time.tolerance).unwrap_or(1e-2),
        budget: options.budget,
        begin,
        name: options.name.clone(),
        free_coordinates,
        scene,
        norm,
        reference,
        rows: Vec::new(),
        processor: 0.0,
        waited: None,
        watch,
    };
    let present = Choice::of(&sweep.scene);
    sweep.enter(present);
    sweep.rows.iter_mut().for_each(|row| row.is_present = true);
    sweep.climb(schemes, &rates);
    sweep.refine();
    sweep.repeat();
    Ok(sweep.close())
}

/// Returns the schemes to compare.
fn schemes(options: &BenchOptions) -> Result<Vec<(SchemeName, Option<usize>)>, BenchError> {
    if options.schemes.is_empty() {
        let usual = Method::variants().filter(|method| method.facts().is_benchmarked);
        return Ok(usual.map(SchemeName::of).collect());
    }
    let find = |name: &String| {
        let found = Method::variants().find(|method| method.label() == *name);
        found.map(SchemeName::of).ok_or_else(|| BenchError::Scheme {
            name: name.clone(),
            known: Method::variants().map(|method| method.label()).collect::<Vec<_>>().join(", "),
        })
    };
    options.schemes.iter().map(find).collect()
}

struct Sweep<'a> {
    name: String,
    free_coordinates: usize,
    scene: Scene,
    norm: Norm,
    reference: Reference,
    accuracy: f64,
    budget: Duration,
    begin: Instant,
    rows: Vec<Row>,
    /// Processor time of all timed runs, s.
    processor: f64,
    /// Time during which runnable threads waited for a processor, s, if the system provides it.
    waited: Option<f64>,
    watch: &'a mut dyn BenchWatch,
}

/// A scheme with its next number of steps.
struct Ladder {
    next: Choice,
    predicted: f64,
    failures: u32,
}

impl Sweep<'_> {
    fn left(&self, share: f64) -> Duration {
        self.budget.mul_f64(share).saturating_sub(self.begin.elapsed())
    }

    /// Runs one combination and adds its row. Returns whether the scheme refuses the scene.
    fn enter(&mut self, choice: Choice) -> bool {
        let left = self.left(ROWS_SHARE);
        let spent = self.begin.elapsed().as_secs_f64() / self.budget.as_secs_f64();
        self.watch.next(&format!("{} in {} steps", choice.label(), choice.steps), spent, left);
        let done = run(choice.apply(&self.scene), 0.0..1.0, Limit::Clock(left), &mut || self.watch.go_on());
        match &done {
            Ok(trial) => self.account(trial),
            // An unfinished run gives no row.
            Err(TrialError::Stopped) => return false,
            Err(_) => {}
        }
        let is_refused = matches!(done, Err(TrialError::Refused(_)));
        let row = self.row(choice, done);
        self.rows.push(row);
        is_refused
    }

    fn account(&mut self, trial: &Trial) {
        self.processor += trial.processor_seconds;
        if let Some(waited) = trial.waited_seconds {
            *self.waited.get_or_insert(0.0) += waited;
        }
    }

    fn row(&self, choice: Choice, done: Result<Trial, TrialError>) -> Row {
        let mut row = Row::new(choice, self.scene.time.end);
        match done {
            Ok(trial) => {
                let error = self.norm.error(&trial.end, &self.reference.end);
                row.time(&trial);
                row.energy_drift = Some(trial.energy_drift);
                row.work = trial.work.iter().map(|(name, count)| (name.to_owned(), count.into())).collect();
                row.at_reference = error < 3.0 * self.reference.facts.difference;
                if error.is_finite() {
                    row.error = Some(error);
                } else {
                    row.failure = Some("the end state is not finite".to_owned());
                }
            }
            Err(why) => row.failure = Some(why.to_string()),
        }
        row
    }

    /// Halves the step of every scheme. The next run is always the one with the smallest expected time.
    fn climb(&mut self, schemes: Vec<(SchemeName, Option<usize>)>, rates: &[Rates]) {
        let end = self.scene.time.end;
        let ladder = |(scheme, stages)| {
            let first = Choice { scheme, stages, steps: 1 };
            let omega = limiting(rates, first.method());
            let coarsest = match first.method().facts().recommended_limit {
                Some(limit) if limit > 0.0 => (end * omega / limit).ceil() as u64,
                Some(_) => (end * omega).ceil() as u64,
                None => COARSEST_IMPLICIT,
            };
            Ladder { next: Choice { steps: coarsest.max(1), ..first }, predicted: 0.0, failures: 0 }
        };
        let mut ladders: Vec<Ladder> = schemes.into_iter().map(ladder).collect();
        while self.watch.go_on() {
            let left = self.left(ROWS_SHARE).as_secs_f64();
            ladders.retain(|ladder| ladder.predicted < left);
            let Some(ladder) = ladders.iter_mut().min_by(|a, b| a.predicted.total_cmp(&b.predicted)) else {
                break;
            };
            let choice = ladder.next;
            if self.enter(choice) {
                ladder.predicted = f64::INFINITY;
            }
            let Some(row) = self.rows.last() else { break };
            match (row.error, row.seconds) {
                (Some(error), Some(seconds)) => {
                    ladder.failures = 0;
                    ladder.predicted = 2.0 * seconds;
                    if error < FINEST || row.at_reference {
                        ladder.predicted = f64::INFINITY;
                    }
                }
                _ => {
                    ladder.failures += 1;
                    ladder.predicted *= 2.0;
                    if ladder.failures >= 4 {
                        ladder.predicted = f64::INFINITY;
                    }
                }
            }
            ladder.next.steps *= 2;
        }
    }

    /// Adds, for every scheme whose ladder passes the required error, the step that should just reach it.
    fn refine(&mut self) {
        let reach = 0.8 * self.accuracy;
        let mut wanted = Vec::new();
        for coarse in &self.rows {
            let Some(fine) = self.rows.iter().find(|fine| is_halved(fine, coarse)) else { continue };
            let (Some(e), Some(e_fine)) = (coarse.error, fine.error) else { continue };
            if e > self.accuracy && e_fine < reach {
                let share = (e / reach).ln() / (e / e_fine).ln();
                let steps = (coarse.steps as f64 * 2.0_f64.powf(share)).ceil() as u64;
                if steps > coarse.steps && steps < fine.steps {
                    wanted.push((Choice { steps, ..coarse.choice }, fine.seconds.unwrap_or(0.0)));
                }
            }
        }
        for (choice, seconds) in wanted {
            if self.watch.go_on() && self.left(ROWS_SHARE).as_secs_f64() > seconds {
                self.enter(choice);
            }
        }
    }

    /// Times rows again, in turn, so that a disturbance of the machine affects all rows alike, until the two smallest
    /// times of each row agree.
    fn repeat(&mut self) {
        for turn in 1..MOST_REPEATS {
            for index in 0..self.rows.len() {
                let row = &self.rows[index];
                let Some(seconds) = row.seconds.filter(|_| !row.times_agree(AGREEMENT)) else { continue };
                let left = self.left(1.0);
                if left.as_secs_f64() < 2.0 * seconds || !self.watch.go_on() {
                    continue;
                }
                let choice = row.choice;
                let spent = self.begin.elapsed().as_secs_f64() / self.budget.as_secs_f64();
                self.watch.next(&format!("{} again, {}", choice.label(), turn + 1), spent, left);
                let again =
                    run(choice.apply(&self.scene), 0.0..1.0, Limit::Clock(left), &mut || self.watch.go_on());
                if let Ok(again) = again {
                    self.account(&again);
                    self.rows[index].time(&again);
                    self.rows[index].repeats += 1;
                }
            }
        }
    }

    fn close(mut self) -> BenchReport {
        let orders: Vec<Option<f64>> = self
            .rows
            .iter()
            .map(|fine| {
                let coarse = self.rows.iter().find(|coarse| is_halved(fine, coarse))?;
                let usable = !fine.at_reference && coarse.error? < 0.5;
                usable.then_some((coarse.error? / fine.error?).log2())
            })
            .collect();
        for (row, order) in self.rows.iter_mut().zip(orders) {
            row.observed_order = order;
        }
        let ranked_by = Measure::of_threads(rayon::current_num_threads());
        mark_front(&mut self.rows, ranked_by);
        let busy =
            self.waited.map(|waited| waited / (waited + self.processor)).filter(|share| share.is_finite());
        let mut report = BenchReport {
            provenance: Provenance::new(&self.name, self.free_coordinates),
            ranked_by,
            waited_share: busy,
            accuracy: self.accuracy,
            reference: self.reference.facts,
            tenth: tenth(&self.rows, ranked_by, self.accuracy),
            rows: self.rows,
            recommendation: String::new(),
            recommended: None,
            interrupted: !self.watch.go_on(),
            seconds: self.begin.elapsed().as_secs_f64(),
        };
        (report.recommended, report.recommendation) = recommend(&report);
        report
    }
}

/// Returns whether `fine` is the same scheme as `coarse` with twice the number of steps.
fn is_halved(fine: &Row, coarse: &Row) -> bool {
    fine.scheme == coarse.scheme && fine.steps == 2 * coarse.steps
}

/// Marks the rows for which no other row is both faster and more accurate.
fn mark_front(rows: &mut [Row], measure: Measure) {
    let mut order: Vec<(usize, f64, f64)> =
        rows.iter().enumerate().filter_map(|(i, row)| Some((i, row.cost(measure)?, row.error?))).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)));
    let mut least = f64::INFINITY;
    for (index, _, error) in order {
        if error < least {
            least = error;
            rows[index].on_front = true;
        }
    }
}
