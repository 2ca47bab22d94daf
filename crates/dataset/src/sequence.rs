//! One sequence: its streams, images and labels, in a folder that appears when it is whole.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::asked::{ground_truth, scene_options};
use crate::from::located;
use crate::images::Keeper;
use crate::labels;
use crate::manifest::sequence_path;
use crate::truth::{self, Dimmed};
use crate::{DatasetOptions, Drive, Drives, Entry, Inputs, Record, Structure, Work};
use spikelane::error::{Error, Result};
use spikelane::unstable::inputs::InnerPath;
use spikelane_io::formats::Layout;
use spikelane_io::light::{self, Frame, Insertion, OwnedSamples, Pace, Source, Timeline};
use spikelane_io::simulate::{
    CameraFacts, LightFacts, Looks, Outcome, Run, Sidecar, StreamFacts, run_looking,
};
use spikelane_io::storage::{steps, trees};
use spikelane_measure::report::with_known;
use spikelane_scene::Scene;

/// Hears of readouts done, and may stop the work.
pub(super) type Watch<'a> = &'a mut dyn FnMut(u64, Option<u64>) -> Result<()>;

/// Folder that is removed unless it got its name.
struct Draft {
    hidden: PathBuf,
    kept: bool,
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.kept {
            let _ = fs::remove_dir_all(&self.hidden);
        }
    }
}

/// Makes the sequence of `entry`; returns its record, the record's digest, and its readouts.
pub(super) fn make(
    options: &DatasetOptions,
    entry: &Entry,
    watch: Watch<'_>,
) -> Result<(Record, String, u64)> {
    let options = &options.of_sequence(entry.id.as_str())?;
    let (output, draft) = (&options.output, InnerPath::from("sequences").join(entry.id.partial()));
    trees::remove(output, &draft)?;
    let hidden = trees::prepare(output, &draft)?;
    fs::create_dir(&hidden).map_err(|e| Error::io(hidden.display(), e))?;
    let mut draft = Draft { hidden, kept: false };
    let (about, readouts) = match &options.work {
        Work::Drives(drives) => drive(options, drives, entry, &draft.hidden, watch)?,
        Work::Inputs(inputs) => input(options, inputs, entry, &draft.hidden, watch)?,
    };
    let record = Record::of(&entry.id, about, &draft.hidden)?;
    let digest = record.write(&draft.hidden)?;
    trees::sync_tree(&draft.hidden)?;
    trees::remove(output, &sequence_path(&entry.id))?;
    let folder = trees::prepare(output, &sequence_path(&entry.id))?;
    steps::rename(&draft.hidden, &folder)?;
    draft.kept = true;
    steps::sync_folder(&output.join("sequences"))?;
    Ok((record, digest, readouts))
}

fn drive(
    options: &DatasetOptions,
    drives: &Drives,
    entry: &Entry,
    folder: &Path,
    watch: Watch<'_>,
) -> Result<(Value, u64)> {
    let rate = options.rate()?;
    let readouts = drives.readouts();
    let seed = entry.scene_seed.unwrap_or_else(|| options.seed_of_scene(entry.id.as_str()));
    let scene =
        Scene::random(seed, &scene_options(options, drives, options.chosen_light(entry.id.as_str()))?)?;
    let mut drive = Drive::new(scene, rate, readouts, drives.white_cd_m2, drives.samples, options.threads)?;
    if options.structure == Structure::SpikeZoo {
        let by = truth::exposure(options, &drive.light(readouts / 2)?);
        drive.expose(by);
    }
    let timeline = Timeline::per_frame(1, Insertion::Hold)?;
    let every = options.images.every.unwrap_or(u64::from(drives.readouts_per_image));
    let mut keeper = Keeper::new(options, Some(every), drives.npy, folder)?;
    let outcome = streams(options, entry, timeline, &mut drive, &mut keeper, &mut *watch)?;
    truth::write_both(options, &outcome.glance.frame, folder)?;
    let mut labelled = Vec::new();
    if drives.label_every > 0 {
        let wanted = labels::Wanted {
            every: drives.label_every as usize * drives.readouts_per_image as usize,
            kitti: drives.kitti,
            exr: drives.exr.then_some(drives.samples),
            threads: options.threads,
        };
        let at = folder.join("labels");
        let mut still = || watch(readouts, Some(readouts));
        labelled = labels::write_all(drive.scene(), drive.plan(), &wanted, &at, &mut still)?;
    }
    let plan = drive.plan();
    let about = json!({
        "kind": "drive", "scene_seed": seed, "lighting": drive.scene().lighting().name(),
        "white_cd_m2": drive.white_cd_m2(), "vehicles": drive.scene().vehicles(),
        "readouts": outcome.readouts, "readouts_per_image": drives.readouts_per_image,
        "image_readouts": "the number in the file's name", "clear_readout": readouts / 2,
        "clear_transfer": "srgb",
        "ground_truth": ground_truth(options.structure),
        "label_readouts": labelled, "max_px_per_readout": plan.max_px_per_readout,
        "too_fast": plan.too_fast(),
        "needed_readout_hz": plan.needed_hz(rate.hz()) as u64,
        "frames_beyond_greatest_light": outcome.too_bright,
    });
    Ok((with_images(about, &keeper), outcome.readouts))
}

