//! Reconstruction of images from spikes.
//!
//! A stream contains the brightness of a pixel in three forms:
//!
//! * the number of spikes in a window ([`tfp()`]) has low noise, but motion blurs the image;
//! * the length of the interval that contains a readout ([`tfi()`]) gives a sharp image with coarse values;
//! * the span from the first to the last spike of a window ([`span_rates()`]) is most accurate for steady light, but
//!   motion blurs the image.
//!
//! [`demosaic`] and [`ColorMatrix`] convert the rates of a color camera to a color image.
//!
//! Rates are in spikes per readout. For every camera, light of one nominal threshold per readout has the rate 1.0.

mod color;
mod detail;
mod quality;
mod span_rates;
mod tfi;
mod tfp;

pub use color::{ColorMatrix, Demosaic, ciede2000, demosaic, lab};
pub use detail::{DetailReference, DetailScores, aligned_psnr, gaussian_blur, score_detail};
pub use quality::{psnr, ssim};
pub use span_rates::span_rates;
pub use tfi::{Tfi, isi_map, tfi, tfi_with_open_pixels};
pub use tfp::{TfpSequence, tfp};

use crate::error::{Result, error};
use crate::inputs;
use crate::spikes::SpikeFramesRef;

/// Upper bound of the memory for an image, in bytes per pixel: two distances to spikes of 8 bytes each, and a rate of 4
/// bytes.
///
/// Counting spikes needs less memory.
const RATE_BYTES_PER_PIXEL: usize = 24;

fn check_readout(packed: SpikeFramesRef, readout: usize) -> Result<()> {
    if readout < packed.readouts() {
        let geometry = packed.geometry();
        return inputs::check_memory(
            format_args!("image of {geometry} pixels"),
            RATE_BYTES_PER_PIXEL * geometry.pixels(),
        );
    }
    Err(error!(Usage, "readout to reconstruct at"; found "{readout}";
        expected "less than {}, the number of readouts", packed.readouts()))
}
