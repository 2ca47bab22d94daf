//! The whole dataset: plan, make what is not done, set aside what fails.

use std::fs;

use crate::dataset::manifest;
use crate::dataset::{
    DatasetOptions, Entry, Estimate, Manifest, Record, Status, Work, card, from, inputs, sequence, structure,
};
use crate::error::{Error, Kind, Result};
use crate::formats::Layout;
use crate::light::READOUTS_PER_FRAME;
use crate::storage;

/// How far a dataset is.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Progress<'a> {
    /// Index of the sequence.
    pub index: usize,
    /// All sequences.
    pub of: usize,
    /// Its name.
    pub id: &'a str,
    /// Readouts of it that are done.
    pub readouts: u64,
    /// Its readouts, if known.
    pub total: Option<u64>,
    /// Whether a finished sequence is being verified.
    pub verifying: bool,
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Sequences made.
    pub made: usize,
    /// Sequences that were there and verified.
    pub verified: usize,
    /// Sequences set aside.
    pub failed: usize,
    /// Inputs that were set aside, and why.
    pub set_aside: Vec<(String, String)>,
    /// Scenes made whose picture moves by more than half a pixel from one readout to the next.
    pub too_fast: usize,
    /// Readouts a second at which none of them would; 0 when none does.
    pub needed_readout_hz: u64,
    /// What the user should know of the inputs of sequences made, one line each.
    pub notes: Vec<String>,
}

/// What the dataset will take, without writing anything; on resume, what is left of it.
///
/// # Errors
/// As [`DatasetOptions::check`], and when inputs cannot be listed or the manifest differs.
pub fn estimate(options: &DatasetOptions) -> Result<Estimate> {
    let manifest = plan(options)?;
    let mut sum = Estimate::default();
    for entry in manifest.entries.iter().filter(|e| e.status != Status::Done) {
        sum.sequences += 1;
        sum.readouts += entry.readouts.unwrap_or(0);
        sum.bytes += expected_bytes(options, entry.readouts)?.unwrap_or(0);
        sum.unknown += usize::from(entry.readouts.is_none());
    }
    Ok(sum)
}

/// Bytes of a sequence: streams exactly, pictures and labels by rule of thumb.
fn expected_bytes(options: &DatasetOptions, readouts: Option<u64>) -> Result<Option<u64>> {
    let Some(readouts) = readouts else { return Ok(None) };
    let geometry = options.camera.sensor.geometry;
    let streams = 2 * Layout::Dat.file_bytes(geometry, readouts)?;
    let pixels = geometry.pixels() as u64;
    let kept = options.images.form.bytes_per_pixel();
    let rest = match &options.work {
        Work::Drives(d) => {
            let every = options.images.every.unwrap_or(u64::from(d.readouts_per_image)).max(1);
            let images = readouts.div_ceil(every);
            // A grey PNG of a street takes about two thirds of a byte per pixel; a labelled image 9
            // bytes of maps, and twice 9 bytes of flow with its mask.
            let picture = pixels * kept * 2 / 3 + if d.npy { 4 * pixels } else { 0 };
            let labelled = u64::from(d.images).checked_div(u64::from(d.label_every)).map_or(0, |n| n + 1);
            // KITTI's pictures: depth and twice flow; EXR: three floats.
            let label = 27 + if d.kitti { 8 } else { 0 } + if d.exr { 12 } else { 0 };
            images * picture + labelled * label * pixels
        }
        Work::Inputs(_) => {
            2 * pixels + options.images.every.map_or(0, |n| readouts.div_ceil(n.max(1)) * pixels * kept)
        }
    };
    Ok(Some(streams + rest))
}

/// The manifest as it stands, or as it will begin; new inputs are added to an old one.
fn plan(options: &DatasetOptions) -> Result<Manifest> {
    options.check()?;
    let facts = options.facts()?;
    let begun = options.output.join(manifest::NAME).exists();
    if begun && !options.resume {
        return Err(Error::new(Kind::Exists, options.output.display())
            .found("a dataset")
            .expected("a free folder")
            .remedy("go on with it (--resume), or choose another folder"));
    }
    let mut entries = entries(options)?;
    if begun {
        let old = Manifest::read(&options.output)?;
        old.same_options(&facts, &options.output)?;
        let mut known: std::collections::BTreeMap<_, _> =
            old.entries.into_iter().map(|e| (e.id.clone(), e)).collect();
        for entry in &mut entries {
            if let Some(old) = known.remove(&entry.id).filter(|e| e.status == Status::Done) {
                *entry = old;
            }
        }
        // Finished sequences whose input is gone stay.
        entries.extend(known.into_values().filter(|e| e.status == Status::Done));
    }
    Ok(Manifest { options: facts, entries })
}

