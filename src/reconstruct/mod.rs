//! Pictures back from spikes.
//!
//! A stream tells how bright a pixel is in three ways: how many spikes fall into a
//! window ([`tfp`], steady but blurred by motion), how long the interval around a
//! moment is ([`tfi`], sharp but coarse), and how long a window's spikes
//! span ([`span`], as steady as the light, blurred like TFP). Rates are in spikes per
//! readout, so 1.0 is one nominal threshold per readout whatever the camera.

mod detail;
mod intervals;
mod quality;
mod span;
mod window;

pub use detail::{Detail, Reference, aligned_psnr, blurred, detail};
pub use intervals::isi_map;
pub use intervals::{Tfi, tfi, tfi_at};
pub use quality::{psnr, ssim};
pub use span::span;
pub use window::TfpSequence;
pub use window::tfp;

use crate::error::{Error, Kind, Result};
use crate::inputs;
use crate::spikes::Packed;

/// The most memory that a picture takes for each pixel, in bytes: distances to two spikes, of 8 bytes each, and a rate
/// of 4. Counting takes less.
const BYTES_PER_PIXEL: usize = 24;

fn check_readout(packed: Packed, readout: usize) -> Result<()> {
    if readout < packed.readouts() {
        let geometry = packed.geometry();
        return inputs::check_memory(
            format_args!("picture of {geometry} pixels"),
            BYTES_PER_PIXEL * geometry.pixels(),
        );
    }
    Err(Error::new(Kind::Usage, "readout to reconstruct at")
        .found(readout)
        .expected(format_args!("less than the stream's {} readouts", packed.readouts())))
}
