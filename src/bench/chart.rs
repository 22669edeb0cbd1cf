//! A bench as a picture: run time over error, both logarithmic, the Pareto front marked; SVG.
//! It must not measure.

use std::fmt::Write;

use super::{BenchReport, Row};

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 540.0;
/// Of the plot: left, top, right, bottom.
const FRAME: [f64; 4] = [76.0, 64.0, 640.0, 470.0];
/// Okabe and Ito's colours, distinguishable to all eyes.
const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c6d31"];

/// A logarithmic axis from whole to whole powers of ten.
struct Axis {
    from: f64,
    to: f64,
    low: i32,
    high: i32,
}

impl Axis {
    fn over(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = values
            .filter(|value| *value > 0.0 && value.is_finite())
            .map(f64::log10)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low.is_finite() { (low, high) } else { (-1.0, 0.0) };
        let low = (low - 0.05).floor() as i32;
        Self { from, to, low, high: ((high + 0.05).ceil() as i32).max(low + 1) }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (value.log10() - f64::from(self.low)) / f64::from(self.high - self.low);
        self.from + share.clamp(0.0, 1.0) * (self.to - self.from)
    }

    fn decades(&self) -> impl Iterator<Item = (i32, f64)> + '_ {
        (self.low..=self.high).map(|power| (power, self.at(10.0_f64.powi(power))))
    }
}

impl BenchReport {
    /// Run time over error as SVG.
    pub fn chart(&self, title: &str) -> String {
        let shown: Vec<&Row> = self
            .rows
            .iter()
            .filter(|row| row.error.is_some_and(|error| error > 0.0 && error < 3.0))
            .collect();
        let [left, top, right, bottom] = FRAME;
        let errors = shown.iter().filter_map(|row| row.error).chain([self.accuracy]);
        let x = Axis::over(errors, left, right);
        let y = Axis::over(shown.iter().filter_map(|row| row.seconds), bottom, top);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
             width=\"{WIDTH}\" height=\"{HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{left}\" y=\"28\" font-size=\"17\" font-weight=\"bold\">{}</text>\n\
             <text x=\"{left}\" y=\"48\" fill=\"#555\">run time over error at the end, {} thread{}; \
             errors against {} in {} steps (±{:.0e})</text>\n",
            escape(title),
            self.threads,
            if self.threads == 1 { "" } else { "s" },
            self.reference.scheme,
            self.reference.steps,
            self.reference.difference,
        );
        grid(&mut svg, &x, &y);
        let wanted = x.at(self.accuracy);
        let _ = writeln!(
            svg,
            "<line x1=\"{wanted:.1}\" y1=\"{top}\" x2=\"{wanted:.1}\" y2=\"{bottom}\" stroke=\"#999\" stroke-dasharray=\"2 4\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" fill=\"#777\" font-size=\"11\">wanted</text>",
            wanted + 4.0,
            top + 12.0
        );
        let place = |row: &Row| (x.at(row.error.unwrap_or(1.0)), y.at(row.seconds.unwrap_or(1.0)));
        front(&mut svg, shown.iter().filter(|row| row.on_front).map(|row| place(row)).collect());
        let mut names: Vec<&str> = Vec::new();
        for row in &shown {
            if !names.contains(&row.scheme.as_str()) {
                names.push(&row.scheme);
            }
        }
        for (index, name) in names.iter().enumerate() {
            let mut own: Vec<&&Row> = shown.iter().filter(|row| row.scheme == *name).collect();
            own.sort_by_key(|row| row.steps);
            let places: Vec<(f64, f64)> = own.iter().map(|row| place(row)).collect();
            let line: Vec<String> = places.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            let colour = COLOURS[index % COLOURS.len()];
            let _ = writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>",
                line.join(" ")
            );
            for (row, &(px, py)) in own.iter().zip(&places) {
                let hollow = row.at_reference;
                marker(&mut svg, index, px, py, colour, hollow);
                if row.is_present {
                    let _ = writeln!(
                        svg,
                        "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"9\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>\n\
                         <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\">now</text>",
                        px + 11.0,
                        py - 7.0
                    );
                }
            }
            let row_y = top + 14.0 + 22.0 * index as f64;
            marker(&mut svg, index, right + 26.0, row_y - 4.0, colour, false);
            let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{row_y:.1}\">{}</text>", right + 40.0, escape(name));
        }
        let legend_y = top + 14.0 + 22.0 * names.len() as f64;
        let _ = writeln!(
            svg,
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"#f2c14e\" stroke-width=\"7\" stroke-linecap=\"round\"/>\n\
             <text x=\"{:.1}\" y=\"{legend_y:.1}\">Pareto front</text>",
            right + 17.0,
            legend_y - 4.0,
            right + 34.0,
            legend_y - 4.0,
            right + 40.0
        );
        svg.push_str("</svg>\n");
        svg
    }
}

fn grid(svg: &mut String, x: &Axis, y: &Axis) {
    let [left, top, right, bottom] = FRAME;
    let power = |power: i32| format!("10<tspan dy=\"-5\" font-size=\"10\">{power}</tspan>");
    for (exponent, at) in x.decades() {
        let _ = writeln!(
            svg,
            "<line x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{bottom}\" stroke=\"#e4e4e4\"/>\n\
             <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            bottom + 20.0,
            power(exponent)
        );
    }
    for (exponent, at) in y.decades() {
        let _ = writeln!(
            svg,
            "<line x1=\"{left}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#e4e4e4\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 8.0,
            at + 4.0,
            power(exponent)
        );
    }
    let (middle_x, middle_y) = (0.5 * (left + right), 0.5 * (top + bottom));
    let _ = writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#444\"/>\n\
         <text x=\"{middle_x}\" y=\"{:.1}\" text-anchor=\"middle\">relative error at the end</text>\n\
         <text transform=\"translate(24 {middle_y}) rotate(-90)\" text-anchor=\"middle\">run time (s)</text>",
        right - left,
        bottom - top,
        bottom + 46.0
    );
}

/// The staircase below which nothing was found.
fn front(svg: &mut String, mut places: Vec<(f64, f64)>) {
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let line: Vec<String> = places.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#f2c14e\" stroke-width=\"9\" stroke-linejoin=\"round\" \
         stroke-linecap=\"round\" opacity=\"0.7\"/>",
        line.join(" ")
    );
}

/// Circle, square, triangle or diamond; hollow where the error is no better known than the reference.
fn marker(svg: &mut String, index: usize, x: f64, y: f64, colour: &str, hollow: bool) {
    let fill = if hollow { "white" } else { colour };
    let r = 4.5;
    let points: &[(f64, f64)] = match index % 4 {
        0 => {
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>"
            );
            return;
        }
        1 => &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
        2 => &[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)],
        _ => &[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)],
    };
    let corners: Vec<String> =
        points.iter().map(|(dx, dy)| format!("{:.1},{:.1}", x + r * dx, y + r * dy)).collect();
    let _ = writeln!(
        svg,
        "<polygon points=\"{}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
        corners.join(" ")
    );
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
