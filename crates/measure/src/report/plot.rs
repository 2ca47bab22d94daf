//! Plots as SVG. The colors are variables of the page, so a plot follows the light or dark style of the page.

use std::fmt::Write as _;

use super::PageElement;
use super::rounding::{power_of_ten, with_error, without_error};
use super::text::EscapedText;

/// Size of the drawing in SVG units. The page scales the drawing.
const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 76.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 52.0;

/// Number of colors in the style of the page.
const COLORS: usize = 8;

/// Dash patterns, so that curves differ without their colors.
const DASHES: [&str; 4] = ["", "7 3", "2 3", "9 3 2 3"];

/// Largest number of points with a hover text on one curve.
const MAX_HOVER_POINTS: usize = 150;

/// A point with a standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotPoint {
    /// Position on the x axis.
    pub x: f64,
    /// Value.
    pub y: f64,
    /// Standard error of the value; 0 if it is unknown.
    pub error: f64,
}

impl PlotPoint {
    /// Returns a point. An error that is not finite becomes 0.
    #[must_use]
    pub fn new(x: f64, y: f64, error: f64) -> Self {
        Self { x, y, error: if error.is_finite() { error } else { 0.0 } }
    }
}

#[derive(Clone, Debug)]
enum Shape {
    Line,
    Points,
    PointsOnLine(Vec<(f64, f64)>),
    Bars,
    Band(Vec<(f64, f64)>),
}

/// A curve, a series of points, a histogram or a band.
#[derive(Clone, Debug)]
struct Layer {
    name: String,
    shape: Shape,
    points: Vec<PlotPoint>,
}

/// An axis with its label and range.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    label: String,
    is_log: bool,
    low: f64,
    high: f64,
}

/// A plot with two axes. The title of a plot states what the plot shows.
///
/// # Examples
/// ```
/// use spikelane_measure::report::{Plot, PlotPoint};
/// let figure = Plot::new("The rate grows with the light", "light", "spikes per readout")
///     .points("recorded", vec![PlotPoint::new(0.1, 0.2, 0.01), PlotPoint::new(0.5, 0.6, 0.01)])
///     .line("fitted", vec![(0.0, 0.1), (0.5, 0.6)])
///     .figure("Bars are standard errors.");
/// assert!(figure.to_string().contains("<svg"));
/// ```
#[derive(Clone, Debug)]
pub struct Plot {
    title: String,
    x: Axis,
    y: Axis,
    layers: Vec<Layer>,
    rules: Vec<(f64, String)>,
    names: Vec<(f64, String)>,
    max_y: f64,
}

impl Plot {
    /// Returns a plot without data. `x` and `y` are the labels of the axes with their units.
    #[must_use]
    pub fn new(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        let axis = |label: String| Axis::spanning(&label, &[0.0, 1.0]);
        Self {
            title: title.into(),
            x: axis(x.into()),
            y: axis(y.into()),
            layers: Vec::new(),
            rules: Vec::new(),
            names: Vec::new(),
            max_y: f64::INFINITY,
        }
    }

    /// Adds a curve through `points`, in ascending order of x.
    #[must_use]
    pub fn line(self, name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        self.layer(name, Shape::Line, plain(points))
    }

    /// Adds points with their standard errors.
    #[must_use]
    pub fn points(self, name: impl Into<String>, points: Vec<PlotPoint>) -> Self {
        self.layer(name, Shape::Points, points)
    }

    /// Adds points with their standard errors, and a curve through them in the same color.
    #[must_use]
    pub fn points_on_line(
        mut self,
        name: impl Into<String>,
        points: Vec<PlotPoint>,
        line: Vec<(f64, f64)>,
    ) -> Self {
        self.layers.push(Layer { name: name.into(), shape: Shape::PointsOnLine(line), points });
        self
    }

    /// Adds a histogram: the center and the height of each bin. All bins have the same width.
    #[must_use]
    pub fn bars(self, name: impl Into<String>, bins: Vec<(f64, f64)>) -> Self {
        self.layer(name, Shape::Bars, plain(bins))
    }

