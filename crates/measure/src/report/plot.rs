//! Plots as SVG.

use plotters::prelude::*;

use spikelane::error::{Error, ErrorKind, Result};

/// A named curve.
#[derive(Clone, Debug)]
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points in ascending order of x.
    pub points: Vec<(f64, f64)>,
}

/// The area between two lines. Plots draw the area first and the curves on top.
#[derive(Clone, Debug)]
pub struct ShadedBand<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points of the lower line, in ascending order of x.
    pub low: Vec<(f64, f64)>,
    /// Points of the upper line, in ascending order of x.
    pub high: Vec<(f64, f64)>,
}

const PLOT_SIZE_PX: (u32, u32) = (800, 420);
pub(super) const COLORS: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
];

const BAND_COLOR: RGBColor = RGBColor(210, 210, 210);

pub(super) fn plot_error(e: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Config, "plot").found(e)
}

/// Returns the range of the finite values. If all values are equal, the range extends 0.5 to each side.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    match (low.is_finite(), high > low) {
        (true, true) => low..high + 0.02 * (high - low),
        (true, false) => low - 0.5..high + 0.5,
        _ => 0.0..1.0,
    }
}

/// Width of the legend beside a plot with several curves, in pixels.
const LEGEND_WIDTH_PX: i32 = 170;

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Draws the legend in an area beside the plot, so that the legend covers no curve. Returns the remaining area.
fn draw_legend<'a>(root: &Area<'a>, curves: &[Curve<'_>], band: Option<&ShadedBand<'_>>) -> Result<Area<'a>> {
    if curves.len() < 2 && band.is_none() {
        return Ok(root.clone());
    }
    let (plot, names) = root.split_horizontally(PLOT_SIZE_PX.0 as i32 - LEGEND_WIDTH_PX);
    let height = |i: usize| 50 + 22 * i as i32;
    let write = |name: &str, y: i32| {
        names.draw(&Text::new(name.to_owned(), (32, y - 7), ("sans-serif", 14))).map_err(plot_error)
    };
    for (i, curve) in curves.iter().enumerate() {
        let y = height(i);
        let line = PathElement::new(vec![(4, y), (26, y)], COLORS[i % COLORS.len()].stroke_width(3));
        names.draw(&line).map_err(plot_error)?;
        write(curve.name, y)?;
    }
    if let Some(band) = band {
        let y = height(curves.len());
        names.draw(&Rectangle::new([(4, y - 6), (26, y + 6)], BAND_COLOR.filled())).map_err(plot_error)?;
        write(band.name, y)?;
    }
    Ok(plot)
}

/// Draws the axes, then calls `draw` to draw the curves. Returns the SVG.
fn chart(
    title: &str,
    (x, y): (&str, &str),
    (curves, band): (&[Curve<'_>], Option<&ShadedBand<'_>>),
    ranges: [std::ops::Range<f64>; 2],
    draw: impl FnOnce(&mut Chart<'_, '_>) -> Result<()>,
) -> Result<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, PLOT_SIZE_PX).into_drawing_area();
        let plot = draw_legend(&root, curves, band)?;
        let [across, up] = ranges;
        let mut chart = ChartBuilder::on(&plot)
            .caption(title, ("sans-serif", 18))
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(across, up)
            .map_err(plot_error)?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(x).y_desc(y).light_line_style(WHITE).label_style(("sans-serif", 13));
        mesh.draw().map_err(plot_error)?;
        draw(&mut chart)?;
        root.present().map_err(plot_error)?;
    }
    Ok(svg)
}

type Chart<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

