//! Charts as SVG: lines, markers and stems over linear or logarithmic axes, with a legend. This file does not depend
//! on the meaning of the data.

mod axis;

use std::fmt::Write;

use axis::Axis;
pub(crate) use axis::Scale;

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 540.0;
/// Edges of the plot: left, top, right, bottom.
const FRAME: [f64; 4] = [76.0, 64.0, 640.0, 470.0];
/// The colours of Okabe and Ito, which remain distinguishable with colour blindness.
const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c6d31"];
/// Colour of highlighted points.
const POINTED_OUT: &str = "#f2c14e";

/// Drawing style of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Style {
    /// A line.
    Line,
    /// A line with a marker at each point.
    Marked,
    /// A line from the axis to a marker at each point.
    Stems,
}

/// A series of points.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) style: Style,
    /// Indices of the points with a hollow marker.
    pub(crate) hollow: Vec<usize>,
}

/// A chart of several series.
#[derive(Debug, Clone)]
pub(crate) struct Chart {
    pub(crate) title: String,
    pub(crate) subtitle: String,
    /// Labels of the axes.
    pub(crate) labels: [String; 2],
    pub(crate) scales: [Scale; 2],
    pub(crate) series: Vec<Series>,
    /// A broad line below the others, with its name.
    pub(crate) band: Option<(String, Vec<(f64, f64)>)>,
    /// A vertical line with its name.
    pub(crate) bound: Option<(String, f64)>,
    /// Points with a circle and a label.
    pub(crate) marks: Vec<(String, (f64, f64))>,
}

impl Chart {
    /// Returns a chart without series.
    pub(crate) fn new(title: &str, subtitle: String, labels: [&str; 2], scales: [Scale; 2]) -> Self {
        Self {
            title: title.to_owned(),
            subtitle,
            labels: labels.map(str::to_owned),
            scales,
            series: Vec::new(),
            band: None,
            bound: None,
            marks: Vec::new(),
        }
    }

    /// Returns the chart as an SVG document. Points that an axis cannot show (not finite, or not positive on a
    /// logarithmic one) are omitted.
    pub(crate) fn svg(&self) -> String {
        let [left, top, right, bottom] = FRAME;
        let points = || self.series.iter().flat_map(|series| &series.points);
        let bound = self.bound.iter().map(|(_, at)| *at);
        let stands = self.series.iter().any(|series| series.style == Style::Stems);
        let x = Axis::over(self.scales[0], points().map(|p| p.0).chain(bound), left, right);
        let floor = stands.then_some(0.0);
        let y = Axis::over(self.scales[1], points().map(|p| p.1).chain(floor), bottom, top);
        let place = |(a, b): (f64, f64)| Some((x.at(a)?, y.at(b)?));
        // Writing into a string cannot fail, so the results of `write!` are ignored.
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
             width=\"{WIDTH}\" height=\"{HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{left}\" y=\"28\" font-size=\"17\" font-weight=\"bold\">{}</text>\n\
             <text x=\"{left}\" y=\"48\" fill=\"#555\">{}</text>\n",
            escape(&self.title),
            escape(&self.subtitle),
        );
        self.grid(&mut svg, &x, &y);
        if let Some((name, at)) = self.bound.as_ref().and_then(|(name, at)| Some((name, x.at(*at)?))) {
            let _ = writeln!(
                svg,
                "<line x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{bottom}\" stroke=\"#999\" stroke-dasharray=\"2 4\"/>\n\
                 <text x=\"{:.1}\" y=\"{:.1}\" fill=\"#777\" font-size=\"11\">{}</text>",
                at + 4.0,
                top + 12.0,
                escape(name)
            );
        }
        if let Some((_, points)) = &self.band {
            let line = polyline(points.iter().filter_map(|&point| place(point)));
            let _ = writeln!(
                svg,
                "<polyline points=\"{line}\" fill=\"none\" stroke=\"{POINTED_OUT}\" stroke-width=\"9\" \
                 stroke-linejoin=\"round\" stroke-linecap=\"round\" opacity=\"0.7\"/>"
            );
        }
        for (index, series) in self.series.iter().enumerate() {
            let colour = COLOURS[index % COLOURS.len()];
            let places: Vec<(usize, (f64, f64))> =
                series.points.iter().enumerate().filter_map(|(k, &p)| Some((k, place(p)?))).collect();
            if series.style == Style::Stems {
                for (_, (px, py)) in &places {
                    let _ = writeln!(
                        svg,
                        "<line x1=\"{px:.1}\" y1=\"{bottom}\" x2=\"{px:.1}\" y2=\"{py:.1}\" stroke=\"{colour}\"/>"
                    );
                }
            } else {
                let line = polyline(places.iter().map(|(_, place)| *place));
                let _ = writeln!(
                    svg,
                    "<polyline points=\"{line}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>"
                );
            }
            if series.style != Style::Line {
                for (k, at) in places {
                    marker(&mut svg, index, at, colour, series.hollow.contains(&k));
                }
            }
        }
        for (name, (px, py)) in self.marks.iter().filter_map(|(name, at)| Some((name, place(*at)?))) {
            let _ = writeln!(
                svg,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"9\" fill=\"none\" stroke=\"#444\" stroke-width=\"1.5\"/>\n\
                 <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\">{}</text>",
                px + 11.0,
                py - 7.0,
                escape(name)
            );
        }
        self.legend(&mut svg);
        svg.push_str("</svg>\n");
        svg
    }

    fn legend(&self, svg: &mut String) {
        let [_, top, right, _] = FRAME;
        let row = |index: usize| top + 14.0 + 22.0 * index as f64;
        for (index, series) in self.series.iter().enumerate() {
            let colour = COLOURS[index % COLOURS.len()];
            let y = row(index);
            if series.style == Style::Line {
                swatch(svg, y, colour, 2.0);
            } else {
                marker(svg, index, (right + 26.0, y - 4.0), colour, false);
            }
            let _ =
                writeln!(svg, "<text x=\"{:.1}\" y=\"{y:.1}\">{}</text>", right + 40.0, escape(&series.name));
        }
        if let Some((name, _)) = &self.band {
            let y = row(self.series.len());
            swatch(svg, y, POINTED_OUT, 7.0);
            let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{y:.1}\">{}</text>", right + 40.0, escape(name));
        }
    }

    fn grid(&self, svg: &mut String, x: &Axis, y: &Axis) {
        let [left, top, right, bottom] = FRAME;
        for (label, at) in x.ticks() {
            let _ = writeln!(
                svg,
                "<line x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{bottom}\" stroke=\"#e4e4e4\"/>\n\
                 <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                bottom + 20.0,
            );
        }
        for (label, at) in y.ticks() {
            let _ = writeln!(
                svg,
                "<line x1=\"{left}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#e4e4e4\"/>\n\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                left - 8.0,
                at + 4.0,
            );
        }
        let (middle_x, middle_y) = (0.5 * (left + right), 0.5 * (top + bottom));
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#444\"/>\n\
             <text x=\"{middle_x}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(20 {middle_y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            right - left,
            bottom - top,
            bottom + 46.0,
            escape(&self.labels[0]),
            escape(&self.labels[1]),
        );
    }
}