    /// Adds the area between the lines `low` and `high`, in ascending order of x.
    #[must_use]
    pub fn band(self, name: impl Into<String>, low: Vec<(f64, f64)>, high: Vec<(f64, f64)>) -> Self {
        self.layer(name, Shape::Band(high), plain(low))
    }

    /// Adds a horizontal line at `y` with a label.
    #[must_use]
    pub fn rule(mut self, y: f64, label: impl Into<String>) -> Self {
        self.rules.push((y, label.into()));
        self
    }

    /// Makes the x axis logarithmic. Points at or below 0 are omitted.
    #[must_use]
    pub fn log_x(mut self) -> Self {
        self.x.is_log = true;
        self
    }

    /// Makes the y axis logarithmic. Points at or below 0 are omitted.
    #[must_use]
    pub fn log_y(mut self) -> Self {
        self.y.is_log = true;
        self
    }

    /// Replaces the ticks of the x axis with names at positions.
    #[must_use]
    pub fn named_ticks(mut self, names: Vec<(f64, String)>) -> Self {
        self.names = names;
        self
    }

    /// Ends the y axis at `max` if a value is larger.
    #[must_use]
    pub fn max_y(mut self, max: f64) -> Self {
        self.max_y = max;
        self
    }

    fn layer(mut self, name: impl Into<String>, shape: Shape, points: Vec<PlotPoint>) -> Self {
        self.layers.push(Layer { name: name.into(), shape, points });
        self
    }

    /// Returns the plot as an element of a page, with a legend if the plot has several layers.
    #[must_use]
    pub fn figure(mut self, caption: impl Into<String>) -> PageElement {
        self.set_ranges();
        let markup = self.legend() + &self.svg();
        PageElement::figure(self.title, markup, caption)
    }

    /// Returns the values of an axis that the plot must show.
    fn set_ranges(&mut self) {
        let has_bars = self.layers.iter().any(|l| matches!(l.shape, Shape::Bars));
        let half_bar =
            self.layers.iter().filter(|l| matches!(l.shape, Shape::Bars)).map(|l| bin_width(&l.points) / 2.0);
        let half_bar = half_bar.fold(0.0, f64::max);
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        for layer in &self.layers {
            for p in &layer.points {
                xs.push(p.x);
                ys.extend([p.y - p.error, p.y + p.error]);
            }
            if let Shape::Band(high) = &layer.shape {
                ys.extend(high.iter().map(|p| p.1));
            }
        }
        ys.extend(self.rules.iter().map(|r| r.0));
        if has_bars {
            ys.push(0.0);
        }
        self.x.set_range(&xs, half_bar, if has_bars { 0.0 } else { 0.03 });
        self.y.set_range(&ys, 0.0, 0.06);
        if has_bars && !self.y.is_log {
            self.y.low = 0.0;
        }
        self.y.high = self.y.high.min(self.max_y);
    }

    fn place_x(&self, x: f64) -> f64 {
        LEFT + self.x.share(x) * (WIDTH - LEFT - RIGHT)
    }

    fn place_y(&self, y: f64) -> f64 {
        HEIGHT - BOTTOM - self.y.share(y).clamp(0.0, 1.0) * (HEIGHT - TOP - BOTTOM)
    }

    fn is_shown(&self, p: &PlotPoint) -> bool {
        p.x.is_finite() && p.y.is_finite() && (!self.x.is_log || p.x > 0.0) && (!self.y.is_log || p.y > 0.0)
    }

