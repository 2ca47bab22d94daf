//! Horizontal bars with one row per quantity. Each value is beside its bar.

use std::fmt::Write as _;

use super::PageElement;
use super::rounding::without_error;
use super::text::EscapedText;

/// A row of the plot: the name of a quantity, and a value for each series.
#[derive(Clone, Debug)]
pub struct RankedRow {
    /// Label at the left.
    pub name: String,
    /// One value per series.
    pub values: Vec<f64>,
}

/// Bars are logarithmic if the largest value exceeds the mark, and 1, by more than this factor.
const LARGEST_LINEAR_RATIO: f64 = 30.0;

/// Returns the sign of `x` times `log10(1 + |x|)`, which is smooth at zero.
fn symmetric_log(x: f64) -> f64 {
    x.signum() * x.abs().ln_1p() / std::f64::consts::LN_10
}

/// Returns a figure with one row per quantity. A row contains one horizontal bar per series.
///
/// If values are far larger than the mark, the lengths are logarithmic for magnitudes above 1, and the legend states this.
/// Otherwise they are proportional to the values. `mark` is a magnitude and its label. A line is drawn at plus and at
/// minus this magnitude, if that side of zero contains values. `axis` is the quantity of the bars with its unit. Values
/// that are not finite are omitted.
#[must_use]
pub fn ranked_bars(
    title: &str,
    axis: &str,
    series: &[&str],
    rows: &[RankedRow],
    mark: Option<(f64, &str)>,
    caption: impl Into<String>,
) -> PageElement {
    let all = || rows.iter().flat_map(|r| r.values.iter().copied()).filter(|v| v.is_finite());
    let largest = all().map(f64::abs).fold(0.0, f64::max);
    let is_log = mark.is_some_and(|m| largest > LARGEST_LINEAR_RATIO * m.0.max(1.0));
    let scale = |v: f64| if is_log { symmetric_log(v) } else { v };
    let limit = mark.map_or(0.0, |m| scale(1.3 * m.0));
    let signed = all().any(|v| v < 0.0);
    let low = if signed { all().map(scale).fold(-limit, f64::min) } else { 0.0 };
    let high = match all().map(scale).fold(limit, f64::max) {
        high if high > low => high,
        _ => low + 1.0,
    };
    let place = |v: f64| 100.0 * (scale(v) - low) / (high - low);
    let mut html = String::new();
    let mut key = String::new();
    if series.len() > 1 {
        for (s, name) in series.iter().enumerate() {
            let _ =
                write!(key, "<li class=\"c{}\"><i></i>{}</li>", color(s, series.len()), EscapedText(name));
        }
    }
    if let Some((value, name)) = mark {
        let _ = write!(key, "<li><b></b>{}: {}</li>", EscapedText(name), without_error(value));
    }
    let words = if is_log { ", logarithmic" } else { "" };
    let _ = write!(key, "<li>bars: {}{words}</li>", EscapedText(axis));
    let _ = write!(html, "<ul class=\"legend\">{key}</ul><div class=\"bars\">");
    for row in rows {
        let _ = write!(html, "<div class=\"name\">{}</div><div class=\"tracks\">", EscapedText(&row.name));
        for (s, value) in row.values.iter().enumerate().filter(|v| v.1.is_finite()) {
            let (a, b) = (place(0.0).min(place(*value)), place(0.0).max(place(*value)));
            let _ = write!(
                html,
                "<div class=\"track c{}\"><i style=\"left:{a:.1}%;width:{:.1}%\"></i>",
                color(s, series.len()),
                (b - a).max(0.3)
            );
            if let Some((mark, _)) = mark {
                let sides: &[f64] = if signed { &[-1.0, 1.0] } else { &[1.0] };
                for side in sides {
                    let _ = write!(html, "<b style=\"left:{:.1}%\"></b>", place(side * mark));
                }
            }
            let _ = write!(html, "</div><div class=\"value\">{}</div>", without_error(rounded(*value)));
        }
        html += "</div>";
    }
    html += "</div>";
    PageElement::figure(title, html, caption)
}

/// Returns the number of the color of a series. The last of two series, such as the state after a change, has the main
/// color, as a single series has.
fn color(index: usize, count: usize) -> usize {
    if count == 2 { 1 - index } else { index }
}

/// Rounds a value for display: to integers above 100, otherwise to three significant digits.
fn rounded(value: f64) -> f64 {
    if value.abs() >= 100.0 {
        return value.round();
    }
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_a_value_has_half_of_the_bar() {
        let rows = [2.0, 4.0].map(|v| RankedRow { name: "n".to_owned(), values: vec![v] });
        let html = ranked_bars("t", "z", &["a"], &rows, Some((1.0, "limit")), "").to_string();
        assert!(html.contains("width:50.0%") && html.contains("width:100.0%"), "{html}");
        assert!(!html.contains("logarithmic"), "{html}");
    }

    #[test]
    fn the_longer_bar_belongs_to_the_larger_value() {
        let rows =
            [("small", 3.0), ("large", 3e4)].map(|(n, v)| RankedRow { name: n.to_owned(), values: vec![v] });
        let html = ranked_bars("t", "z", &["before"], &rows, Some((5.0, "limit")), "").to_string();
        let widths: Vec<f64> =
            html.split("width:").skip(1).filter_map(|part| part.split('%').next()?.parse().ok()).collect();
        assert!(widths.len() == 2 && widths[1] > 4.0 * widths[0], "{widths:?}");
        assert!(html.contains(", logarithmic"), "{html}");
    }

    #[test]
    fn a_negative_bar_ends_at_zero() {
        let rows = [RankedRow { name: "n".to_owned(), values: vec![-9.0, 9.0] }];
        let html = ranked_bars("t", "z", &["a", "b"], &rows, None, "").to_string();
        assert!(html.contains("left:0.0%;width:50.0%") && html.contains("left:50.0%;width:50.0%"), "{html}");
    }
}
