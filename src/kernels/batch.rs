//! What a kernel is given: light for a run of readouts, and the words of their draws.

use std::ops::Range;

use crate::draws::hash::{Clock, Round};
use crate::kernels::modulation::Modulation;
use crate::plan::{Plan, State};

/// Linear light of one frame, row-major, top row first, one value per pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Samples<'a> {
    /// 255 is full scale.
    U8(&'a [u8]),
    /// 65535 is full scale.
    U16(&'a [u16]),
    /// 1.0 is full scale; finite and not negative.
    F32(&'a [f32]),
}

impl Samples<'_> {
    /// Number of pixels.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(s) => s.len(),
            Self::U16(s) => s.len(),
            Self::F32(s) => s.len(),
        }
    }

    /// Whether a sample can exceed full scale.
    pub(crate) fn unbounded(&self) -> bool {
        matches!(self, Self::F32(_))
    }

    /// Whether there is no pixel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Light during a run of readouts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light<'a> {
    /// The same frame at every readout.
    Held(Samples<'a>),
    /// A way from one frame to the next.
    Between {
        /// Frame at weight 0.
        from: Samples<'a>,
        /// Frame at weight 1.
        to: Samples<'a>,
        /// The weight of `to`, one for every readout of the segment.
        weights: &'a [f32],
    },
}

/// Readouts that share a [`Light`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment<'a> {
    /// Number of readouts.
    pub readouts: usize,
    /// Their light.
    pub light: Light<'a>,
}

/// One readout's hash words for the draws that nearly every noisy plan makes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoiseRound {
    /// Of [`crate::plan::Clocks::shot`].
    pub shot: Round,
    /// Of [`crate::plan::Clocks::thermal`].
    pub thermal: Round,
}

/// The hash words of every readout of a batch.
#[derive(Clone, Debug, Default)]
pub struct Rounds {
    /// Of the draws of light and of threshold.
    pub noise: Vec<NoiseRound>,
    /// Of [`crate::plan::Clocks::counts`].
    pub counts: Vec<Round>,
    /// Of [`crate::plan::Clocks::undecided`].
    pub undecided: Vec<Round>,
    /// Of [`crate::plan::Clocks::missed`].
    pub missed: [Vec<Round>; 2],
    /// Of [`crate::plan::Clocks::spurious`].
    pub spurious: [Vec<Round>; 2],
}

/// A run of readouts, the same for all tiles.
#[derive(Clone, Debug)]
pub struct Batch<'a> {
    segments: Vec<(Range<usize>, Light<'a>)>,
    rounds: Rounds,
    modulation: Modulation,
    readouts: usize,
}

impl<'a> Batch<'a> {
    /// The readouts that follow `state`, in the light of `segments`.
    ///
    /// Where pixels act on each other ([`Plan::couples`]), a batch of more than one readout runs as one
    /// tile: [`Job::new`] then wants the whole sensor.
    ///
    /// # Panics
    /// When a frame has fewer samples than the plan has pixels, or a segment
    /// has another number of weights than of readouts.
    #[must_use]
    pub fn after(plan: &Plan, state: &State, segments: &'a [Segment<'a>]) -> Self {
        let mut batch = Self::uncoupled(plan, state.readout(), segments);
        batch.modulation.couple(plan, state);
        batch
    }

    /// The readouts from `first` on, in the light of `segments`.
    ///
    /// # Panics
    /// When a frame has fewer samples than the plan has pixels, a segment
    /// has another number of weights than of readouts, or pixels act on each
    /// other, which [`Batch::after`] is for.
    #[must_use]
    pub fn new(plan: &Plan, first: u64, segments: &'a [Segment<'a>]) -> Self {
        assert!(!plan.couples(), "pixels act on each other: use Batch::after");
        Self::uncoupled(plan, first, segments)
    }

    fn uncoupled(plan: &Plan, first: u64, segments: &'a [Segment<'a>]) -> Self {
        let pixels = plan.geometry().pixels();
        for segment in segments {
            let enough = match segment.light {
                Light::Held(s) => s.len() >= pixels,
                Light::Between { from, to, weights } => {
                    assert_eq!(weights.len(), segment.readouts, "one weight per readout");
                    from.len() >= pixels && to.len() >= pixels
                }
            };
            assert!(enough, "a frame has fewer samples than the sensor has pixels");
        }
        let readouts = segments.iter().map(|s| s.readouts).sum();
        let rounds = Rounds::new(plan, first, readouts);
        let mut end = 0;
        let placed = segments.iter().map(|s| {
            let begin = end;
            end += s.readouts;
            (begin..end, s.light)
        });
        let modulation = Modulation::new(plan, first, readouts);
        Self { segments: placed.collect(), rounds, modulation, readouts }
    }

    /// Number of readouts.
    #[must_use]
    pub fn readouts(&self) -> usize {
        self.readouts
    }

    /// Hash words, one set per readout.
    #[must_use]
    #[inline]
    pub fn rounds(&self) -> &Rounds {
        &self.rounds
    }

    /// What moves.
    #[must_use]
    #[inline]
    pub fn modulation(&self) -> &Modulation {
        &self.modulation
    }

    /// The segments with the readouts of the batch that each covers.
    #[must_use]
    #[inline]
    pub fn segments(&self) -> &[(Range<usize>, Light<'a>)] {
        &self.segments
    }
}