    fn legend(&self) -> String {
        if self.layers.len() < 2 {
            return String::new();
        }
        let mut text = "<ul class=\"legend\">".to_owned();
        for (i, layer) in self.layers.iter().enumerate() {
            let swatch = match layer.shape {
                Shape::Line => {
                    format!(
                        "<path d=\"M0 7H26\" class=\"l\" stroke-dasharray=\"{}\"/>",
                        DASHES[i % DASHES.len()]
                    )
                }
                Shape::Points | Shape::PointsOnLine(_) => marker(i, 13.0, 7.0),
                Shape::Bars => "<rect width=\"26\" height=\"14\" class=\"bar\"/>".to_owned(),
                Shape::Band(_) => "<rect width=\"26\" height=\"14\" class=\"band\"/>".to_owned(),
            };
            let (color, name) = (i % COLORS, EscapedText(&layer.name));
            let _ =
                write!(text, "<li class=\"c{color}\"><svg viewBox=\"0 0 26 14\">{swatch}</svg>{name}</li>");
        }
        text + "</ul>"
    }

    fn svg(&self) -> String {
        let mut svg = format!(
            "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">",
            EscapedText(&self.title)
        );
        self.draw_axes(&mut svg);
        // Bands are below all curves.
        let is_band = |l: &Layer| matches!(l.shape, Shape::Band(_));
        for bands in [true, false] {
            for (i, layer) in self.layers.iter().enumerate().filter(|(_, l)| is_band(l) == bands) {
                let _ = write!(svg, "<g class=\"c{}\">", i % COLORS);
                self.draw_layer(&mut svg, i, layer);
                svg += "</g>";
            }
        }
        for (y, label) in &self.rules {
            let at = self.place_y(*y);
            let _ = write!(
                svg,
                "<path class=\"rule\" d=\"M{LEFT} {at:.1}H{:.1}\"/><text class=\"rule\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                WIDTH - RIGHT,
                WIDTH - RIGHT - 4.0,
                if at > TOP + 20.0 { at - 5.0 } else { at + 16.0 },
                EscapedText(label)
            );
        }
        svg + "</svg>"
    }

    /// Returns the number of ticks of the x axis. Bars at whole numbers have no ticks between them.
    fn x_tick_count(&self) -> usize {
        let is_whole =
            |l: &Layer| matches!(l.shape, Shape::Bars) && l.points.iter().all(|p| p.x.fract() == 0.0);
        let count = if self.layers.iter().any(is_whole) { (self.x.high - self.x.low).min(6.0) } else { 6.0 };
        (count as usize).max(1)
    }

