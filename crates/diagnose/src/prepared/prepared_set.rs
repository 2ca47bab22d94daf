//! A set as it is judged: what was looked at, and what was set aside.

use crate::lab::fault::Fault;
use crate::lab::fault_scan::scan_for_faults;
use crate::null_model::reference::NullModel;
use crate::prepared::found_light::find_light;
use crate::prepared::phases::{begun_over, in_step};
use crate::protocol::extent::{ReadoutSelection, RecordingPart};
use crate::protocol::recorded_set::Setup;
use crate::sensors::lamp::sum_sources;
use crate::statistics::vector::statistics_vector;
use crate::statistics::vector::{MeasuredSet, measure};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane_calibrate::RecordingSet;

/// A set that was read and measured.
pub(crate) struct PreparedSet {
    pub set: RecordingSet,
    pub setup: Setup,
    pub measured: MeasuredSet,
}

/// The set that is fitted and the one that judges: another take, another part of the same one, or the same once more.
pub(crate) struct DataSplit {
    pub fitted: PreparedSet,
    pub judging: PreparedSet,
    /// Readouts at the start of each recording that were set aside, as pixels began together.
    pub aside: Vec<(String, usize)>,
    /// The share of a threshold over which charges lay at the first readout, where pixels began together.
    pub begun_over: Option<f64>,
    /// What is wrong in the laboratory.
    pub faults: Vec<Fault>,
}

impl PreparedSet {
    /// Reads and measures a part of `set`.
    pub(crate) fn of(
        set: &RecordingSet,
        part: RecordingPart,
        extent: ReadoutSelection,
        aside: &[usize],
    ) -> Result<Self> {
        let setup = Setup::behind(set, part, extent, aside)?;
        let measured = measure(&setup, set)?;
        Ok(Self { set: set.clone(), setup, measured })
    }

    /// Takes the light that the rates show for a sensor of `camera`, if it is another light. Returns whether it is.
    pub(crate) fn find_light(&mut self, camera: &Camera, seed: u64) -> Result<bool> {
        let mut setup = self.setup.clone();
        let is_other = find_light(&mut setup, &self.measured.scans, camera, seed)?;
        if is_other {
            self.setup = setup;
            self.measured.values = statistics_vector(&self.setup, &self.measured.scans).values;
        }
        Ok(is_other)
    }

    /// Takes the light of recordings with sources as the sums of the sources.
    pub(crate) fn sum_sources(&mut self) {
        if sum_sources(&mut self.setup) {
            self.measured.values = statistics_vector(&self.setup, &self.measured.scans).values;
        }
    }

    /// With the light of the set of `reference`; with its own light if it `is_other` and the light differs.
    pub(crate) fn light_as(&mut self, reference: &NullModel, is_other: bool) -> Result<()> {
        let fitted = &reference.setup.recordings;
        let offsets = fitted.iter().map(|r| r.light_offset);
        self.setup.recordings.iter_mut().zip(offsets).for_each(|(r, offset)| r.light_offset = offset);
        if !self.setup.has_rate_maps {
            self.measured.values = statistics_vector(&self.setup, &self.measured.scans).values;
        }
        if is_other {
            self.find_light(&reference.model.camera, reference.seed)?;
            self.sum_sources();
        }
        Ok(())
    }

    /// Without some of its recordings.
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

impl DataSplit {
    /// Reads both sets. What pixels that began together do is set aside, and so are recordings that are at fault.
    pub(crate) fn read(
        sets: [&RecordingSet; 2],
        parts: [RecordingPart; 2],
        extent: ReadoutSelection,
    ) -> Result<Self> {
        let read = |aside: &[usize]| -> Result<[PreparedSet; 2]> {
            Ok([
                PreparedSet::of(sets[0], parts[0], extent, aside)?,
                PreparedSet::of(sets[1], parts[1], extent, aside)?,
            ])
        };
        let mut taken = read(&[])?;
        // The second halves of recordings begin where the first ones end.
        let over = begun_over(&taken[0].setup, &taken[0].measured.scans);
        let begins: &[usize] = if parts[1] == RecordingPart::SecondHalf { &[0] } else { &[0, 1] };
        let aside = begins.iter().map(|i| in_step(&taken[*i].setup, &taken[*i].measured.scans));
        let aside =
            aside.reduce(|a, b| a.iter().zip(&b).map(|(a, b)| *a.max(b)).collect()).unwrap_or_default();
        if aside.iter().any(|n| *n > 0) {
            taken = read(&aside)?;
        }
        let named = taken[0].setup.recordings.iter().zip(&aside).map(|(s, n)| (s.file_name(), *n));
        let aside = named.filter(|(_, n)| *n > 0).collect();
        let [fitted, judging] = taken;
        Ok(Self { fitted, judging, aside, begun_over: over, faults: Vec::new() }.sorted(sets, parts))
    }

    /// Without recordings that are at fault in either set.
    fn sorted(mut self, sets: [&RecordingSet; 2], parts: [RecordingPart; 2]) -> Self {
        let other = parts[0] != parts[1] || !std::ptr::eq(sets[0], sets[1]);
        let mut seen = scan_for_faults(&self.fitted.setup, &self.fitted.measured.scans);
        if other && self.fitted.setup.recordings.len() == self.judging.setup.recordings.len() {
            let more = scan_for_faults(&self.judging.setup, &self.judging.measured.scans);
            let place = if parts[0] == parts[1] { " of the held-out set" } else { " in the second half" };
            seen.and(more, place);
        }
        for taken in [&mut self.fitted, &mut self.judging] {
            taken.setup.set_light_uncertainties(&seen.light_uncertainties);
        }
        let mut dropped: Vec<usize> = seen.dropped;
        dropped.sort_unstable();
        dropped.dedup();
        self.faults = seen.faults;
        if !dropped.is_empty() {
            self.fitted = self.fitted.without(&dropped);
            self.judging = self.judging.without(&dropped);
        }
        self
    }
}
