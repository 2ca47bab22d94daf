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
        range.map(|[low, high]| ShadedBand { name: "simulated sensors", low: bent(low), high: bent(high) });
    let axes = ("log10 of the frequency in Hz", "log10 of the power");
    let plot = line_plot_over_band(place, axes, curves, band.as_ref())?;
    let what = "Power, divided by the power of as many independent spikes.";
    let model = if added { "the final model" } else { "the model" };
    let gray = format!(
        "{what} The gray band is the range of {FURTHER} simulated sensors of {model}. A recording of such a sensor lies outside the band at one frequency in eleven."
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
        let plot = bar_plot(&place, "interval, divided by the mean of the pixel", &all)?;
        parts.push(PageElement::figure(
            plot,
            "Lengths of intervals, each divided by the mean interval of its pixel.",
        ));
    }
    if let (Some(place), all) = curve(|p| &p.spectrum, logarithms) {
        parts.push(PageElement::heading("Spectrum of the number of spikes per readout"));
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
