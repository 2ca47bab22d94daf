//! Where a stream's size was found, and what stands for its lost readouts.

use std::path::PathBuf;

use spikelane::error::{Error, Kind};

/// What stands for readouts that a recording lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Lost {
    /// An empty readout, so that those behind keep their numbers and times.
    #[default]
    Mark,
    /// Nothing: those behind move up.
    Drop,
}

impl std::str::FromStr for Lost {
    type Err = Error;

    /// `mark` or `drop`.
    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "mark" => Ok(Self::Mark),
            "drop" => Ok(Self::Drop),
            _ => Err(Error::new(Kind::Usage, "lost readouts")
                .found(format_args!("`{text}`"))
                .expected("mark or drop")),
        }
    }
}

/// Where the size of a stream's frames was found.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origin {
    /// The caller gave it.
    Given,
    /// A sidecar.
    Sidecar(PathBuf),
    /// The `config.yaml` of a data set.
    DataSet(PathBuf),
    /// The header of an array, or its shape.
    Header,
    /// The camera whose rows the layout has.
    Camera,
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given => f.write_str("as given"),
            Self::Sidecar(path) | Self::DataSet(path) => write!(f, "from {}", path.display()),
            Self::Header => f.write_str("from the array's header"),
            Self::Camera => f.write_str("the camera's"),
        }
    }
}
