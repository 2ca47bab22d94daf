//! Generates one sequence with its streams, images and labels. The folder has its final name only when the sequence is
//! complete.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::discover::input_path;
use crate::ground_truth::{self, ScaledSource};
use crate::images::ReferenceImageWriter;
use crate::labels;
use crate::manifest::sequence_path;
use crate::spec::{ground_truth_facts, path_name, scene_options};
use crate::{
    Content, DatasetLayout, DatasetOptions, Drive, InputContent, Pictures, SceneContent, SequenceEntry,
    SequenceRecord,
};
use spikelane::error::{Error, Result};
use spikelane::simulate::ExposureFault;
use spikelane::unstable::inputs::InnerPath;
use spikelane_io::formats::Layout;
use spikelane_io::light::{self, Frame, FrameTiming, Interpolation, OwnedSamples, Source, Timeline};
use spikelane_io::simulate::{
    CameraFacts, LightFacts, LightTap, MosaicFacts, RunObserver, RunOptions, RunSummary, Sidecar,
    StreamFacts, run,
};
use spikelane_io::storage::{folders, sync};
use spikelane_measure::report::insert_present;
use spikelane_scene::{Lens, SCENE_VERSION, Scene};

/// Receives the number of completed readouts, and the total number if the total is known. If the callback returns an
/// error, the generation stops.
pub(super) type ReadoutCallback<'a> = &'a mut dyn FnMut(u64, Option<u64>) -> Result<()>;

/// A folder that is removed on drop, unless the folder has been renamed to its final name.
struct PartialFolder {
    hidden_path: PathBuf,
    is_finished: bool,
}

impl Drop for PartialFolder {
    fn drop(&mut self) {
        if !self.is_finished {
            let _ = fs::remove_dir_all(&self.hidden_path);
        }
    }
}

/// A sequence whose folder is complete.
pub(super) struct GeneratedSequence {
    pub record: SequenceRecord,
    /// Digest of the record.
    pub digest: String,
    pub readouts: u64,
    pub exposure_fault: Option<ExposureFault>,
}

/// Generates the sequence of `entry`.
pub(super) fn generate_sequence(
    options: &DatasetOptions,
    entry: &SequenceEntry,
    watch: ReadoutCallback<'_>,
) -> Result<GeneratedSequence> {
    let options = &options.for_sequence(entry.id.as_str())?;
    let (output, draft) = (&options.output, InnerPath::from("sequences").join(entry.id.partial_name()));
    folders::remove(output, &draft)?;
    let hidden = folders::create_parents(output, &draft)?;
    fs::create_dir(&hidden).map_err(|e| Error::io(hidden.display(), e))?;
    let mut draft = PartialFolder { hidden_path: hidden, is_finished: false };
    let (facts, outcome) = match &options.content {
        Content::Scenes(drives) => generate_scene(options, drives, entry, &draft.hidden_path, watch)?,
        Content::Inputs(inputs) => generate_from_input(options, inputs, entry, &draft.hidden_path, watch)?,
    };
    let record = SequenceRecord::from_folder(&entry.id, facts, &draft.hidden_path)?;
    let digest = record.write(&draft.hidden_path)?;
    folders::sync_tree(&draft.hidden_path)?;
    folders::remove(output, &sequence_path(&entry.id))?;
    let folder = folders::create_parents(output, &sequence_path(&entry.id))?;
    sync::rename(&draft.hidden_path, &folder)?;
    draft.is_finished = true;
    sync::sync_folder(&output.join("sequences"))?;
    let RunSummary { readouts, exposure_fault, .. } = outcome;
    Ok(GeneratedSequence { record, digest, readouts, exposure_fault })
}