fn with_images(about: Value, keeper: &Keeper) -> Value {
    with_known(about, [("images", keeper.facts().map(|f| json!(f)))])
}

fn input(
    options: &DatasetOptions,
    inputs: &Inputs,
    entry: &Entry,
    folder: &Path,
    watch: Watch<'_>,
) -> Result<(Value, u64)> {
    let name = entry.input.as_deref().unwrap_or_default();
    let mut how = light::InputOptions::of(&options.camera);
    (how.fit, how.transfer) = (inputs.fit, inputs.transfer);
    let path = located(inputs, Path::new(name))?;
    let open = || light::open(&path, &how);
    let mut source = open()?;
    let pace = Pace { readouts_per_frame: inputs.readouts_per_frame, source: None };
    let timeline = pace.timeline(&*source, options.rate()?, inputs.insertion)?;
    let by = input_exposure(options, &open, &timeline)?;
    let mut notes = source.notes();
    if let Some(stored) = source.stored() {
        let note = inputs.fit.note(stored, options.camera.sensor.geometry);
        notes.extend(note.map(|text| format!("{name}: {text}")));
    }
    let mut source = Dimmed { source: &mut *source, by, place: Some((&path, name)) };
    let mut keeper = Keeper::new(options, options.images.every, false, folder)?;
    let outcome = streams(options, entry, timeline.clone(), &mut source, &mut keeper, watch)?;
    let glance = &outcome.glance;
    let middle = outcome.readouts / 2;
    if glance.readout == middle {
        truth::write_both(options, &glance.frame, folder)?;
    } else if let Some(frame) = truth::middle(&open, &timeline, Some(outcome.readouts))? {
        truth::write_both(options, &Dimmed::frame(&frame, by)?, folder)?;
    }
    let about = json!({
        "kind": "input", "input": name, "frames": outcome.frames, "readouts": outcome.readouts,
        "readouts_per_frame": inputs.readouts_per_frame, "clear_readout": middle, "clear_transfer": "srgb",
        "ground_truth": ground_truth(options.structure), "light_scale": by,
        "frames_beyond_greatest_light": outcome.too_bright, "notes": notes,
    });
    Ok((with_images(about, &keeper), outcome.readouts))
}

/// The exposure of given light; only floats can be brighter than white, and only they are looked at twice.
fn input_exposure(
    options: &DatasetOptions,
    open: &dyn Fn() -> Result<Box<dyn Source>>,
    timeline: &Timeline,
) -> Result<f32> {
    let mut source = open()?;
    let mut first = Frame::dark(source.geometry());
    let floats = source.next_frame(&mut first)? && matches!(first.samples(), OwnedSamples::F32(_));
    drop(source);
    if options.structure != Structure::SpikeZoo || !floats {
        return Ok(1.0);
    }
    let middle = truth::middle(open, timeline, None)?;
    Ok(middle.map_or(1.0, |light| truth::exposure(options, &light)))
}

/// The noisy and the clean stream with their sidecar.
fn streams(
    options: &DatasetOptions,
    entry: &Entry,
    timeline: Timeline,
    source: &mut dyn Source,
    keeper: &mut Keeper,
    watch: Watch<'_>,
) -> Result<Outcome> {
    let (camera, seeds) = (truth::exposed(options), options.seeds(entry.id.as_str()));
    let folder = keeper.folder.clone();
    let mut job = Run::new(camera.clone(), seeds, timeline.clone());
    job.layout = Layout::Dat;
    job.threads = options.threads;
    let (noisy, clean) = (folder.join("stream.dat"), folder.join("stream.clean.dat"));
    let every = keeper.every;
    let mut keep = |readout: u64, light: &Frame| keeper.keep(readout, light);
    let looks = every.map(|every| Looks { every, keep: &mut keep });
    let outcome = run_looking(&job, source, &noisy, Some(&clean), looks, watch)?;
    let geometry = options.camera.sensor.geometry;
    let facts = |w| StreamFacts::new(w, geometry, outcome.readouts);
    let mut sidecar = Sidecar::new(geometry, job.layout, outcome.readouts, facts(&outcome.noisy));
    sidecar.readout_hz = Some(options.camera.sensor.readout_hz);
    sidecar.clean = outcome.clean.as_ref().map(facts);
    sidecar.seeds = Some(Sidecar::seed_facts(seeds));
    sidecar.camera = Some(CameraFacts::new(&camera)?);
    let electrons = camera.operating(0.0).electrons;
    sidecar.images = keeper.facts();
    sidecar.light = Some(LightFacts {
        insertion: timeline.insertion().to_string(),
        readouts_per_frame: timeline.readouts(1).map(|n| n.to_string()),
        frames: outcome.frames,
        exposure_electrons: electrons * camera.sensor.thresholds_at_full_scale,
        greatest_light: outcome.greatest_light,
        frames_beyond_greatest_light: outcome.too_bright,
        ..LightFacts::of(source)
    });
    sidecar.write(&folder.join("stream.json"), false)?;
    Ok(outcome)
}
