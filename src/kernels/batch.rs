//! The input of a kernel: the light of consecutive readouts, and the round keys of the draws at these readouts.

use std::ops::Range;

use crate::draws::hash::{CounterRng, RoundKey};
use crate::kernels::modulation::Modulation;
use crate::light::samples::Samples;
use crate::plan::{Plan, SimulatorState};

/// The light during consecutive readouts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SegmentLight<'a> {
    /// One frame that is the light of every readout.
    Hold(Samples<'a>),
    /// Light that is interpolated linearly between two frames.
    Linear {
        /// Frame at weight 0.
        from: Samples<'a>,
        /// Frame at weight 1.
        to: Samples<'a>,
        /// Weight of `to` at every readout of the segment.
        weights: &'a [f32],
    },
}

/// Consecutive readouts with one [`SegmentLight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment<'a> {
    /// Number of readouts.
    pub readouts: usize,
    /// Light of these readouts.
    pub light: SegmentLight<'a>,
}

/// The round keys of shot noise and threshold noise at one readout. Almost every plan with noise needs both round keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoiseRoundKeys {
    /// Round key of [`crate::plan::NoiseRngs::shot`].
    pub shot: RoundKey,
    /// Round key of [`crate::plan::NoiseRngs::thermal`].
    pub thermal: RoundKey,
}

/// The round keys of every readout of a batch. A vector is empty if the plan does not use it.
#[derive(Clone, Debug, Default)]
pub struct RoundKeys {
    /// Round keys of shot noise and threshold noise.
    pub noise: Vec<NoiseRoundKeys>,
    /// Round keys of [`crate::plan::NoiseRngs::counts`].
    pub counts: Vec<RoundKey>,
    /// Round keys of [`crate::plan::NoiseRngs::jitter`].
    pub jitter: Vec<RoundKey>,
    /// Round keys of [`crate::plan::NoiseRngs::missed_spikes`].
    pub missed_spikes: [Vec<RoundKey>; 2],
    /// Round keys of [`crate::plan::NoiseRngs::false_spikes`].
    pub false_spikes: [Vec<RoundKey>; 2],
}

/// Consecutive readouts with their light and round keys. All tiles of the sensor use the same batch.
#[derive(Clone, Debug)]
pub struct Batch<'a> {
    segments: Vec<(Range<usize>, SegmentLight<'a>)>,
    round_keys: RoundKeys,
    modulation: Modulation,
    readouts: usize,
}

impl<'a> Batch<'a> {
    /// Returns the batch of the readouts that follow `state`, under the light of `segments`.
    ///
    /// If pixels affect each other ([`Plan::has_coupled_pixels`]), a batch of more than one readout cannot be split
    /// into tiles. [`Job::new`] then requires a tile that covers the whole sensor.
    ///
    /// # Panics
    /// Panics if a frame has fewer samples than the plan has pixels. Also panics if the number of weights of a segment
    /// differs from the segment's number of readouts.
    #[must_use]
    pub fn from_state(plan: &Plan, state: &SimulatorState, segments: &'a [Segment<'a>]) -> Self {
        let mut batch = Self::build(plan, state.readout(), segments);
        batch.modulation.add_feedback(plan, state);
        batch
    }

    /// Returns the batch of the readouts that start at readout `first`, under the light of `segments`.
    ///
    /// # Panics
    /// Panics if a frame has fewer samples than the plan has pixels. Also panics if the number of weights of a segment
    /// differs from the segment's number of readouts, or if pixels affect each other. For plans whose pixels affect
    /// each other, use [`Batch::from_state`].
    #[must_use]
    pub fn new(plan: &Plan, first: u64, segments: &'a [Segment<'a>]) -> Self {
        assert!(!plan.has_coupled_pixels(), "pixels act on each other: use Batch::after");
        Self::build(plan, first, segments)
    }

    fn build(plan: &Plan, first: u64, segments: &'a [Segment<'a>]) -> Self {
        let pixels = plan.geometry().pixels();
        for segment in segments {
            let enough = match segment.light {
                SegmentLight::Hold(s) => s.len() >= pixels,
                SegmentLight::Linear { from, to, weights } => {
                    assert_eq!(weights.len(), segment.readouts, "one weight per readout");
                    from.len() >= pixels && to.len() >= pixels
                }
            };
            assert!(enough, "a frame has fewer samples than the sensor has pixels");
        }
        let readouts = segments.iter().map(|s| s.readouts).sum();
        let rounds = RoundKeys::new(plan, first, readouts);
        let mut end = 0;
        let placed = segments.iter().map(|s| {
            let begin = end;
            end += s.readouts;
            (begin..end, s.light)
        });
        let modulation = Modulation::new(plan, first, readouts);
        Self { segments: placed.collect(), round_keys: rounds, modulation, readouts }
    }

    /// Returns the number of readouts.
    #[must_use]
    pub fn readouts(&self) -> usize {
        self.readouts
    }

    /// Returns the round keys. Each vector has one element per readout.
    #[must_use]
    #[inline]
    pub fn round_keys(&self) -> &RoundKeys {
        &self.round_keys
    }

    /// Returns the values that differ between readouts.
    #[must_use]
    #[inline]
    pub fn modulation(&self) -> &Modulation {
        &self.modulation
    }

    /// Returns the segments. The range of a segment contains the indices of its readouts within the batch.
    #[must_use]
    #[inline]
    pub fn segments(&self) -> &[(Range<usize>, SegmentLight<'a>)] {
        &self.segments
    }
}