fn generate_scene(
    options: &DatasetOptions,
    drives: &SceneContent,
    entry: &SequenceEntry,
    folder: &Path,
    watch: ReadoutCallback<'_>,
) -> Result<(Value, RunSummary)> {
    let rate = options.rate()?;
    let readouts = drives.readouts();
    let seed = entry.scene_seed.unwrap_or_else(|| options.scene_seed_for(entry.id.as_str()));
    let scene =
        Scene::from_seed(seed, &scene_options(options, drives, options.listed_lighting(entry.id.as_str()))?)?;
    let drive = Drive::new(scene, rate, readouts, drives.samples, options.threads)?;
    let mut drive = drive.with_mosaic(options.camera.window_mosaic());
    if options.dataset_layout == DatasetLayout::SpikeZoo {
        let by = ground_truth::exposure_factor(options, &drive.light(readouts / 2)?);
        drive.scale_exposure(by);
    }
    let timeline = drive.timeline(Interpolation::Linear)?;
    let every = options.images.every.unwrap_or(u64::from(drives.readouts_per_image));
    let mut keeper = ReferenceImageWriter::new(options, Some(every), drives.npy, folder)?;
    let light = LightRun { timeline, readouts: Some(readouts), source: &mut drive };
    let outcome = simulate_streams(options, entry, light, &mut keeper, &mut *watch)?;
    ground_truth::write_reference_images(options, &outcome.light_sample.frame, folder)?;
    let middle = (readouts / 2) as usize;
    let white = [drive.white_cd_m2(middle), drive.white_cd_m2(0), drive.white_cd_m2(readouts as usize - 1)];
    let reference = outcome.light_sample.frame.to_f32();
    let light_statistics =
        keeper.statistics.facts(&reference, options.camera.sensor.geometry, drive.first_readouts());
    let lens = lens_facts(drive.scene().lens());
    let (mut scene, plan) = drive.into_parts();
    if drives.undistorted_labels {
        scene = scene.without_distortion();
    }
    let mut labeled = Vec::new();
    if drives.label_every > 0 {
        let wanted = labels::LabelOptions {
            interval_readouts: drives.label_every as usize * drives.readouts_per_image as usize,
            write_kitti: drives.kitti,
            exr_samples: drives.exr.then_some(drives.samples),
            threads: options.threads,
        };
        let at = folder.join("labels");
        let mut still = || watch(readouts, Some(readouts));
        labeled = labels::write_labels(&scene, &plan, &wanted, &at, &mut still)?;
    }
    let facts = json!({
        "content": "drive", "scene_seed": seed, "scene_version": SCENE_VERSION, "lighting": scene.lighting().name(),
        "white_cd_m2": white[0], "white_cd_m2_first": white[1], "white_cd_m2_last": white[2],
        "lens": lens, "undistorted_labels": drives.undistorted_labels, "vehicles": scene.vehicles(),
        "readouts": outcome.readouts, "readouts_per_image": drives.readouts_per_image,
        "image_names": "the number in the file's name", "reference_readout": readouts / 2,
        "reference_transfer": "srgb",
        "ground_truth": ground_truth_facts(options.dataset_layout),
        "labeled_readouts": labeled, "max_px_per_readout": plan.max_px_per_readout,
        "is_too_fast": plan.is_too_fast(),
        "required_readout_hz": plan.required_readout_hz(rate.hz()) as u64,
        "frames_above_max_light": outcome.frames_above_max_light,
        "light_statistics": light_statistics,
    });
    Ok((with_image_facts(facts, &keeper), outcome))
}

fn lens_facts(lens: Lens) -> Value {
    json!({
        "blur_px": lens.blur_px, "bloom": lens.bloom, "glare": lens.glare, "vignetting": lens.vignetting,
        "corner_distortion": lens.corner_distortion,
    })
}

fn with_image_facts(facts: Value, keeper: &ReferenceImageWriter) -> Value {
    insert_present(facts, [("images", keeper.facts().map(|f| json!(f)))])
}

fn generate_from_input(
    options: &DatasetOptions,
    inputs: &InputContent,
    entry: &SequenceEntry,
    folder: &Path,
    watch: ReadoutCallback<'_>,
) -> Result<(Value, RunSummary)> {
    let name = entry.input.as_deref().unwrap_or_default();
    let mut input_options = light::InputOptions::from_camera(&options.camera);
    (input_options.resize_mode, input_options.transfer) = (inputs.resize_mode, inputs.transfer);
    // The folder was examined when the data set was planned.
    (input_options.scale, input_options.is_video) = (inputs.full_scale, true);
    (input_options.accept_damage, input_options.follow_links) = (inputs.accept_damage, options.follow_links);
    let path = input_path(inputs, Path::new(name), options.access())?;
    let open = || light::open(&path, &input_options);
    let mut source = open()?;
    let pace = FrameTiming { readouts_per_frame: inputs.readouts_per_frame, frame_rate: None };
    let timeline = pace.timeline(&*source, options.rate()?, inputs.interpolation)?;
    let by = input_exposure(options, &open, &timeline)?;
    let crop_note = source
        .stored_geometry()
        .and_then(|stored| inputs.resize_mode.crop_note(stored, options.camera.sensor.geometry));
    let shown_name = if name.is_empty() { path_name(&inputs.folder) } else { name.to_owned() };
    let path_and_name = Some((path.as_path(), shown_name.as_str()));
    let mut source = ScaledSource { source: &mut *source, factor: by, path_and_name };
    let mut keeper = ReferenceImageWriter::new(options, options.images.every, false, folder)?;
    let light = LightRun { timeline: timeline.clone(), readouts: None, source: &mut source };
    let outcome = simulate_streams(options, entry, light, &mut keeper, watch)?;
    // Damage is known after the last frame.
    let mut notes = source.notes();
    notes.extend(crop_note.map(|text| format!("{name}: {text}")));
    let glance = &outcome.light_sample;
    let middle = outcome.readouts / 2;
    let reference = if glance.readout == middle {
        Some(glance.frame.clone())
    } else {
        let frame = ground_truth::middle_frame(&open, &timeline, Some(outcome.readouts))?;
        frame.map(|frame| ScaledSource::scale_frame(&frame, by)).transpose()?
    };
    let mut light_statistics = None;
    if let Some(reference) = reference {
        ground_truth::write_reference_images(options, &reference, folder)?;
        let first_readouts: Vec<usize> = (0..outcome.frames)
            .map_while(|frame| usize::try_from(timeline.first_readout(frame)?).ok())
            .collect();
        light_statistics =
            Some(keeper.statistics.facts(&reference.to_f32(), reference.geometry(), &first_readouts));
    }
    let facts = json!({
        "content": "input", "input": name, "frames": outcome.frames, "readouts": outcome.readouts,
        "readouts_per_frame": inputs.readouts_per_frame, "reference_readout": middle, "reference_transfer": "srgb",
        "ground_truth": ground_truth_facts(options.dataset_layout), "light_scale": by,
        "frames_above_max_light": outcome.frames_above_max_light, "notes": notes,
    });
    let facts =
        insert_present(facts, [("light_statistics", light_statistics), ("label", label(inputs, name))]);
    Ok((with_image_facts(facts, &keeper), outcome))
}

