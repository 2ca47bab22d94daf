//! How many simulations a mean is made of.

use super::fit::Fit;

/// In a tournament.
const FEW_SIMULATIONS: usize = 2;

/// In its second leg, or where sets differ more than clean ones do.
pub(crate) const SOME_SIMULATIONS: usize = 6;

/// Where a fitted model is judged by itself.
pub(crate) const MEAN_SIMULATIONS: usize = 12;

/// Where the front is nearer than its draws tell apart.
pub(crate) const MOST_SIMULATIONS: usize = 24;

/// Logarithm of a noise's determinant over the null's from which on two simulations say little: as of ten statistics with twice the deviation.
const NOISY: f64 = 14.0;

impl Fit {
    /// Simulations of a mean in a tournament, and in its second leg. Beside lost readouts two of them raised a cost of 1,000 to 2,500, and
    /// the names were ranked by their draws.
    pub(crate) fn draws(&self) -> [usize; 2] {
        if self.is_noisy() {
            [SOME_SIMULATIONS, 2 * SOME_SIMULATIONS]
        } else {
            [FEW_SIMULATIONS, SOME_SIMULATIONS]
        }
    }

    pub(crate) fn is_noisy(&self) -> bool {
        self.noise_of_its_own() > NOISY
    }
}
