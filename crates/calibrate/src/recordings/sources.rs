//! Sources of light whose light adds up.
//!
//! A source is a lamp or an aperture. The light of a recording is the sum of the light of its sources. Recordings of
//! sources `A`, `B` and `A + B` therefore determine the response of a camera without any known light.

use std::collections::BTreeMap;

use super::recording_set::{DEFAULT_LIGHT_UNCERTAINTY, Recording, RecordingSet};
use spikelane::error::{Error, ErrorKind, Result};

/// Relative standard deviation of the light of the sources from one recording to another, if the set states none. It is
/// typical of a lamp with a stabilized current within some minutes.
pub const DEFAULT_SOURCE_REPEATABILITY: f64 = 1e-4;

/// Largest difference between the stated light of a recording and the light of its sources, in standard deviations of
/// the stated light. Correctly stated sets exceed it with a probability of 6e-7.
const MAX_SUM_DEVIATION: f64 = 5.0;

/// One source of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Name of the source.
    pub name: String,
    /// Stated light of the source alone.
    pub light: f64,
    /// Relative standard deviation of the stated light.
    pub uncertainty: f64,
}

/// The sources of a recording. The list is empty if the set states no sources for the recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    /// The sources, in the order of the set.
    pub sources: Vec<Source>,
    /// Relative standard deviation of the light of the recording, if the light of every source is known.
    pub repeatability: f64,
}

impl Sources {
    /// Returns the sum of the stated light of the sources.
    #[must_use]
    pub fn light(&self) -> f64 {
        self.sources.iter().map(|s| s.light).sum()
    }

    /// Returns the only source, or `None` if there are none or several.
    #[must_use]
    pub fn single(&self) -> Option<&Source> {
        match self.sources.as_slice() {
            [source] => Some(source),
            _ => None,
        }
    }

    /// Returns whether the recording has several sources.
    #[must_use]
    pub fn is_sum(&self) -> bool {
        self.sources.len() > 1
    }
}

impl RecordingSet {
    /// Returns the sources of `recording`. The set must have been checked.
    #[must_use]
    pub fn sources(&self, recording: &Recording) -> Sources {
        let alone = self.single_sources();
        let source = |name: &String| alone.get(name.as_str()).map(|r| self.source(name, r));
        Sources {
            sources: recording.sources.iter().filter_map(source).collect(),
            repeatability: self.source_repeatability.unwrap_or(DEFAULT_SOURCE_REPEATABILITY),
        }
    }

    fn source(&self, name: &str, alone: &Recording) -> Source {
        Source {
            name: name.to_owned(),
            light: alone.light.level().unwrap_or(0.0),
            uncertainty: self.uncertainty(alone),
        }
    }

    fn uncertainty(&self, recording: &Recording) -> f64 {
        recording.light_uncertainty.or(self.light_uncertainty).unwrap_or(DEFAULT_LIGHT_UNCERTAINTY)
    }

    /// Returns the recording of each source alone.
    fn single_sources(&self) -> BTreeMap<&str, &Recording> {
        let single = |r: &'_ Recording| r.sources.len() == 1;
        self.recordings.iter().filter(|r| single(r)).map(|r| (r.sources[0].as_str(), r)).collect()
    }

    /// Checks the sources of all recordings.
    pub(super) fn check_sources(&self) -> Result<()> {
        if let Some(r) = self.source_repeatability.filter(|r| !(*r > 0.0 && *r < 1.0)) {
            return Err(Error::new(ErrorKind::Config, "source_repeatability")
                .found(r)
                .expected("a relative standard deviation above 0 and below 1, such as 0.0001"));
        }
        let with_sources: Vec<&Recording> =
            self.recordings.iter().filter(|r| !r.sources.is_empty()).collect();
        let wrong = |r: &Recording| Error::new(ErrorKind::Config, format_args!("sources of {}", r.file));
        let mut alone: BTreeMap<&str, &Recording> = BTreeMap::new();
        for recording in &with_sources {
            match recording.light.level() {
                Some(light) if light > 0.0 => {}
                Some(_) => {
                    return Err(wrong(recording)
                        .found(format_args!("{} in the dark", recording.sources.join(", ")))
                        .expected("no sources at light 0"));
                }
                None => {
                    return Err(wrong(recording)
                        .found("light that is not uniform and constant")
                        .expected("sources of uniform, constant light"));
                }
            }
            let mut names: Vec<&String> = recording.sources.iter().collect();
            names.sort_unstable();
            if let Some(twice) = names.windows(2).find(|w| w[0] == w[1]) {
                return Err(wrong(recording)
                    .found(format_args!("{} twice", twice[0]))
                    .expected("each source once"));
            }
            if let [name] = recording.sources.as_slice()
                && let Some(first) = alone.insert(name, recording)
            {
                return Err(wrong(recording)
                    .found(format_args!("{name} alone, as in {}", first.file))
                    .expected("one recording of each source alone")
                    .remedy("give a source another name if its light changed, or put a repeated recording into another set"));
            }
        }
        let Some(any) = with_sources.first() else { return Ok(()) };
        if !self.levels().any(|(_, light)| light == 0.0) {
            return Err(wrong(any).found("no dark recording in the set").expected(
                "a recording of light 0, because the sum of two recordings contains the dark rate twice",
            ));
        }
        with_sources.iter().try_for_each(|r| self.check_sum(r, &alone))
    }

    fn check_sum(&self, recording: &Recording, alone: &BTreeMap<&str, &Recording>) -> Result<()> {
        let wrong = Error::new(ErrorKind::Config, format_args!("sources of {}", recording.file));
        if let Some(unknown) = recording.sources.iter().find(|name| !alone.contains_key(name.as_str())) {
            return Err(wrong
                .found(format_args!("{unknown}, which no recording has alone"))
                .expected("a recording of each source alone")
                .remedy("add this recording, or give sources that are always on together one name"));
        }
        let sources = self.sources(recording);
        let (stated, sum) = (recording.light.level().unwrap_or(0.0), sources.light());
        let variance: f64 = sources.sources.iter().map(|s| (s.light * s.uncertainty).powi(2)).sum();
        let sd = variance.sqrt().hypot(stated * self.uncertainty(recording));
        if (stated - sum).abs() <= MAX_SUM_DEVIATION * sd {
            return Ok(());
        }
        Err(wrong
            .found(format_args!(
                "light {stated}, and light {sum} of the sources {}",
                recording.sources.join(", ")
            ))
            .expected("the sum of the light of the sources")
            .remedy("correct the light or the sources, or state a larger light_uncertainty"))
    }
}