impl RoundKeys {
    fn new(plan: &Plan, first: u64, readouts: usize) -> Self {
        let rngs = plan.rngs();
        let words = |rng: CounterRng, wanted: bool| -> Vec<RoundKey> {
            let count = if wanted { readouts as u64 } else { 0 };
            (0..count).map(|t| rng.round_key(first.wrapping_add(t))).collect()
        };
        let flip = plan.rules().flip;
        let missed = flip.is_some_and(|f| f.missed_spikes != 0);
        let spurious = flip.is_some_and(|f| f.false_spikes != 0);
        let counted = plan.tables().shot.is_some();
        // The vector kernels read the round keys of shot noise and of threshold noise if the plan has noise, surplus,
        // extra rules or dynamics. In these plans, both vectors of round keys are filled.
        let rules = plan.rules();
        let drawn = counted || plan.tables().noise.is_some();
        let has_jitter = !plan.tables().jitter_width.is_empty();
        let noisy =
            drawn || has_jitter || rules.counts_surplus || rules.has_extras() || plan.dynamics().is_some();
        let shot = words(rngs.shot, noisy).into_iter();
        let thermal = words(rngs.thermal, noisy);
        Self {
            noise: shot.zip(thermal).map(|(shot, thermal)| NoiseRoundKeys { shot, thermal }).collect(),
            counts: words(rngs.counts, counted),
            jitter: words(rngs.jitter, has_jitter),
            missed_spikes: rngs.missed_spikes.map(|c| words(c, missed)),
            false_spikes: rngs.false_spikes.map(|c| words(c, spurious)),
        }
    }
}

/// One tile of a batch.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Tables and rules.
    pub plan: &'a Plan,
    /// Light and round keys.
    pub batch: &'a Batch<'a>,
    range: Range<usize>,
}

impl<'a> Job<'a> {
    /// Returns the job for the tile that starts at pixel `first` and has `pixels` pixels, including padding. A tile
    /// that extends beyond the last pixel of the plan is shortened.
    ///
    /// # Panics
    /// Panics if the bounds of the tile are not multiples of [`crate::plan::PIXEL_ALIGNMENT`]. Also panics if three
    /// conditions hold together: pixels affect each other, the tile is only a part of the sensor, and the batch has
    /// more than one readout.
    #[must_use]
    pub fn new(plan: &'a Plan, batch: &'a Batch<'a>, first: usize, pixels: usize) -> Self {
        let range = first..(first + pixels).min(plan.padded_pixels());
        assert!(
            range.start.is_multiple_of(crate::plan::PIXEL_ALIGNMENT)
                && range.len().is_multiple_of(crate::plan::PIXEL_ALIGNMENT)
        );
        let job = Self { plan, batch, range };
        let frame_by_frame = job.is_whole_sensor() || batch.readouts == 1;
        assert!(
            frame_by_frame || !plan.has_coupled_pixels(),
            "pixels act on each other: one tile, or one readout at a time"
        );
        job
    }

    /// Returns whether the tile is the whole sensor.
    #[must_use]
    #[inline]
    pub fn is_whole_sensor(&self) -> bool {
        self.range == (0..self.plan.padded_pixels())
    }

    /// Returns the padded pixels of the tile.
    #[must_use]
    #[inline]
    pub fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Returns the number of padded pixels.
    #[must_use]
    #[inline]
    pub fn pixels(&self) -> usize {
        self.range.len()
    }

    /// Returns the number of bytes that the bits of the tile occupy at one readout.
    #[must_use]
    #[inline]
    pub fn tile_bytes(&self) -> usize {
        self.range.len() / 8
    }
}