    fn draw_axes(&self, svg: &mut String) {
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        let (ticks, factor) =
            if self.names.is_empty() { self.x.ticks(self.x_tick_count()) } else { (self.names.clone(), 0) };
        for (value, label) in ticks {
            let x = self.place_x(value);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{x:.1} {TOP}V{bottom}\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                bottom + 18.0,
                EscapedText(label)
            );
        }
        let label = |axis: &Axis, factor: i32| EscapedText(axis.label_in(factor)).to_string();
        let _ = write!(
            svg,
            "<text class=\"label\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            f64::midpoint(LEFT, right),
            HEIGHT - 10.0,
            label(&self.x, factor)
        );
        let (ticks, factor) = self.y.ticks(5);
        for (value, text) in ticks {
            let y = self.place_y(value);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{right}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 7.0,
                y + 4.5,
                EscapedText(text)
            );
        }
        let middle = f64::midpoint(TOP, bottom);
        // A character is about half as wide as the font is high. A long label gets a smaller font.
        let chars = self.y.label.chars().count() as f64;
        let size = match chars > 32.0 {
            true => format!(" style=\"font-size:{:.1}px\"", 13.0 * 32.0 / chars),
            false => String::new(),
        };
        let _ = write!(
            svg,
            "<text class=\"label y\"{size} transform=\"translate(14 {middle}) rotate(-90)\" text-anchor=\"middle\">{}</text><path class=\"axis\" d=\"M{LEFT} {TOP}V{bottom}H{right}\"/>",
            label(&self.y, factor)
        );
    }

    fn draw_layer(&self, svg: &mut String, index: usize, layer: &Layer) {
        let shown: Vec<&PlotPoint> = layer.points.iter().filter(|p| self.is_shown(p)).collect();
        let hover = |p: &PlotPoint| {
            let y = if p.error > 0.0 { with_error(p.y, p.error).to_string() } else { without_error(p.y) };
            let name = |x: f64| self.names.iter().find(|n| n.0 == x).map(|n| n.1.clone());
            let x = name(p.x).unwrap_or_else(|| without_error(p.x));
            let text = format!("{}: {y}\n{}: {x}", layer.name, self.x.label);
            format!("<title>{}</title>", EscapedText(text))
        };
        match &layer.shape {
            Shape::Line => {
                let path = self.path(shown.iter().map(|p| (p.x, p.y)));
                let dash = DASHES[index % DASHES.len()];
                let _ = write!(svg, "<path class=\"l\" stroke-dasharray=\"{dash}\" d=\"{path}\"/>");
                for p in shown.iter().step_by(shown.len().div_ceil(MAX_HOVER_POINTS).max(1)) {
                    let (x, y) = (self.place_x(p.x), self.place_y(p.y));
                    let _ = write!(
                        svg,
                        "<circle class=\"h\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\">{}</circle>",
                        hover(p)
                    );
                }
            }
            Shape::Points | Shape::PointsOnLine(_) => {
                if let Shape::PointsOnLine(line) = &layer.shape {
                    let usable = line.iter().filter(|p| self.is_shown(&PlotPoint::new(p.0, p.1, 0.0)));
                    let path = self.path(usable.copied());
                    let dash = DASHES[index % DASHES.len()];
                    let _ = write!(svg, "<path class=\"l\" stroke-dasharray=\"{dash}\" d=\"{path}\"/>");
                }
                for p in shown {
                    let (x, y) = (self.place_x(p.x), self.place_y(p.y));
                    let _ = write!(svg, "<g>{}", hover(p));
                    if p.error > 0.0 {
                        let [low, high] = [p.y - p.error, p.y + p.error].map(|y| self.place_y(y));
                        let _ = write!(
                            svg,
                            "<path class=\"e\" d=\"M{x:.1} {low:.1}V{high:.1}M{:.1} {low:.1}h6M{:.1} {high:.1}h6\"/>",
                            x - 3.0,
                            x - 3.0
                        );
                    }
                    let _ = write!(svg, "{}</g>", marker(index, x, y));
                }
            }
            Shape::Bars => {
                let all: Vec<usize> =
                    (0..self.layers.len()).filter(|i| matches!(self.layers[*i].shape, Shape::Bars)).collect();
                let width = bin_width(&layer.points);
                // Bars of several histograms stand side by side.
                let (share, rank) =
                    (0.9 / all.len() as f64, all.iter().position(|i| *i == index).unwrap_or(0));
                for p in shown {
                    let from = self.place_x(p.x + width * (share * rank as f64 - 0.45));
                    let to = self.place_x(p.x + width * (share * (rank + 1) as f64 - 0.45));
                    let (top, bottom) = (self.place_y(p.y), HEIGHT - BOTTOM);
                    let _ = write!(
                        svg,
                        "<rect class=\"bar\" x=\"{from:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\">{}</rect>",
                        (to - from).max(0.5),
                        bottom - top,
                        hover(p)
                    );
                }
            }
            Shape::Band(high) => {
                let upper = high.iter().map(|p| PlotPoint::new(p.0, p.1, 0.0)).filter(|p| self.is_shown(p));
                let upper: Vec<(f64, f64)> = upper.map(|p| (p.x, p.y)).collect();
                let outline = shown.iter().map(|p| (p.x, p.y)).chain(upper.into_iter().rev());
                let path = self.path(outline);
                if !path.is_empty() {
                    let _ = write!(
                        svg,
                        "<path class=\"band\" d=\"{path}Z\"><title>{}</title></path>",
                        EscapedText(&layer.name)
                    );
                }
            }
        }
    }

    fn path(&self, points: impl Iterator<Item = (f64, f64)>) -> String {
        let mut path = String::new();
        for (i, (x, y)) in points.enumerate() {
            let command = if i == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{command}{:.1} {:.1}", self.place_x(x), self.place_y(y));
        }
        path
    }
}

