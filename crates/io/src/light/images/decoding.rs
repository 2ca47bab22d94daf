//! Limits and errors of the decoders of images.

use std::io;
use std::path::Path;

use image::{ImageError, Limits};
use spikelane::error::{Error, ErrorKind, Setting};
use spikelane::unstable::inputs;

/// What happens to a damaged image of which a part can be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DamagePolicy {
    /// Damage is an error.
    Reject,
    /// Damage is an error. The user can accept damage by a setting.
    RejectBySetting,
    /// The decoded part is used, and a note describes the damage.
    Accept,
}

impl DamagePolicy {
    /// Returns the remedy for a damaged image.
    pub(super) fn remedy(self) -> String {
        let copy = "copy or save the image again";
        if self == Self::Reject {
            return copy.to_owned();
        }
        format!("{copy}; to use the part that can be decoded, set {}", Setting("accept_damage"))
    }
}

/// Returns the memory limits of the decoder.
pub(super) fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(inputs::MAX_PICTURE_BYTES);
    limits
}

/// Returns the error of a file that cannot be decoded.
pub(super) fn decode_error(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(e)
            if !matches!(e.kind(), io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData) =>
        {
            Error::io(path.display(), e)
        }
        other => {
            let remedy = if matches!(other, ImageError::Unsupported(_)) {
                "save the image with 8-bit or 16-bit samples and another compression"
            } else {
                "open the image in a viewer to check whether the file is damaged"
            };
            Error::new(ErrorKind::Input, path.display())
                .found(other)
                .expected(
                    "a complete PNG, JPEG, TIFF, EXR, HDR, PFM, BMP, PNM, WEBP or FITS image of a supported type",
                )
                .remedy(remedy)
        }
    }
}
