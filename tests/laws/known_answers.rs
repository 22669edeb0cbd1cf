//! Tests the error bars of `variational convergence` against known answers. Generated sequences imitate real studies:
//! orders that set in late, singularities, locking, noise, sign changes, errors in space and time together. Further
//! studies run the program on problems with closed solutions. docs/validation.md publishes the counts: `cargo test
//! --test laws known_answers -- --nocapture`

use crate::random::Random;
use std::collections::BTreeMap;
use std::f64::consts::{E, PI};

use variational::prelude::Scene;
use variational::study::convergence::{ConvergenceOptions, Extrapolation, Verdict, convergence, extrapolate};

/// The least share of error bars that must contain the true value.
const SHARE: f64 = 0.95;

/// Counts the studies of one kind.
#[derive(Default)]
struct Tally {
    studies: usize,
    not_yet: usize,
    held: usize,
    /// Ratios of the bar to the true error of the extrapolated value, and to that of the last level.
    of_estimate: Vec<f64>,
    of_last: Vec<f64>,
}

impl Tally {
    fn enter(&mut self, found: &Extrapolation, last: f64, truth: f64) {
        self.studies += 1;
        let Some(bar) = found.error else {
            self.not_yet += 1;
            return;
        };
        let (error, before) = ((found.value - truth).abs(), (last - truth).abs());
        self.held += usize::from(error <= bar);
        // A ratio to an error that is round-off has no meaning.
        if before > 1e-9 * truth.abs() {
            self.of_estimate.push(bar / error);
            self.of_last.push(bar / before);
        }
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Prints a table and returns the total tally.
fn table(mut rows: BTreeMap<&'static str, Tally>) -> Tally {
    println!(
        "| | studies | does not converge yet | bars | that hold | bar/error | bar/error of the last level |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|");
    let mut all = Tally::default();
    let print = |name: &str, row: &mut Tally| {
        let (a, b) = (median(&mut row.of_estimate), median(&mut row.of_last));
        let bars = row.studies - row.not_yet;
        println!("| {name} | {} | {} | {bars} | {} | {a:.1} | {b:.1} |", row.studies, row.not_yet, row.held);
    };
    for (name, row) in &mut rows {
        print(name, row);
        all.studies += row.studies;
        all.not_yet += row.not_yet;
        all.held += row.held;
        all.of_estimate.extend(&row.of_estimate);
        all.of_last.extend(&row.of_last);
    }
    print("all", &mut all);
    all
}

const KINDS: [&str; 9] = [
    "one power of h",
    "a higher power sets in late",
    "singular: a lower power takes over",
    "locks in bending: q/(1 + βh²)",
    "locks in volume: a plateau",
    "noise up to half the last difference",
    "alternates",
    "two powers of opposite signs",
    "space and time, with a product",
];

/// Generates study `index`: its kind, its extrapolation, the value of its last level, and the true value.
fn generated(index: u64) -> (&'static str, Extrapolation, f64, f64) {
    let random = &mut Random(0x5EED ^ (index << 20));
    let kind = index as usize % KINDS.len();
    let levels = random.one_of(&[3.0, 3.0, 3.0, 4.0, 5.0]) as i32;
    let steps: Vec<f64> = (0..levels).map(|level| 0.5_f64.powi(level)).collect();
    let truth = random.sign() * random.decades(1e-3, 1e3);
    let size = truth * random.sign() * random.decades(1e-3, 0.5);
    let mut formal = random.one_of(&[1.0, 2.0, 2.0, 2.0, 3.0, 4.0]);
    let of = |error: &dyn Fn(f64) -> f64| -> Vec<f64> { steps.iter().map(|&h| truth + error(h)).collect() };
    let values = match kind {
        0 => of(&|h| size * h.powf(formal)),
        1 => {
            let (b, s) = (random.sign() * random.decades(0.05, 3.0), random.one_of(&[1.0, 2.0]));
            of(&|h| size * h.powf(formal) * (1.0 + b * h.powf(s)))
        }
        2 => {
            let (p, b) = (random.between(0.5, formal), random.sign() * random.decades(0.05, 5.0));
            of(&|h| size * (h.powf(p) + b * h.powf(formal)))
        }
        3 => {
            let (beta, b) = (random.decades(0.1, 1e3), random.sign() * random.decades(0.01, 0.3));
            formal = 2.0;
            of(&|h| truth * ((1.0 + b * h * h) / (1.0 + beta * h * h) - 1.0))
        }
        4 => {
            let (width, height) = (random.decades(0.05, 2.0), random.sign() * random.decades(1e-2, 0.8));
            formal = 2.0;
            of(&|h| size * h * h + truth * height / (1.0 + (width / h).powi(2)))
        }
        5 => {
            let mut values = of(&|h| size * h.powf(formal));
            let last = (values[values.len() - 1] - values[values.len() - 2]).abs();
            let noise = last * random.decades(1e-3, 0.5);
            values.iter_mut().for_each(|value| *value += noise * random.between(-1.0, 1.0));
            values
        }
        6 => {
            let p = random.between(0.5, formal);
            steps
                .iter()
                .enumerate()
                .map(|(k, h)| truth + size * (-1.0_f64).powi(k as i32) * h.powf(p))
                .collect()
        }
        7 => {
            let p = random.one_of(&[1.0, 2.0]);
            let higher = p + random.one_of(&[1.0, 2.0]);
            let b = random.decades(0.1, 10.0);
            formal = if random.unit() < 0.5 { p } else { higher };
            of(&|h| size * (h.powf(p) - b * h.powf(higher)))
        }
        _ => {
            let (of_time, order) =
                (size * random.sign() * random.decades(0.1, 10.0), random.one_of(&[1.0, 2.0, 4.0]));
            let product = of_time * random.between(-0.5, 0.5);
            let value = |h: f64, dt: f64| {
                let (a, b) = (h.powf(formal), dt.powf(order));
                truth + size * a + of_time * b + product * a * b
            };
            let space: Vec<f64> = steps.iter().map(|&h| value(h, 1.0)).collect();
            let time: Vec<f64> = steps.iter().map(|&dt| value(1.0, dt)).collect();
            let found = extrapolate(&space, formal, 0.0).with_time(&extrapolate(&time, order, 0.0), time[0]);
            return (KINDS[kind], found, space[space.len() - 1], truth);
        }
    };
    (KINDS[kind], extrapolate(&values, formal, 0.0), values[values.len() - 1], truth)
}

#[test]
fn bars_hold_in_generated_studies() {
    for (count, first) in [(207, 0), (9000, 1000)] {
        let mut rows: BTreeMap<&str, Tally> = BTreeMap::new();
        for index in first..first + count {
            let (kind, found, last, truth) = generated(index);
            rows.entry(kind).or_default().enter(&found, last, truth);
        }
        let mut all = table(rows);
        let bars = all.studies - all.not_yet;
        assert!(all.held as f64 >= SHARE * bars as f64, "{} of {bars} hold", all.held);
        assert!(all.not_yet * 4 < all.studies, "{} of {} have no bar", all.not_yet, all.studies);
        assert!(median(&mut all.of_last) < 3.0);
    }
}

/// Describes a bar of unit length, stiffness and density that moves along x alone.
fn bar(element: &str, cells: u32, time: &str, load: &str) -> String {
    format!(
        r#"
        [time]
        {time}
        [solver]
        tolerance = 1e-13
        [[body]]
        name = "bar"
        box = {{ size = [1.0, 0.25, 0.25], cells = [{cells}, 1, 1], element = "{element}" }}
        material = {{ law = "linear", young = 1.0, poisson = 0.0, density = 1.0 }}
        [[fix]]
        body = "bar"
        region = "x-min"
        [[fix]]
        body = "bar"
        box = {{ min = [-1.0, -1.0, -1.0], max = [2.0, 1.0, 1.0] }}
        axes = ["y", "z"]
        [[load]]
        kind = "body-force"
        body = "bar"
        force = ["{load}", 0.0, 0.0]
        [[probe]]
        name = "tip"
        body = "bar"
        point = [1.0, 0.0, 0.0]
        "#
    )
}

/// Adds the estimates of a study of `scene`, whose exact values are given.
fn enter(row: &mut Tally, scene: &str, options: &ConvergenceOptions, answers: &[(&str, f64)]) {
    let parsed = Scene::parse(scene, &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    let report = convergence(&parsed.scene.unwrap(), options, &mut ()).unwrap();
    for &(quantity, truth) in answers {
        let estimate = report.estimates.iter().find(|estimate| estimate.quantity == quantity).unwrap();
        let of_row = report.studies[0].rows.iter().find(|row| row.quantity == quantity).unwrap();
        let found = &estimate.extrapolation;
        if found.error.is_some_and(|bar| (found.value - truth).abs() > bar) {
            println!("{quantity} {truth}: {found:?} from {:?}", of_row.values);
        }
        row.enter(found, of_row.values[of_row.values.len() - 1], truth);
    }
}

#[test]
fn bars_hold_in_studies_with_closed_answers() {
    let mut rows: BTreeMap<&str, Tally> = BTreeMap::new();
    let space = ConvergenceOptions { time: false, ..ConvergenceOptions::default() };
    let still = "end = 1.0\nstep = 1.0\nscheme = \"implicit-midpoint\"\n[static]\ntolerance = 1e-13";
    let omega = PI / 2.0;
    let area = 0.0625;
    for element in ["hex8", "tet4", "wedge6", "hex20", "tet10"] {
        let finest = if element.ends_with('0') { 2 } else { 4 };
        for cells in [2, finest] {
            // The exact tip u(1) and energy ½ ∫ u'² dx of −u'' = f.
            for (load, tip, energy) in [
                ("sin(pi*x/2)", 1.0 / (omega * omega), 0.25 / (omega * omega)),
                ("x^2", 0.25, 0.5 * (1.0 - 0.5 + 1.0 / 7.0) / 9.0),
                // For this load u' = e − eˣ.
                ("exp(x)", 1.0, 0.5 * (E * E - 2.0 * E * (E - 1.0) + 0.5 * (E * E - 1.0))),
            ] {
                let scene = bar(element, cells, still, load);
                let answers = [("tip.ux", tip), ("elastic", area * energy)];
                enter(rows.entry("bars in balance").or_default(), &scene, &space, &answers);
            }
            let modes = ConvergenceOptions { modes: Some(2), ..space.clone() };
            let scene = bar(element, cells, "end = 1.0\nstep = 0.1\nscheme = \"implicit-midpoint\"", "0");
            let answers = [("mode 0", 0.25), ("mode 1", 0.75)];
            enter(rows.entry("frequencies of bars").or_default(), &scene, &modes, &answers);
        }
    }
    let schemes =
        ["implicit-midpoint", "stormer-verlet", "gauss", "energy-momentum", "backward-euler", "bdf2"];
    for (k, scheme) in schemes.into_iter().enumerate() {
        for end in [0.7, 1.0, 1.9] {
            // The exact motion is u = sin(πx/2)(1 − cos ωt)/ω².
            let tip = (1.0 - (omega * end).cos()) / (omega * omega);
            let time = format!("end = {end}\nstep = 0.05\nscheme = \"{scheme}\"");
            let scene = bar("hex8", 4, &time, "sin(pi*x/2)");
            let options = ConvergenceOptions::default();
            enter(rows.entry("bars that vibrate").or_default(), &scene, &options, &[("tip.ux", tip)]);
            // One cell is an oscillator: the lumped mass m/2 of its free face on the stiffness EA/L.
            let (omega, steps) = (2.0_f64.sqrt(), 8 + 3 * k);
            let tip = 0.5 * (1.0 - (omega * end).cos());
            let time = format!("end = {end}\nstep = {}\nscheme = \"{scheme}\"", end / steps as f64);
            let options = ConvergenceOptions { space: false, ..ConvergenceOptions::default() };
            let row = rows.entry("oscillators").or_default();
            enter(row, &bar("hex8", 1, &time, "1"), &options, &[("tip.ux", tip)]);
        }
    }
    let all = table(rows);
    let bars = all.studies - all.not_yet;
    assert!(all.held as f64 >= SHARE * bars as f64, "{} of {bars} hold", all.held);
    assert!(all.not_yet * 4 < all.studies, "{} of {} have no bar", all.not_yet, all.studies);
}

/// Linear elements lock in the bending of thin beams, and at near incompressibility. Their error bars contain the
/// truth, or no bar is given.
#[test]
fn locked_meshes_have_no_tight_bars() {
    let beam = |element: &str, poisson: f64| {
        format!(
            r#"
            [time]
            end = 1.0
            step = 1.0
            scheme = "implicit-midpoint"
            [static]
            tolerance = 1e-10
            [[body]]
            name = "beam"
            box = {{ size = [1.0, 0.05, 0.05], cells = [5, 1, 1], element = "{element}" }}
            material = {{ law = "linear", young = 1e6, poisson = {poisson}, density = 1.0 }}
            [[fix]]
            body = "beam"
            region = "x-min"
            [[load]]
            kind = "traction"
            body = "beam"
            region = "x-max"
            traction = [0.0, 1.0, 0.0]
            [[probe]]
            name = "tip"
            body = "beam"
            point = [1.0, 0.0, 0.0]
            "#
        )
    };
    // The deflection is P L³/3EI, plus 1.2 P L/GA of shear.
    let (inertia, force) = (0.05_f64.powi(4) / 12.0, 0.0025);
    let exact = force / (3e6 * inertia) + 1.2 * force / (0.5e6 * 0.0025);
    let options = ConvergenceOptions { time: false, ..ConvergenceOptions::default() };
    for element in ["hex8", "tet4", "wedge6"] {
        for poisson in [0.0, 0.499] {
            let scene = Scene::parse(&beam(element, poisson), &[]).scene.unwrap();
            let report = convergence(&scene, &options, &mut ()).unwrap();
            let tip = report.estimates.iter().find(|estimate| estimate.quantity == "tip.uy").unwrap();
            let found = tip.extrapolation;
            println!("{element} {poisson}: {found:?}, exact {exact:.4e}");
            if poisson > 0.4 {
                assert_eq!((found.verdict, found.error), (Verdict::MayLock, None));
                assert!(report.table().contains("lock") && report.notes[0].contains("mean-dilation"));
            } else {
                // Beam theory is within 5e-3 of the truth.
                let holds = |bar| (found.value - exact).abs() <= bar + 5e-3 * exact;
                assert!(found.error.is_none_or(holds), "{element}: {found:?}, exact {exact:.4e}");
            }
        }
    }
}