impl Rounds {
    fn new(plan: &Plan, first: u64, readouts: usize) -> Self {
        let clocks = plan.clocks();
        let words = |clock: Clock, wanted: bool| -> Vec<Round> {
            let count = if wanted { readouts as u64 } else { 0 };
            (0..count).map(|t| clock.round(first.wrapping_add(t))).collect()
        };
        let flip = plan.rules().flip;
        let missed = flip.is_some_and(|f| f.missed != 0);
        let spurious = flip.is_some_and(|f| f.spurious != 0);
        let counted = plan.tables().shot.is_some();
        // The lanes walk along both, whatever the plan holds, as soon as it holds any noise or bends light.
        let rules = plan.rules();
        let drawn = counted || plan.tables().noise.is_some();
        let undecided = !plan.tables().undecided.is_empty();
        let noisy = drawn || undecided || rules.surplus || rules.extras() || plan.moving().is_some();
        let shot = words(clocks.shot, noisy).into_iter();
        let thermal = words(clocks.thermal, noisy);
        Self {
            noise: shot.zip(thermal).map(|(shot, thermal)| NoiseRound { shot, thermal }).collect(),
            counts: words(clocks.counts, counted),
            undecided: words(clocks.undecided, undecided),
            missed: clocks.missed.map(|c| words(c, missed)),
            spurious: clocks.spurious.map(|c| words(c, spurious)),
        }
    }
}

/// One tile of a batch.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Tables and rules.
    pub plan: &'a Plan,
    /// Light and words.
    pub batch: &'a Batch<'a>,
    range: Range<usize>,
}

impl<'a> Job<'a> {
    /// The tile of `pixels` padded pixels from `first` on, cut at the end of the plan.
    ///
    /// # Panics
    /// When the bounds are not multiples of [`crate::plan::LANES`], or pixels act on each other
    /// and the tile is a part of the sensor and the batch more than one readout.
    #[must_use]
    pub fn new(plan: &'a Plan, batch: &'a Batch<'a>, first: usize, pixels: usize) -> Self {
        let range = first..(first + pixels).min(plan.padded());
        assert!(
            range.start.is_multiple_of(crate::plan::LANES) && range.len().is_multiple_of(crate::plan::LANES)
        );
        let job = Self { plan, batch, range };
        let frame_by_frame = job.is_whole_sensor() || batch.readouts == 1;
        assert!(
            frame_by_frame || !plan.couples(),
            "pixels act on each other: one tile, or one readout at a time"
        );
        job
    }

    /// Whether the tile is all that there is.
    #[must_use]
    #[inline]
    pub fn is_whole_sensor(&self) -> bool {
        self.range == (0..self.plan.padded())
    }

    /// The padded pixels of the tile.
    #[must_use]
    #[inline]
    pub fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Number of padded pixels.
    #[must_use]
    #[inline]
    pub fn pixels(&self) -> usize {
        self.range.len()
    }

    /// Bytes of the tile's bits at one readout.
    #[must_use]
    #[inline]
    pub fn tile_bytes(&self) -> usize {
        self.range.len() / 8
    }
}
