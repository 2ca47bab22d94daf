//! The cameras that take a dataset.

use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::presets::{self, Distribution};

/// The cameras of a dataset; all have the size and the readout rate of its first one.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Cameras {
    /// The first one takes every sequence.
    #[default]
    One,
    /// One of these, by the sequence's name.
    Several(Vec<Camera>),
    /// One drawn for every sequence, by its name.
    Drawn(Distribution),
}

impl Cameras {
    /// Refuses cameras of other sizes or rates than the first one's: a dataset has one of each.
    pub(super) fn check(&self, first: &Camera) -> Result<()> {
        let sensor = &first.sensor;
        let refused = |found: &dyn std::fmt::Display| {
            Error::new(Kind::Config, "cameras of the dataset")
                .found(found)
                .expected(format_args!("{} at {} Hz, as the first one", sensor.geometry, sensor.readout_hz))
                .remedy("give each the same width, height and readout_rate")
        };
        match self {
            Self::One => Ok(()),
            Self::Several(all) if all.is_empty() => Err(refused(&"none")),
            Self::Several(all) => all.iter().try_for_each(|camera| {
                let own = &camera.sensor;
                if own.geometry == sensor.geometry && own.readout_hz == sensor.readout_hz {
                    return Ok(());
                }
                Err(refused(&format_args!("{}: {} at {} Hz", camera.name, own.geometry, own.readout_hz)))
            }),
            Self::Drawn(d) => match d.ranges().iter().find(|r| r.key == "sensor.readout_rate") {
                Some(range) => Err(refused(&format_args!("a range of {}", range.key))),
                None => Ok(()),
            },
        }
    }

    /// The cameras beyond the first, as text, for those who compare datasets.
    pub(super) fn texts(&self) -> Result<Option<Vec<String>>> {
        match self {
            Self::One => Ok(None),
            Self::Several(all) => {
                all.iter().map(|c| Ok(presets::to_toml(c)?.text)).collect::<Result<_>>().map(Some)
            }
            Self::Drawn(d) => Ok(Some(vec![d.text().to_owned()])),
        }
    }

    /// The cameras' names, for people.
    pub(crate) fn names(&self, first: &Camera) -> String {
        match self {
            Self::One => first.name.clone(),
            Self::Several(all) => {
                let names: Vec<_> = all.iter().map(|c| c.name.as_str()).collect();
                names.join(", ") + ", by the sequence's name"
            }
            Self::Drawn(_) => "drawn for every sequence".to_owned(),
        }
    }
}
