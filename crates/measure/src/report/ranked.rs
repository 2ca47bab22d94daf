//! Bars that lie, one row a quantity, over an axis that holds both three and a million.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::plot::{COLOURS, failed};
use spikelane::error::Result;

/// A row: its name and a value for each series.
#[derive(Clone, Debug)]
pub struct Row {
    /// Name at the left.
    pub name: String,
    /// One value a series.
    pub values: Vec<f64>,
}

const WIDTH: i32 = 860;
const NAMES: i32 = 330;
const RIGHT: i32 = 60;
const TOP: i32 = 34;
const BOTTOM: i32 = 44;
const BAR: i32 = 9;
const SPACE: i32 = 8;

/// Sign and logarithm, smooth through zero.
fn bent(x: f64) -> f64 {
    x.signum() * x.abs().ln_1p() / std::f64::consts::LN_10
}

/// Horizontal bars for each row, one below the other for the series; the axis is logarithmic beyond
/// one. `mark` is a value with its name, drawn as a line on the side of each sign that has values.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn ranked(axis: &str, series: &[&str], rows: &[Row], mark: Option<(f64, &str)>) -> Result<String> {
    let height_of_row = BAR * series.len() as i32 + SPACE;
    let bottom = TOP + height_of_row * rows.len() as i32;
    let all = || rows.iter().flat_map(|r| r.values.iter().copied()).filter(|v| v.is_finite());
    let limit = mark.map_or(0.0, |m| bent(1.6 * m.0));
    let high = all().map(bent).fold(limit, f64::max).max(1.0);
    let signed = all().any(|v| v < 0.0);
    let low = if signed { all().map(bent).fold(-limit, f64::min) } else { 0.0 };
    let place =
        |v: f64| NAMES + ((bent(v) - low) / (high - low) * f64::from(WIDTH - NAMES - RIGHT)).round() as i32;
    let text = |size: i32| ("sans-serif", size).into_text_style(&(WIDTH as u32, 1_u32)).color(&GREY);
    let mut svg = String::new();
    {
        let root =
            SVGBackend::with_string(&mut svg, (WIDTH as u32, (bottom + BOTTOM) as u32)).into_drawing_area();
        let line = |x: i32, colour: RGBColor| {
            root.draw(&PathElement::new(vec![(x, TOP - 4), (x, bottom)], colour.stroke_width(1)))
                .map_err(failed)
        };
        let centred = text(13).pos(Pos::new(HPos::Center, VPos::Top));
        let steps = (0..9).flat_map(|k| [1.0, 2.0, 5.0].map(|m: f64| m * 10_f64.powi(k)));
        let mut ticks: Vec<f64> = steps.clone().map(|t| -t).chain([0.0]).chain(steps).collect();
        ticks.retain(|t| bent(*t) >= low && bent(*t) <= high);
        // Zero and powers of ten first, and others where there is room for them.
        let rank = |t: f64| if t == 0.0 { 0 } else { 1 + u8::from(t.abs().log10().fract() != 0.0) };
        ticks.sort_by_key(|t| rank(*t));
        let mut taken: Vec<i32> = Vec::new();
        for tick in ticks {
            let x = place(tick);
            if taken.iter().any(|t| (t - x).abs() < 44) {
                continue;
            }
            taken.push(x);
            line(x, if tick == 0.0 { GREY } else { LIGHT })?;
            let shown = if tick.abs() < 1e5 { format!("{tick}") } else { format!("{tick:e}") };
            root.draw(&Text::new(shown, (x, bottom + 4), centred.clone())).map_err(failed)?;
        }
        root.draw(&Text::new(axis.to_owned(), ((NAMES + WIDTH - RIGHT) / 2, bottom + 24), centred.clone()))
            .map_err(failed)?;
        for (i, row) in rows.iter().enumerate() {
            let top = TOP + height_of_row * i as i32 + SPACE / 2;
            let middle = top + BAR * series.len() as i32 / 2;
            let right = text(13).pos(Pos::new(HPos::Right, VPos::Center));
            root.draw(&Text::new(row.name.clone(), (NAMES - 8, middle), right)).map_err(failed)?;
            for (s, value) in row.values.iter().enumerate().filter(|v| v.1.is_finite()) {
                let y = top + BAR * s as i32;
                let ends = [place(0.0), place(*value)];
                let corners =
                    [(ends[0].min(ends[1]), y), (ends[0].max(ends[1]).max(ends[0] + 1), y + BAR - 1)];
                root.draw(&Rectangle::new(corners, COLOURS[s + 1].filled())).map_err(failed)?;
            }
        }
        if let Some((value, name)) = mark {
            let sides: &[f64] = if signed { &[-1.0, 1.0] } else { &[1.0] };
            for side in sides {
                line(place(side * value), BLACK)?;
            }
            let left = text(12).pos(Pos::new(HPos::Left, VPos::Top));
            root.draw(&Text::new(name.to_owned(), (place(value) + 4, 18), left)).map_err(failed)?;
        }
        let mut x = NAMES;
        for (s, name) in series.iter().enumerate() {
            root.draw(&Rectangle::new([(x, 4), (x + 12, 14)], COLOURS[s + 1].filled())).map_err(failed)?;
            root.draw(&Text::new((*name).to_owned(), (x + 17, 3), text(13))).map_err(failed)?;
            x += 34 + 8 * name.len() as i32;
        }
        root.present().map_err(failed)?;
    }
    Ok(svg)
}

const GREY: RGBColor = RGBColor(70, 70, 70);
const LIGHT: RGBColor = RGBColor(225, 225, 225);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longer_bar_belongs_to_the_larger_value() {
        let rows = [("small", 3.0), ("large", 3e4)].map(|(n, v)| Row { name: n.to_owned(), values: vec![v] });
        let svg = ranked("z", &["before"], &rows, Some((5.0, "limit"))).unwrap();
        let fill = "fill=\"#D55E00\"";
        let widths: Vec<i32> = svg
            .lines()
            .filter(|l| l.starts_with("<rect") && l.contains(fill))
            .filter_map(|l| l.split("width=\"").nth(1)?.split('"').next()?.parse().ok())
            .collect();
        // Two bars and the key.
        assert!(widths.len() == 3 && widths[1] > 4 * widths[0], "{widths:?}");
    }
}