fn plain(points: Vec<(f64, f64)>) -> Vec<PlotPoint> {
    points.into_iter().map(|(x, y)| PlotPoint::new(x, y, 0.0)).collect()
}

/// Returns the smallest distance of neighboring bins, or 1 for fewer than two bins.
fn bin_width(bins: &[PlotPoint]) -> f64 {
    let width = bins.windows(2).map(|w| w[1].x - w[0].x).filter(|w| *w > 0.0).fold(f64::INFINITY, f64::min);
    if width.is_finite() { width } else { 1.0 }
}

/// Returns a marker whose shape depends on the index of the series.
fn marker(index: usize, x: f64, y: f64) -> String {
    match index % 4 {
        0 => format!("<circle class=\"m\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.6\"/>"),
        1 => {
            format!("<rect class=\"m\" x=\"{:.1}\" y=\"{:.1}\" width=\"7\" height=\"7\"/>", x - 3.5, y - 3.5)
        }
        2 => format!("<path class=\"m\" d=\"M{x:.1} {:.1}l4.4 7.6h-8.8z\"/>", y - 4.8),
        _ => format!("<path class=\"m\" d=\"M{x:.1} {:.1}l4.8 4.8l-4.8 4.8l-4.8 -4.8z\"/>", y - 4.8),
    }
}

impl Axis {
    /// Returns a linear axis from the least to the largest of the finite `values`.
    pub(super) fn spanning(label: &str, values: &[f64]) -> Self {
        let mut axis = Self { label: label.to_owned(), is_log: false, low: 0.0, high: 1.0 };
        axis.set_range(values, 0.0, 0.0);
        axis
    }

    /// Returns the label of the axis with the power of ten of its ticks.
    pub(super) fn label_in(&self, factor: i32) -> String {
        match factor {
            0 => self.label.clone(),
            n => format!("{}, in{}", self.label, power_of_ten(n).trim_start_matches(" ×")),
        }
    }

    /// Sets the range to the finite `values`, widened by `border` in units and by `margin` of the range at each end.
    fn set_range(&mut self, values: &[f64], border: f64, margin: f64) {
        let usable = |v: &&f64| v.is_finite() && (!self.is_log || **v > 0.0);
        let ends = |(l, h): (f64, f64), v: &f64| (l.min(*v), h.max(*v));
        let (low, high) = values.iter().filter(usable).fold((f64::INFINITY, f64::NEG_INFINITY), ends);
        (self.low, self.high) = match (low.is_finite(), self.is_log) {
            (false, false) => (0.0, 1.0),
            (false, true) => (1.0, 10.0),
            (true, true) if high < 1.5 * low => (low / 2.0, high * 2.0),
            (true, true) => (low * (low / high).powf(margin), high * (high / low).powf(margin)),
            (true, false) if high - low <= 1e-12 * high.abs().max(low.abs()) => {
                let half = if high == 0.0 { 0.5 } else { 0.1 * high.abs() };
                (low - half, high + half)
            }
            (true, false) => (low - border - margin * (high - low), high + border + margin * (high - low)),
        };
    }