fn entries(options: &DatasetOptions) -> Result<Vec<Entry>> {
    let new = |id: String, input: Option<String>, readouts: Option<u64>| -> Result<Entry> {
        let seeds = options.seeds(&id);
        let scene = matches!(options.work, Work::Drives(_)).then(|| options.seed_of_scene(&id));
        Ok(Entry {
            scene_seed: scene,
            seeds: [seeds.camera, seeds.shot, seeds.sequence],
            bytes: expected_bytes(options, readouts)?,
            input,
            readouts,
            id,
            ..Entry::default()
        })
    };
    let all: Result<Vec<Entry>> = match &options.work {
        Work::Drives(d) => {
            (0..d.sequences).map(|i| new(format!("scene-{i:04}"), None, Some(d.readouts()))).collect()
        }
        Work::Inputs(i) => inputs(&i.folder, &options.output)?
            .into_iter()
            .map(|found| {
                let each = i.readouts_per_frame.unwrap_or(READOUTS_PER_FRAME);
                let readouts = found.frames.map(|n| n.saturating_mul(each));
                new(found.id, Some(found.path.to_string_lossy().into_owned()), readouts)
            })
            .collect(),
    };
    let mut all = all?;
    let ids: Vec<_> = all.iter().map(|e| e.id.clone()).collect();
    for (entry, test) in all.iter_mut().zip(options.tests(&ids)) {
        if test { "test" } else { "train" }.clone_into(&mut entry.split);
    }
    Ok(all)
}

/// Makes the dataset, or what is missing of it; `watch` hears of every batch, and its error
/// stops the work, which leaves finished sequences and nothing half-written.
///
/// A sequence that fails by its own input is set aside with the reason; a full disk, a refusing
/// system or a request to stop ends everything.
///
/// # Errors
/// See above, and as [`estimate`]; [`Kind::Space`] before the start when the estimate does not fit.
pub fn make(options: &DatasetOptions, watch: &mut dyn FnMut(Progress<'_>) -> Result<()>) -> Result<Report> {
    let mut manifest = plan(options)?;
    let needed = estimate(options)?.bytes;
    let free = storage::free_space(&options.output)?;
    if needed > free {
        return Err(Error::new(Kind::Space, options.output.display())
            .found(format_args!("{free} bytes free"))
            .expected(format_args!("about {needed}"))
            .remedy("make fewer sequences, or choose another disk"));
    }
    let sequences = options.output.join("sequences");
    fs::create_dir_all(&sequences).map_err(|e| Error::io(sequences.display(), e))?;
    manifest.write(&options.output)?;
    structure::config(options)?;
    let mut report = Report::default();
    let of = manifest.entries.len();
    for index in 0..of {
        let entry = manifest.entries[index].clone();
        let at =
            |readouts, total, verifying| Progress { index, of, id: &entry.id, readouts, total, verifying };
        if entry.status == Status::Done {
            watch(at(0, entry.readouts, true))?;
            if verified(options, &entry) && input_digest(options, &entry)? == entry.input_digest {
                structure::place(options, &entry)?;
                report.verified += 1;
                continue;
            }
        }
        structure::displace(options, &entry.id);
        // Taken before it is read: a change meanwhile is then seen by the next --resume.
        let read = input_digest(options, &entry);
        let made = sequence::make(options, &entry, &mut |done, total| watch(at(done, total, false)));
        manifest.entries[index] = settle(entry, made, &mut report)?;
        manifest.entries[index].input_digest = read.unwrap_or(None);
        if manifest.entries[index].status == Status::Done {
            structure::place(options, &manifest.entries[index])?;
        } else {
            // A former attempt may have left a folder whose digests no longer hold.
            let old = sequences.join(&manifest.entries[index].id);
            sequence::remove(&old)?;
        }
        manifest.write(&options.output)?;
    }
    card::write(options, &manifest)?;
    Ok(report)
}

/// Digest of the input as it is now; none for scenes, and for an input that is gone.
fn input_digest(options: &DatasetOptions, entry: &Entry) -> Result<Option<String>> {
    let (Work::Inputs(inputs), Some(name)) = (&options.work, &entry.input) else { return Ok(None) };
    let path = inputs.folder.join(name);
    if !path.exists() {
        // Nothing is left to make it from, so what was made stays.
        return Ok(entry.input_digest.clone());
    }
    from::digest(&path).map(Some)
}

fn verified(options: &DatasetOptions, entry: &Entry) -> bool {
    let folder = options.output.join("sequences").join(&entry.id);
    entry.digest.as_deref().is_some_and(|digest| Record::verify(&folder, digest).is_ok())
}

/// The entry after an attempt; an error that would strike the next sequence too is passed on.
fn settle(mut entry: Entry, made: Result<(Record, String, u64)>, report: &mut Report) -> Result<Entry> {
    match made {
        Ok((record, digest, readouts)) => {
            entry.status = Status::Done;
            (entry.bytes, entry.digest, entry.readouts) =
                (Some(record.bytes()), Some(digest), Some(readouts));
            entry.reason = None;
            report.made += 1;
            let notes = record.about["notes"].as_array().into_iter().flatten();
            report.notes.extend(notes.filter_map(|n| n.as_str().map(str::to_owned)));
            if record.about["too_fast"] == true {
                let needed = record.about["needed_readout_hz"].as_u64().unwrap_or(0);
                report.too_fast += 1;
                report.needed_readout_hz = report.needed_readout_hz.max(needed);
            }
        }
        // A file that cannot be read is the input's fault; scenes have no input.
        Err(e)
            if entry.input.is_some()
                && matches!(e.kind(), Kind::Input | Kind::Usage | Kind::Tool | Kind::Io) =>
        {
            entry.status = Status::Failed;
            entry.digest = None;
            entry.reason = Some(e.to_string());
            report.failed += 1;
            report.set_aside.push((entry.input.clone().unwrap_or_default(), e.to_string()));
        }
        Err(e) if e.kind() == Kind::Space => {
            return Err(e.remedy("free some space, then go on with --resume; finished sequences are kept"));
        }
        Err(e) => return Err(e),
    }
    Ok(entry)
}
