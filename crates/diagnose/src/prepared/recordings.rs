//! The first stage of a diagnosis. It measures the recordings and excludes those with faults.

use crate::faults::fault::Fault;
use crate::faults::fault_scan::scan_for_faults;
use crate::light::found_light::find_light;
use crate::light::lamp::sum_sources;
use crate::prepared::start_phases::{begun_over, in_step};
use crate::recordings::extent::{ReadoutSelection, RecordingPart};
use crate::recordings::setup::Setup;
use crate::statistics::measured_set::{MeasuredSet, measure, statistics_vector};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane_calibrate::RecordingSet;

/// A recording set, its protocol and its measured statistics.
pub(crate) struct PreparedSet {
    pub set: RecordingSet,
    pub setup: Setup,
    pub measured: MeasuredSet,
}

/// The recordings that test a fitted model without being fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HeldOut {
    /// A second recording set.
    SecondSet,
    /// The second half of every recording. The first halves are fitted.
    SecondHalves,
    /// No recordings. The fitted recordings are compared again.
    None,
}

impl HeldOut {
    /// Returns whether the test uses other recordings than the fitted ones.
    pub(crate) fn is_any(self) -> bool {
        self != Self::None
    }

    pub(crate) fn description(self) -> &'static str {
        match self {
            Self::SecondSet => "a second recording set",
            Self::SecondHalves => "the second half of every recording",
            Self::None => "none",
        }
    }

    /// Returns the parts of the fitted and of the held-out recordings.
    fn parts(self) -> [RecordingPart; 2] {
        match self {
            Self::SecondHalves => [RecordingPart::FirstHalf, RecordingPart::SecondHalf],
            Self::SecondSet | Self::None => [RecordingPart::Whole; 2],
        }
    }
}

/// The measured recordings of a diagnosis. Recordings with faults are excluded.
pub(crate) struct Recordings {
    pub fitted: PreparedSet,
    /// The held-out set, or the fitted set if nothing is held out.
    pub judging: PreparedSet,
    pub held_out: HeldOut,
    /// Recordings whose start was excluded because all pixels began together: file name, and number of excluded
    /// readouts.
    pub aside: Vec<(String, usize)>,
    /// Range of the charges at the first readout, in thresholds. `None` if the pixels did not begin together.
    pub begun_over: Option<f64>,
    /// Faults of lamps, scenes and files.
    pub faults: Vec<Fault>,
}

impl PreparedSet {
    /// Reads and measures a part of `set`. `aside` contains the number of readouts that are excluded at the start
    /// of each recording.
    pub(crate) fn new(
        set: &RecordingSet,
        part: RecordingPart,
        extent: ReadoutSelection,
        aside: &[usize],
    ) -> Result<Self> {
        let setup = Setup::behind(set, part, extent, aside)?;
        let measured = measure(&setup, set)?;
        Ok(Self { set: set.clone(), setup, measured })
    }

    /// Finds the light of the recordings: the light at which sensors of `camera` have the measured rates. Returns
    /// whether the light changed.
    pub(crate) fn find_light(&mut self, camera: &Camera, seed: u64) -> Result<bool> {
        let mut setup = self.setup.clone();
        let is_other = find_light(&mut setup, &self.measured.scans, camera, seed)?;
        if is_other {
            self.setup = setup;
            self.measured.values = statistics_vector(&self.setup, &self.measured.scans).values;
        }
        Ok(is_other)
    }

    /// Sets the light of recordings with sources to the sums of the sources.
    pub(crate) fn sum_sources(&mut self) {
        if sum_sources(&mut self.setup) {
            self.measured.values = statistics_vector(&self.setup, &self.measured.scans).values;
        }
    }

    /// Sets the light of this set to the light of the `fitted` set. If this set was recorded with other lamps, then
    /// finds its own light for sensors of `camera`.
    pub(crate) fn light_as(
        &mut self,
        fitted: &Setup,
        has_other_lamps: bool,
        camera: &Camera,
        seed: u64,
    ) -> Result<()> {
        let offsets = fitted.recordings.iter().map(|r| r.light_offset);
        self.setup.recordings.iter_mut().zip(offsets).for_each(|(r, offset)| r.light_offset = offset);
        if !self.setup.has_rate_maps {
            self.measured.values = statistics_vector(&self.setup, &self.measured.scans).values;
        }
        if has_other_lamps {
            self.find_light(camera, seed)?;
            self.sum_sources();
        }
        Ok(())
    }