/// Returns an SVG plot of curves on common axes. Two or more curves have a legend.
///
/// # Errors
/// [`ErrorKind::Config`] if the plot cannot be drawn.
pub fn line_plot(title: &str, x: &str, y: &str, curves: &[Curve<'_>]) -> Result<String> {
    line_plot_over_band(title, (x, y), curves, None)
}

/// Returns a [`line_plot`] on top of a shaded band. `axes` contains the labels of the x and y axes.
///
/// # Errors
/// [`ErrorKind::Config`] if the plot cannot be drawn.
pub fn line_plot_over_band(
    title: &str,
    axes: (&str, &str),
    curves: &[Curve<'_>],
    band: Option<&ShadedBand<'_>>,
) -> Result<String> {
    draw_lines(title, axes, (curves, band), 0)
}

/// Returns a [`line_plot_over_band`] with a dot at each point. The dots show which values were measured.
///
/// # Errors
/// [`ErrorKind::Config`] if the plot cannot be drawn.
pub fn marked_line_plot(
    title: &str,
    axes: (&str, &str),
    curves: &[Curve<'_>],
    band: Option<&ShadedBand<'_>>,
) -> Result<String> {
    draw_lines(title, axes, (curves, band), 3)
}

/// Draws curves with a dot of `radius` pixels at each point.
fn draw_lines(
    title: &str,
    axes: (&str, &str),
    (curves, band): (&[Curve<'_>], Option<&ShadedBand<'_>>),
    radius: u32,
) -> Result<String> {
    let ends = || band.iter().flat_map(|b| b.low.iter().chain(&b.high));
    let all = || curves.iter().flat_map(|c| c.points.iter()).chain(ends());
    let ranges = [range(all().map(|p| p.0)), range(all().map(|p| p.1))];
    chart(title, axes, (curves, band), ranges, |chart| {
        if let Some(band) = band {
            let outline: Vec<_> = band.low.iter().chain(band.high.iter().rev()).copied().collect();
            chart.draw_series([Polygon::new(outline, BAND_COLOR.filled())]).map_err(plot_error)?;
        }
        for (i, curve) in curves.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let points = curve.points.iter().copied().filter(|p| p.1.is_finite());
            let line = LineSeries::new(points, color.stroke_width(2)).point_size(radius);
            chart.draw_series(line).map_err(plot_error)?;
        }
        Ok(())
    })
}

/// Largest number of bins that are drawn as grouped bars. More bins are drawn as stepped lines.
const MAX_GROUPED_BINS: usize = 16;

/// Returns an SVG plot of histograms on common axes.
///
/// A point of a histogram consists of the value of a bin and the share of this bin. All bins of a histogram have the
/// same width. Two or more histograms with at most 16 bins each are drawn as grouped bars. All other histograms are
/// drawn as stepped lines.
///
/// # Errors
/// [`ErrorKind::Config`] if the plot cannot be drawn.
pub fn bar_plot(title: &str, x: &str, histograms: &[Curve<'_>]) -> Result<String> {
    let width = |c: &Curve<'_>| {
        let min_step = c.points.windows(2).map(|w| w[1].0 - w[0].0).fold(f64::INFINITY, f64::min);
        if min_step.is_finite() { min_step } else { 1.0 }
    };
    if histograms.len() > 1 && histograms.iter().all(|c| c.points.len() <= MAX_GROUPED_BINS) {
        return draw_grouped_bars(title, x, histograms, width);
    }
    let stepped = |c: &Curve<'_>| {
        let half = width(c) / 2.0;
        c.points.iter().flat_map(|(x, y)| [(x - half, *y), (x + half, *y)]).collect()
    };
    let steps: Vec<Curve<'_>> =
        histograms.iter().map(|c| Curve { name: c.name, points: stepped(c) }).collect();
    line_plot(title, x, "share", &steps)
}

fn draw_grouped_bars(
    title: &str,
    x: &str,
    histograms: &[Curve<'_>],
    width: impl Fn(&Curve<'_>) -> f64,
) -> Result<String> {
    let all = || histograms.iter().flat_map(|c| c.points.iter());
    let step = histograms.iter().map(&width).fold(1.0, f64::max);
    let across = range(all().flat_map(|p| [p.0 - step / 2.0, p.0 + step / 2.0]));
    let up = range(all().map(|p| p.1).chain([0.0]));
    chart(title, (x, "share"), (histograms, None), [across, up], |chart| {
        let bar = 0.84 * step / histograms.len() as f64;
        for (i, c) in histograms.iter().enumerate() {
            let left = |x: f64| x - 0.42 * step + bar * i as f64;
            let color = COLORS[i % COLORS.len()].filled();
            let boxes =
                c.points.iter().map(|(x, y)| Rectangle::new([(left(*x), 0.0), (left(*x) + bar, *y)], color));
            chart.draw_series(boxes).map_err(plot_error)?;
        }
        Ok(())
    })
}
