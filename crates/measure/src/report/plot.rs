//! Plots as SVG.

use plotters::prelude::*;

use spikelane::error::{Error, Kind, Result};

/// A named line.
#[derive(Clone, Debug)]
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points, by rising x.
    pub points: Vec<(f64, f64)>,
}

/// What lies between two lines of common x, drawn below the curves.
#[derive(Clone, Debug)]
pub struct Band<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points of the lower line, by rising x.
    pub low: Vec<(f64, f64)>,
    /// Points of the upper line, by rising x.
    pub high: Vec<(f64, f64)>,
}

const SIZE: (u32, u32) = (800, 420);
pub(super) const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
];

const BETWEEN: RGBColor = RGBColor(210, 210, 210);

pub(super) fn failed(e: impl std::fmt::Display) -> Error {
    Error::new(Kind::Config, "plot").found(e)
}

/// Range of finite values, widened where it is empty.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    match (low.is_finite(), high > low) {
        (true, true) => low..high + 0.02 * (high - low),
        (true, false) => low - 0.5..high + 0.5,
        _ => 0.0..1.0,
    }
}

/// Width of the names beside a plot with several curves, in pixels.
const NAMES: i32 = 170;

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Splits off and fills the place for the names, so that none lies over a curve.
fn name_curves<'a>(root: &Area<'a>, curves: &[Curve<'_>], band: Option<&Band<'_>>) -> Result<Area<'a>> {
    if curves.len() < 2 && band.is_none() {
        return Ok(root.clone());
    }
    let (plot, names) = root.split_horizontally(SIZE.0 as i32 - NAMES);
    let height = |i: usize| 50 + 22 * i as i32;
    let write = |name: &str, y: i32| {
        names.draw(&Text::new(name.to_owned(), (32, y - 7), ("sans-serif", 14))).map_err(failed)
    };
    for (i, curve) in curves.iter().enumerate() {
        let y = height(i);
        let line = PathElement::new(vec![(4, y), (26, y)], COLOURS[i % COLOURS.len()].stroke_width(3));
        names.draw(&line).map_err(failed)?;
        write(curve.name, y)?;
    }
    if let Some(band) = band {
        let y = height(curves.len());
        names.draw(&Rectangle::new([(4, y - 6), (26, y + 6)], BETWEEN.filled())).map_err(failed)?;
        write(band.name, y)?;
    }
    Ok(plot)
}

/// Axes, then whatever `draw` adds to them.
fn chart(
    title: &str,
    (x, y): (&str, &str),
    (curves, band): (&[Curve<'_>], Option<&Band<'_>>),
    ranges: [std::ops::Range<f64>; 2],
    draw: impl FnOnce(&mut Chart<'_, '_>) -> Result<()>,
) -> Result<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let plot = name_curves(&root, curves, band)?;
        let [across, up] = ranges;
        let mut chart = ChartBuilder::on(&plot)
            .caption(title, ("sans-serif", 18))
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(across, up)
            .map_err(failed)?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(x).y_desc(y).light_line_style(WHITE).label_style(("sans-serif", 13));
        mesh.draw().map_err(failed)?;
        draw(&mut chart)?;
        root.present().map_err(failed)?;
    }
    Ok(svg)
}

type Chart<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

/// Lines over common axes, named at their right when there are several.
///
/// # Errors
/// When the plot cannot be laid out.
pub fn curves(title: &str, x: &str, y: &str, curves: &[Curve<'_>]) -> Result<String> {
    curves_over(title, (x, y), curves, None)
}

/// [`curves`] over a band, `(x, y)` the axes' names.
///
/// # Errors
/// When the plot cannot be laid out.
pub fn curves_over(
    title: &str,
    axes: (&str, &str),
    curves: &[Curve<'_>],
    band: Option<&Band<'_>>,
) -> Result<String> {
    lines(title, axes, (curves, band), 0)
}

/// [`curves_over`] with a dot at each point: of measured values the points count, and lines only join them.
///
/// # Errors
/// When the plot cannot be laid out.
pub fn marked(
    title: &str,
    axes: (&str, &str),
    curves: &[Curve<'_>],
    band: Option<&Band<'_>>,
) -> Result<String> {
    lines(title, axes, (curves, band), 3)
}

/// Lines with dots of `radius` pixels at their points.
fn lines(
    title: &str,
    axes: (&str, &str),
    (curves, band): (&[Curve<'_>], Option<&Band<'_>>),
    radius: u32,
) -> Result<String> {
    let ends = || band.iter().flat_map(|b| b.low.iter().chain(&b.high));
    let all = || curves.iter().flat_map(|c| c.points.iter()).chain(ends());
    let ranges = [range(all().map(|p| p.0)), range(all().map(|p| p.1))];
    chart(title, axes, (curves, band), ranges, |chart| {
        if let Some(band) = band {
            let outline: Vec<_> = band.low.iter().chain(band.high.iter().rev()).copied().collect();
            chart.draw_series([Polygon::new(outline, BETWEEN.filled())]).map_err(failed)?;
        }
        for (i, curve) in curves.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let points = curve.points.iter().copied().filter(|p| p.1.is_finite());
            let line = LineSeries::new(points, colour.stroke_width(2)).point_size(radius);
            chart.draw_series(line).map_err(failed)?;
        }
        Ok(())
    })
}

/// Most bins that are drawn as bars side by side; more of them as stepped lines.
const SIDE_BY_SIDE: usize = 16;

/// Histograms over common axes: `(value, share)` of each bin, all of one width. Few bins are bars side
/// by side, many are stepped lines.
///
/// # Errors
/// When the plot cannot be laid out.
pub fn bars(title: &str, x: &str, histograms: &[Curve<'_>]) -> Result<String> {
    let width = |c: &Curve<'_>| {
        let least = c.points.windows(2).map(|w| w[1].0 - w[0].0).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 1.0 }
    };
    if histograms.len() > 1 && histograms.iter().all(|c| c.points.len() <= SIDE_BY_SIDE) {
        return side_by_side(title, x, histograms, width);
    }
    let stepped = |c: &Curve<'_>| {
        let half = width(c) / 2.0;
        c.points.iter().flat_map(|(x, y)| [(x - half, *y), (x + half, *y)]).collect()
    };
    let steps: Vec<Curve<'_>> =
        histograms.iter().map(|c| Curve { name: c.name, points: stepped(c) }).collect();
    curves(title, x, "share", &steps)
}

fn side_by_side(
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
            let colour = COLOURS[i % COLOURS.len()].filled();
            let boxes =
                c.points.iter().map(|(x, y)| Rectangle::new([(left(*x), 0.0), (left(*x) + bar, *y)], colour));
            chart.draw_series(boxes).map_err(failed)?;
        }
        Ok(())
    })
}