    /// Returns the set without the recordings with the indices `dropped`.
    fn without(self, dropped: &[usize]) -> Self {
        let Self { mut set, setup, measured } = self;
        let kept = |k: &usize| !dropped.contains(k);
        let all = set.recordings.len();
        let pick = |k: usize| set.recordings[k].clone();
        let recordings = (0..all).filter(kept).map(pick).collect();
        set.recordings = recordings;
        let setup = setup.without(dropped);
        let mut located = measured.located;
        located.0 = located.0.into_iter().enumerate().filter(|(k, _)| kept(k)).map(|(_, p)| p).collect();
        let scans: Vec<_> =
            measured.scans.into_iter().enumerate().filter(|(k, _)| kept(k)).map(|(_, s)| s).collect();
        let values = statistics_vector(&setup, &scans).values;
        Self { set, setup, measured: MeasuredSet { scans, values, located } }
    }
}

impl Recordings {
    /// Reads and measures both sets without any check for faults.
    pub(crate) fn unchecked(
        sets: [&RecordingSet; 2],
        held_out: HeldOut,
        extent: ReadoutSelection,
        aside: &[usize],
    ) -> Result<Self> {
        let [first, second] = held_out.parts();
        Ok(Self {
            fitted: PreparedSet::new(sets[0], first, extent, aside)?,
            judging: PreparedSet::new(sets[1], second, extent, aside)?,
            held_out,
            aside: Vec::new(),
            begun_over: None,
            faults: Vec::new(),
        })
    }

    /// Reads and measures both sets. If pixels began together, excludes the readouts in which they still fire
    /// together. Also excludes recordings with faults.
    pub(crate) fn read(
        sets: [&RecordingSet; 2],
        held_out: HeldOut,
        extent: ReadoutSelection,
    ) -> Result<Self> {
        let mut read = Self::unchecked(sets, held_out, extent, &[])?;
        let begun_over = begun_over(&read.fitted.setup, &read.fitted.measured.scans);
        let mut aside = in_step(&read.fitted.setup, &read.fitted.measured.scans);
        // The second half of a recording starts where the first half ends, so its pixels did not begin together.
        if held_out != HeldOut::SecondHalves {
            let other = in_step(&read.judging.setup, &read.judging.measured.scans);
            aside = aside.iter().zip(&other).map(|(a, b)| *a.max(b)).collect();
        }
        if aside.iter().any(|n| *n > 0) {
            read = Self::unchecked(sets, held_out, extent, &aside)?;
        }
        let named = read.fitted.setup.recordings.iter().zip(&aside).map(|(s, n)| (s.file_name(), *n));
        read.aside = named.filter(|(_, n)| *n > 0).collect();
        read.begun_over = begun_over;
        Ok(read.without_faults())
    }

    /// Excludes the recordings that have a fault in at least one of both sets.
    fn without_faults(mut self) -> Self {
        let mut scan = scan_for_faults(&self.fitted.setup, &self.fitted.measured.scans);
        let have_equal_length = self.fitted.setup.recordings.len() == self.judging.setup.recordings.len();
        if self.held_out.is_any() && have_equal_length {
            let other = scan_for_faults(&self.judging.setup, &self.judging.measured.scans);
            let is_second_set = self.held_out == HeldOut::SecondSet;
            scan.and(other, if is_second_set { " of the held-out set" } else { " in the second half" });
        }
        for set in [&mut self.fitted, &mut self.judging] {
            set.setup.set_light_uncertainties(&scan.light_uncertainties);
        }
        let mut dropped = scan.dropped;
        dropped.sort_unstable();
        dropped.dedup();
        self.faults = scan.faults;
        if !dropped.is_empty() {
            self.fitted = self.fitted.without(&dropped);
            self.judging = self.judging.without(&dropped);
        }
        self
    }
}