fn polyline(places: impl Iterator<Item = (f64, f64)>) -> String {
    places.map(|(x, y)| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

fn swatch(svg: &mut String, y: f64, colour: &str, width: f64) {
    let (from, to, y) = (FRAME[2] + 17.0, FRAME[2] + 34.0, y - 4.0);
    let _ = writeln!(
        svg,
        "<line x1=\"{from:.1}\" y1=\"{y:.1}\" x2=\"{to:.1}\" y2=\"{y:.1}\" stroke=\"{colour}\" \
         stroke-width=\"{width}\" stroke-linecap=\"round\"/>"
    );
}

/// Draws a circle, square, triangle or diamond.
fn marker(svg: &mut String, index: usize, (x, y): (f64, f64), colour: &str, is_hollow: bool) {
    let fill = if is_hollow { "white" } else { colour };
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
    let corners = polyline(points.iter().map(|(dx, dy)| (x + r * dx, y + r * dy)));
    let _ = writeln!(
        svg,
        "<polygon points=\"{corners}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>"
    );
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_that_the_axes_can_show_has_its_marker_inside_the_frame() {
        for scales in [[Scale::Linear, Scale::Linear], [Scale::Logarithmic, Scale::Logarithmic]] {
            let mut chart = Chart::new("a < b", String::new(), ["x", "y"], scales);
            let points = vec![(1e-3, 2.0), (1.0, 1e-5), (f64::NAN, 1.0), (20.0, 3.0)];
            chart.series.push(Series { name: "one".into(), points, style: Style::Marked, hollow: vec![] });
            let svg = chart.svg();
            let places: Vec<[f64; 2]> = svg
                .lines()
                .filter(|line| line.starts_with("<circle"))
                .map(|line| {
                    let value = |key: &str| {
                        let rest = line.split(&format!("{key}=\"")).nth(1).unwrap();
                        rest.split('"').next().unwrap().parse().unwrap()
                    };
                    [value("cx"), value("cy")]
                })
                .collect();
            // The last marker belongs to the legend.
            assert_eq!(places.len(), 4, "{svg}");
            let [left, top, right, bottom] = FRAME;
            assert!(places[..3].iter().all(|&[x, y]| x >= left && x <= right && y >= top && y <= bottom));
            assert!(places[0][0] < places[1][0] && places[1][0] < places[2][0], "{places:?}");
            assert!(places[2][1] < places[0][1] && places[0][1] < places[1][1], "{places:?}");
            assert!(svg.contains("a &lt; b"));
        }
    }
}
