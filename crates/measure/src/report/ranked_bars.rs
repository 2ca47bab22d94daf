//! Horizontal bar plots with one row per quantity and a symmetric logarithmic axis.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::plot::{COLORS, plot_error};
use spikelane::error::Result;

/// A row of the plot: the name of a quantity, and a value for each series.
#[derive(Clone, Debug)]
pub struct RankedRow {
    /// Label at the left.
    pub name: String,
    /// One value per series.
    pub values: Vec<f64>,
}

const WIDTH_PX: i32 = 860;
const NAME_WIDTH_PX: i32 = 330;
const RIGHT_MARGIN_PX: i32 = 60;
const TOP_MARGIN_PX: i32 = 34;
const BOTTOM_MARGIN_PX: i32 = 44;
const BAR_HEIGHT_PX: i32 = 9;
const ROW_GAP_PX: i32 = 8;

/// Returns the sign of `x` times `log10(1 + |x|)`, which is smooth at zero.
fn symmetric_log(x: f64) -> f64 {
    x.signum() * x.abs().ln_1p() / std::f64::consts::LN_10
}

/// Returns an SVG plot with one row per quantity. A row contains one horizontal bar per series.
///
/// The axis is logarithmic for magnitudes above 1. `mark` is a magnitude and its label. A line is drawn at plus and at
/// minus this magnitude, if that side of zero contains values.
///
/// # Errors
/// If the plot cannot be drawn.
pub fn ranked_bar_plot(
    axis: &str,
    series: &[&str],
    rows: &[RankedRow],
    mark: Option<(f64, &str)>,
) -> Result<String> {
    let height_of_row = BAR_HEIGHT_PX * series.len() as i32 + ROW_GAP_PX;
    let bottom = TOP_MARGIN_PX + height_of_row * rows.len() as i32;
    let all = || rows.iter().flat_map(|r| r.values.iter().copied()).filter(|v| v.is_finite());
    let limit = mark.map_or(0.0, |m| symmetric_log(1.6 * m.0));
    let high = all().map(symmetric_log).fold(limit, f64::max).max(1.0);
    let signed = all().any(|v| v < 0.0);
    let low = if signed { all().map(symmetric_log).fold(-limit, f64::min) } else { 0.0 };
    let place = |v: f64| {
        NAME_WIDTH_PX
            + ((symmetric_log(v) - low) / (high - low)
                * f64::from(WIDTH_PX - NAME_WIDTH_PX - RIGHT_MARGIN_PX))
            .round() as i32
    };
    let text = |size: i32| ("sans-serif", size).into_text_style(&(WIDTH_PX as u32, 1_u32)).color(&DARK_GRAY);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH_PX as u32, (bottom + BOTTOM_MARGIN_PX) as u32))
            .into_drawing_area();
        let line = |x: i32, color: RGBColor| {
            root.draw(&PathElement::new(vec![(x, TOP_MARGIN_PX - 4), (x, bottom)], color.stroke_width(1)))
                .map_err(plot_error)
        };
        let centered = text(13).pos(Pos::new(HPos::Center, VPos::Top));
        let steps = (0..9).flat_map(|k| [1.0, 2.0, 5.0].map(|m: f64| m * 10_f64.powi(k)));
        let mut ticks: Vec<f64> = steps.clone().map(|t| -t).chain([0.0]).chain(steps).collect();
        ticks.retain(|t| symmetric_log(*t) >= low && symmetric_log(*t) <= high);
        // Zero and powers of ten have priority. Other ticks are drawn only where space remains.
        let rank = |t: f64| if t == 0.0 { 0 } else { 1 + u8::from(t.abs().log10().fract() != 0.0) };
        ticks.sort_by_key(|t| rank(*t));
        let mut positions: Vec<i32> = Vec::new();
        for tick in ticks {
            let x = place(tick);
            if positions.iter().any(|t| (t - x).abs() < 44) {
                continue;
            }
            positions.push(x);
            line(x, if tick == 0.0 { DARK_GRAY } else { LIGHT_GRAY })?;
            let shown = if tick.abs() < 1e5 { format!("{tick}") } else { format!("{tick:e}") };
            root.draw(&Text::new(shown, (x, bottom + 4), centered.clone())).map_err(plot_error)?;
        }
        root.draw(&Text::new(
            axis.to_owned(),
            ((NAME_WIDTH_PX + WIDTH_PX - RIGHT_MARGIN_PX) / 2, bottom + 24),
            centered.clone(),
        ))
        .map_err(plot_error)?;
        for (i, row) in rows.iter().enumerate() {
            let top = TOP_MARGIN_PX + height_of_row * i as i32 + ROW_GAP_PX / 2;
            let middle = top + BAR_HEIGHT_PX * series.len() as i32 / 2;
            let right = text(13).pos(Pos::new(HPos::Right, VPos::Center));
            root.draw(&Text::new(row.name.clone(), (NAME_WIDTH_PX - 8, middle), right))
                .map_err(plot_error)?;
            for (s, value) in row.values.iter().enumerate().filter(|v| v.1.is_finite()) {
                let y = top + BAR_HEIGHT_PX * s as i32;
                let ends = [place(0.0), place(*value)];
                let corners = [
                    (ends[0].min(ends[1]), y),
                    (ends[0].max(ends[1]).max(ends[0] + 1), y + BAR_HEIGHT_PX - 1),
                ];
                root.draw(&Rectangle::new(corners, COLORS[s + 1].filled())).map_err(plot_error)?;
            }
        }
        if let Some((value, name)) = mark {
            let sides: &[f64] = if signed { &[-1.0, 1.0] } else { &[1.0] };
            for side in sides {
                line(place(side * value), BLACK)?;
            }
            let left = text(12).pos(Pos::new(HPos::Left, VPos::Top));
            root.draw(&Text::new(name.to_owned(), (place(value) + 4, 18), left)).map_err(plot_error)?;
        }
        let mut x = NAME_WIDTH_PX;
        for (s, name) in series.iter().enumerate() {
            root.draw(&Rectangle::new([(x, 4), (x + 12, 14)], COLORS[s + 1].filled())).map_err(plot_error)?;
            root.draw(&Text::new((*name).to_owned(), (x + 17, 3), text(13))).map_err(plot_error)?;
            x += 34 + 8 * name.len() as i32;
        }
        root.present().map_err(plot_error)?;
    }
    Ok(svg)
}

const DARK_GRAY: RGBColor = RGBColor(70, 70, 70);
const LIGHT_GRAY: RGBColor = RGBColor(225, 225, 225);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longer_bar_belongs_to_the_larger_value() {
        let rows =
            [("small", 3.0), ("large", 3e4)].map(|(n, v)| RankedRow { name: n.to_owned(), values: vec![v] });
        let svg = ranked_bar_plot("z", &["before"], &rows, Some((5.0, "limit"))).unwrap();
        let fill = "fill=\"#D55E00\"";
        let widths: Vec<i32> = svg
            .lines()
            .filter(|l| l.starts_with("<rect") && l.contains(fill))
            .filter_map(|l| l.split("width=\"").nth(1)?.split('"').next()?.parse().ok())
            .collect();
        // The SVG contains two bars and the legend.
        assert!(widths.len() == 3 && widths[1] > 4 * widths[0], "{widths:?}");
    }
}
