//! Whether a scene stays as bright around a pixel.

use spikelane_measure::box_means;

/// Half side of the surroundings that decide.
pub(super) const RADIUS: usize = 5;

/// Pixels around which the spikes of both halves of a recording, averaged over 11x11 pixels, differ by no more than 0.27 and
/// 0.2 %. The halves of a static pixel differ by 0.6 spikes (two phases), the mean of 121 by 0.05: five of these, and 0.2 % for
/// a lamp.
pub fn steady(early: &[f64], late: &[f64], width: usize) -> Vec<bool> {
    let (early, late) = (box_means(early, width, RADIUS), box_means(late, width, RADIUS));
    early.iter().zip(&late).map(|(early, late)| (early - late).abs() <= 0.27 + 0.002 * early).collect()
}
