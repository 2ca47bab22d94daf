//! The cameras of a dataset.

use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::presets::{self, CameraDistribution};

/// The cameras that record the sequences of a dataset. All cameras have the geometry and the readout rate of the first
/// camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Cameras {
    /// The first camera records every sequence.
    #[default]
    Single,
    /// Each sequence is recorded by one camera of this list. The name of the sequence selects the camera.
    List(Vec<Camera>),
    /// Each sequence is recorded by its own camera. The camera is drawn from this distribution, and the name of the
    /// sequence determines the random numbers.
    Distribution(CameraDistribution),
}

impl Cameras {
    /// Returns an error if the geometry or the readout rate of a camera differs from that of the first camera.
    pub(super) fn check(&self, first: &Camera) -> Result<()> {
        let sensor = &first.sensor;
        let refused = |found: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Config, "cameras of the dataset")
                .found(found)
                .expected(format_args!(
                    "{} at {} Hz, as in the first camera",
                    sensor.geometry, sensor.readout_hz
                ))
                .remedy("use the same width, height and readout_rate for all cameras")
        };
        match self {
            Self::Single => Ok(()),
            Self::List(all) if all.is_empty() => Err(refused(&"none")),
            Self::List(all) => all.iter().try_for_each(|camera| {
                let other = &camera.sensor;
                if other.geometry == sensor.geometry && other.readout_hz == sensor.readout_hz {
                    return Ok(());
                }
                Err(refused(&format_args!("{}: {} at {} Hz", camera.name, other.geometry, other.readout_hz)))
            }),
            Self::Distribution(d) => match d.ranges().iter().find(|r| r.key == "sensor.readout_rate") {
                Some(range) => Err(refused(&format_args!("a range of {}", range.key))),
                None => Ok(()),
            },
        }
    }

    /// Returns the text of each camera of a list, or the text of a distribution. These texts are compared when a
    /// dataset is resumed.
    pub(super) fn extra_camera_texts(&self) -> Result<Option<Vec<String>>> {
        match self {
            Self::Single => Ok(None),
            Self::List(all) => {
                all.iter().map(|c| Ok(presets::to_toml(c)?.text)).collect::<Result<_>>().map(Some)
            }
            Self::Distribution(d) => Ok(Some(vec![d.text().to_owned()])),
        }
    }

    /// Returns the names of the cameras for display.
    pub(crate) fn display_names(&self, first: &Camera) -> String {
        match self {
            Self::Single => first.name.clone(),
            Self::List(all) => {
                let names: Vec<_> = all.iter().map(|c| c.name.as_str()).collect();
                names.join(", ") + ", selected by the name of the sequence"
            }
            Self::Distribution(_) => "drawn for every sequence".to_owned(),
        }
    }
}
