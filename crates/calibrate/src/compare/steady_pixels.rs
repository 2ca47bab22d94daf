//! Selects the pixels around which the brightness of the scene is constant.

use spikelane_measure::box_means;

/// Distance in pixels from the center of the averaged square to each side.
pub(super) const SURROUNDING_RADIUS_PX: usize = 5;

/// Returns, for each pixel, whether the spike counts of both halves of a recording agree in the mean over 11x11 pixels.
///
/// `early` and `late` are the spike counts of each pixel in the first and second half. `width` is the number of pixels
/// per row. The tolerance is 0.27 spikes plus 0.2 % of the count. The counts of a static pixel differ by 0.6 spikes
/// between the halves, because of two random phases. The mean over 121 pixels differs by 0.05 spikes. The tolerance is
/// five times 0.05 spikes, plus 0.2 % for changes of a lamp.
pub fn steady_pixels(early: &[f64], late: &[f64], width: usize) -> Vec<bool> {
    let (early, late) =
        (box_means(early, width, SURROUNDING_RADIUS_PX), box_means(late, width, SURROUNDING_RADIUS_PX));
    early.iter().zip(&late).map(|(early, late)| (early - late).abs() <= 0.27 + 0.002 * early).collect()
}