/// Returns the name of the folder of a picture that is a sequence of its own.
fn label(inputs: &InputContent, name: &str) -> Option<Value> {
    let path = Path::new(name);
    if inputs.pictures != Pictures::Stills || !light::image_file::is_image(path) {
        return None;
    }
    path.parent()?.file_name()?.to_str().map(Value::from)
}

/// Returns the exposure factor of an input.
///
/// Only float light can exceed white, so only inputs with float samples are read an additional time.
fn input_exposure(
    options: &DatasetOptions,
    open: &dyn Fn() -> Result<Box<dyn Source>>,
    timeline: &Timeline,
) -> Result<f32> {
    let mut source = open()?;
    let mut first = Frame::dark(source.geometry());
    let floats = source.next_frame(&mut first)? && matches!(first.samples(), OwnedSamples::F32(_));
    drop(source);
    if options.dataset_layout != DatasetLayout::SpikeZoo || !floats {
        return Ok(1.0);
    }
    let middle = ground_truth::middle_frame(open, timeline, None)?;
    Ok(middle.map_or(1.0, |light| ground_truth::exposure_factor(options, &light)))
}

/// The light of a sequence. If `readouts` is `None`, the sequence ends with the source.
struct LightRun<'a> {
    timeline: Timeline,
    readouts: Option<u64>,
    source: &'a mut dyn Source,
}

/// Writes the noisy stream, the clean stream and their common sidecar.
fn simulate_streams(
    options: &DatasetOptions,
    entry: &SequenceEntry,
    LightRun { timeline, readouts, source }: LightRun<'_>,
    keeper: &mut ReferenceImageWriter,
    watch: ReadoutCallback<'_>,
) -> Result<RunSummary> {
    let (camera, seeds) = (ground_truth::exposed_camera(options), options.seeds(entry.id.as_str()));
    let folder = keeper.folder.clone();
    let mut job = RunOptions::new(camera.clone(), seeds, timeline.clone());
    job.layout = Layout::Dat;
    job.readouts = readouts;
    job.threads = options.threads;
    let (noisy, clean) = (folder.join("stream.dat"), folder.join("stream.clean.dat"));
    let every = keeper.interval_readouts;
    let mut keep = |readout: u64, light: &Frame| keeper.write(readout, light);
    let light_tap = every.map(|every| LightTap { every, on_light: &mut keep });
    let outcome = run(&job, source, &noisy, Some(&clean), RunObserver { light_tap, progress: Some(watch) })?;
    let geometry = options.camera.sensor.geometry;
    let facts = |w| StreamFacts::new(w, geometry, outcome.readouts);
    let mut sidecar = Sidecar::new(geometry, job.layout, outcome.readouts, facts(&outcome.noisy));
    sidecar.readout_hz = Some(options.camera.sensor.readout_hz);
    sidecar.clean = outcome.clean.as_ref().map(facts);
    sidecar.seeds = Some(Sidecar::seed_facts(seeds));
    sidecar.camera = Some(CameraFacts::new(&camera)?);
    sidecar.mosaic = camera.window_mosaic().as_ref().map(MosaicFacts::new);
    let electrons = camera.operating_point(0.0).electrons;
    sidecar.images = keeper.facts();
    let resize_mode = match &options.content {
        Content::Inputs(inputs) => Some(inputs.resize_mode.to_string()),
        Content::Scenes(_) => None,
    };
    sidecar.light = Some(LightFacts {
        resize_mode,
        interpolation: timeline.interpolation().to_string(),
        readouts_per_frame: match &options.content {
            Content::Scenes(_) => Some("by motion".to_owned()),
            Content::Inputs(_) => timeline.readouts(1).map(|n| n.to_string()),
        },
        frames: outcome.frames,
        exposure_electrons: electrons * camera.sensor.thresholds_at_full_scale,
        max_light: outcome.max_light,
        frames_above_max_light: outcome.frames_above_max_light,
        ..LightFacts::from_source(source)
    });
    sidecar.write(&folder.join("stream.json"), false)?;
    Ok(outcome)
}
