//! The part of the report's page that shows the recordings beside the model.

use super::pictures::{FURTHER, NamedCurve, SetPlots};
use spikelane::error::Result;
use spikelane_measure::report::{Curve, PageElement, ShadedBand, bar_plot, heat_map, line_plot_over_band};

fn logarithms((x, y): &(f64, f64)) -> (f64, f64) {
    (x.log10(), y.max(1e-6).log10())
}

fn spectrum(
    place: &str,
    curves: &[Curve<'_>],
    pictures: &[(&'static str, SetPlots)],
    added: bool,
) -> Result<PageElement> {
    let range = pictures.iter().find_map(|(_, p)| p.spectrum_range.as_ref());
    let bent = |line: &Vec<(f64, f64)>| line.iter().map(logarithms).collect();
    let band =
        range.map(|[low, high]| ShadedBand { name: "further sensors", low: bent(low), high: bent(high) });
    let axes = ("log10 of the frequency in Hz", "log10 of the power");
    let plot = line_plot_over_band(place, axes, curves, band.as_ref())?;
    let what = "Power over that of as many independent spikes.";
    let model = if added { "the model after" } else { "the model" };
    let gray = format!(
        "{what} Gray is the range of {FURTHER} further sensors of {model}; at one frequency in eleven the recording of a sensor like them lies outside."
    );
    Ok(PageElement::figure(plot, if band.is_some() { gray } else { what.to_owned() }))
}

/// Beside each other: the recordings, the model before and the model after; where nothing was `added` the last two are one.
pub(in crate::diagnose) fn seen(
    pictures: &[(&'static str, SetPlots)],
    added: bool,
) -> Result<Vec<PageElement>> {
    let mut parts = Vec::new();
    let shown: Vec<(&'static str, &SetPlots)> = match pictures {
        [recordings, before, _] if !added => vec![(recordings.0, &recordings.1), ("model", &before.1)],
        all => all.iter().map(|(name, p)| (*name, p)).collect(),
    };
    let curve = |of: fn(&SetPlots) -> &Option<NamedCurve>, bend: fn(&(f64, f64)) -> (f64, f64)| {
        let all: Vec<Curve<'_>> = shown
            .iter()
            .filter_map(|(name, p)| {
                Some(Curve { name, points: of(p).as_ref()?.1.iter().map(bend).collect() })
            })
            .collect();
        let place = pictures.iter().find_map(|(_, p)| Some(of(p).as_ref()?.0.clone()));
        (place, all)
    };
    if let (Some(place), all) = curve(|p| &p.intervals, |p| *p) {
        parts.push(PageElement::heading("Intervals"));
        let plot = bar_plot(&place, "interval over the pixel's mean", &all)?;
        parts.push(PageElement::figure(
            plot,
            "How long intervals are, each in units of its own pixel's mean.",
        ));
    }
    if let (Some(place), all) = curve(|p| &p.spectrum, logarithms) {
        parts.push(PageElement::heading("Spectrum of the readouts' totals"));
        parts.push(spectrum(&place, &all, pictures, added)?);
    }
    for (place, what) in ["gain", "dark current"].into_iter().enumerate() {
        let maps: Vec<_> = shown.iter().filter_map(|(n, p)| Some((n, &p.maps.as_ref()?[place]))).collect();
        if maps.is_empty() {
            continue;
        }
        parts.push(PageElement::heading(&format!("Map of the {what}")));
        for (name, map) in maps {
            let width = pictures.iter().find_map(|p| p.1.width).unwrap_or(1);
            parts.push(PageElement::figure(
                heat_map(map, width, &format!("{what}, {name}"))?,
                format!("{what}: {name}"),
            ));
        }
    }
    Ok(parts)
}
