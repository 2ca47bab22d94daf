//! The source of a stream's geometry, and the handling of missing frames.

use std::path::PathBuf;

use spikelane::unstable::named_variants;

/// How the reader handles frames that are missing in a recording.
///
/// # Examples
/// ```
/// use spikelane_io::formats::MissingFrames;
/// assert_eq!("drop".parse::<MissingFrames>()?, MissingFrames::Drop);
/// assert_eq!(MissingFrames::default(), MissingFrames::Mark);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum MissingFrames {
    /// An empty frame replaces each missing frame, so that the numbers and times of later frames do not change.
    #[default]
    Mark,
    /// Missing frames are removed, so that later frames have lower numbers.
    Drop,
}

named_variants!(MissingFrames, "missing frames" { Mark = "mark", Drop = "drop" });

/// The source from which the geometry of a stream was determined.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GeometryOrigin {
    /// The caller specified the geometry.
    Caller,
    /// A sidecar.
    Sidecar(PathBuf),
    /// The `config.yaml` of a data set.
    Dataset(PathBuf),
    /// The header of the file, or the shape of an array.
    Header,
    /// The camera that defines the layout.
    Camera,
}

impl std::fmt::Display for GeometryOrigin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Caller => f.write_str("as specified"),
            Self::Sidecar(path) | Self::Dataset(path) => write!(f, "from {}", path.display()),
            Self::Header => f.write_str("from the array's header"),
            Self::Camera => f.write_str("the camera's"),
        }
    }
}