    pub(super) fn share(&self, value: f64) -> f64 {
        if self.is_log {
            (value.max(f64::MIN_POSITIVE) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Returns about `count` ticks with their labels, and a power of ten. A value is its label times this power.
    pub(super) fn ticks(&self, count: usize) -> (Vec<(f64, String)>, i32) {
        if self.is_log && self.high > 9.0 * self.low {
            return (self.log_ticks(), 0);
        }
        let step = nice_step((self.high - self.low) / count as f64);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        let largest = self.low.abs().max(self.high.abs());
        let factor = if (1e-2..1e5).contains(&largest) { 0 } else { largest.log10().floor() as i32 };
        let decimals = (f64::from(factor) - step.log10().floor()).clamp(0.0, 12.0) as usize;
        let label = |n: i64| format!("{:.decimals$}", n as f64 * step / 10_f64.powi(factor));
        ((first..=last).map(|n| (n as f64 * step, label(n))).collect(), factor)
    }

    fn log_ticks(&self) -> Vec<(f64, String)> {
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let span = self.high.log10() - self.low.log10();
        let stride = (span / 6.0).ceil().max(1.0) as i32;
        let multiples: &[f64] = if span < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let label = |value: f64, decade: i32| {
            if (-3..5).contains(&decade) {
                format!("{}", (value * 1e6).round() / 1e6)
            } else {
                format!("1e{decade}")
            }
        };
        decades
            .filter(|d| d.rem_euclid(stride) == 0)
            .flat_map(|d| multiples.iter().map(move |m| (m * 10_f64.powi(d), d)))
            .filter(|(v, _)| (self.low * 0.999..=self.high * 1.001).contains(v))
            .map(|(v, d)| (v, label(v, d)))
            .collect()
    }
}

/// Returns the smallest of 1, 2 and 5 times a power of ten that is at least `step`.
fn nice_step(step: f64) -> f64 {
    let power = 10_f64.powf(step.max(f64::MIN_POSITIVE).log10().floor());
    let multiple = [1.0, 2.0, 5.0].into_iter().find(|m| m * power >= step * (1.0 - 1e-9));
    multiple.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(low: f64, high: f64, is_log: bool) -> Axis {
        Axis { is_log, ..Axis::spanning("", &[low, high]) }
    }

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks(5).0.into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(labels(&axis(-0.03, 1.03, false)), ["0.0", "0.5", "1.0"]);
        assert_eq!(labels(&axis(0.21, 0.29, false)), ["0.22", "0.24", "0.26", "0.28"]);
        assert_eq!(labels(&axis(3.0, 20_000.0, true)), ["10", "100", "1000", "10000"]);
    }

    #[test]
    fn bars_at_whole_numbers_have_whole_ticks() {
        let html = Plot::new("t", "x", "y").bars("b", vec![(1.0, 0.6), (2.0, 0.4)]).figure("").to_string();
        assert!(html.contains(">2<") && !html.contains(">1.5<"), "{html}");
    }

    #[test]
    fn tiny_values_share_a_power_of_ten() {
        let (ticks, factor) = axis(0.0, 4e-5, false).ticks(5);
        assert_eq!((ticks[1].1.as_str(), factor), ("1", -5));
    }

    #[test]
    fn a_point_is_drawn_at_its_value() {
        let mut plot = Plot::new("t", "x", "y").points("p", vec![PlotPoint::new(0.5, 3.0, 0.5)]);
        plot.x = axis(0.0, 1.0, false);
        plot.y = axis(2.0, 4.0, false);
        let svg = plot.svg();
        let (x, y) = (f64::midpoint(LEFT, WIDTH - RIGHT), f64::midpoint(TOP, HEIGHT - BOTTOM));
        assert!(svg.contains(&format!("cx=\"{x:.1}\" cy=\"{y:.1}\"")), "{svg}");
        assert!(svg.contains("3.00 ± 0.50"), "{svg}");
    }

    #[test]
    fn values_that_are_not_finite_are_not_drawn() {
        let points = vec![(0.0, f64::NAN), (1.0, f64::INFINITY), (2.0, 1.0), (3.0, 1.0)];
        let html = Plot::new("t", "x", "y").line("p", points).figure("").to_string();
        assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
        assert_eq!(html.matches("class=\"h\"").count(), 2);
    }

    #[test]
    fn names_in_a_plot_are_text() {
        let html = Plot::new("<b>", "<i>", "y").line("<img>", vec![(0.0, 1.0)]).figure("").to_string();
        assert!(!html.contains("<b>") && !html.contains("<i>") && !html.contains("<img>"), "{html}");
    }
}
