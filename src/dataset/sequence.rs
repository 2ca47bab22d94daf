//! One sequence: its streams, images and labels, in a folder that appears when it is whole.

use std::fs::{self, File};
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};

use crate::dataset::labels::{self, write};
use crate::dataset::{Drive, Drives, Entry, Inputs, Options, Record, Work};
use crate::draws::Seeds;
use crate::error::{Error, Kind, Result};
use crate::formats::Layout as StreamLayout;
use crate::light::{self, Frame, Insertion, Rate, Source, Timeline};
use crate::scene::{self, Scene, SceneOptions};
use crate::simulate::{CameraFacts, LightFacts, Outcome, Run, Sidecar, StreamFacts, run};
use crate::spikes::Geometry;

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

/// Removes a folder, if it is there.
pub(super) fn remove(folder: &Path) -> Result<()> {
    match fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(folder.display(), e)),
        _ => Ok(()),
    }
}

/// Makes the sequence of `entry`; returns its record, the record's digest, and its readouts.
pub(super) fn make(options: &Options, entry: &Entry, watch: Watch<'_>) -> Result<(Record, String, u64)> {
    let all = options.output.join("sequences");
    let (folder, hidden) = (all.join(&entry.id), all.join(format!(".{}.partial", entry.id)));
    remove(&hidden)?;
    fs::create_dir_all(&hidden).map_err(|e| Error::io(hidden.display(), e))?;
    let mut draft = Draft { hidden, kept: false };
    let (about, readouts) = match &options.work {
        Work::Drives(drives) => drive(options, drives, entry, &draft.hidden, watch)?,
        Work::Inputs(inputs) => input(options, inputs, entry, &draft.hidden, watch)?,
    };
    let record = Record::of(&entry.id, about, &draft.hidden)?;
    let digest = record.write(&draft.hidden)?;
    sync(&draft.hidden)?;
    remove(&folder)?;
    fs::rename(&draft.hidden, &folder).map_err(|e| Error::io(folder.display(), e))?;
    draft.kept = true;
    sync(&all)?;
    Ok((record, digest, readouts))
}

/// Brings a folder's files to the disk: once for all of them, as hundreds of single
/// syncs take longer than the pictures.
fn sync(folder: &Path) -> Result<()> {
    let handle = File::open(folder).map_err(|e| Error::io(folder.display(), e))?;
    #[cfg(target_os = "linux")]
    rustix::fs::syncfs(&handle).map_err(|e| Error::io(folder.display(), e.into()))?;
    #[cfg(not(target_os = "linux"))]
    handle.sync_all().map_err(|e| Error::io(folder.display(), e))?;
    Ok(())
}

/// Passes light on and keeps every `every`th frame as a clear image.
struct Tap<'a> {
    source: &'a mut dyn Source,
    every: u64,
    npy: bool,
    folder: PathBuf,
    middle: u64,
    next: u64,
}

impl Source for Tap<'_> {
    fn geometry(&self) -> Geometry {
        self.source.geometry()
    }
    fn frames(&self) -> Option<u64> {
        self.source.frames()
    }
    fn rate(&self) -> Option<Rate> {
        self.source.rate()
    }
    fn describe(&self) -> String {
        self.source.describe()
    }
    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if !self.source.next_frame(into)? {
            return Ok(false);
        }
        if self.next.is_multiple_of(self.every) {
            let light = into.to_f32();
            let png = picture(&light, into.geometry())?;
            write(&self.folder, &format!("images/{:06}.png", self.next), &png)?;
            if self.next == self.middle {
                write(&self.folder, "clear.png", &png)?;
            }
            if self.npy {
                let shape = [into.geometry().height(), into.geometry().width()];
                let bytes = scene::labels::npy_f32(&shape, &light)?;
                write(&self.folder, &format!("images/{:06}.npy", self.next), &bytes)?;
            }
        }
        self.next += 1;
        Ok(true)
    }
}

/// An 8-bit sRGB picture of linear light.
pub(super) fn picture(light: &[f32], geometry: Geometry) -> Result<Vec<u8>> {
    let code = |&x: &f32| (light::srgb_code(x) * 255.0 + 0.5) as u8;
    let codes: Vec<u8> = light.iter().map(code).collect();
    let mut out = Cursor::new(Vec::new());
    image::codecs::png::PngEncoder::new(&mut out)
        .write_image(&codes, geometry.width() as u32, geometry.height() as u32, ExtendedColorType::L8)
        .map_err(|e| Error::new(Kind::Input, "clear image").found(e))?;
    Ok(out.into_inner())
}

/// What every scene of the dataset is asked to be.
pub(super) fn scene_options(options: &Options, drives: &Drives) -> Result<SceneOptions> {
    let geometry = options.camera.sensor.geometry;
    Ok(SceneOptions {
        width: geometry.width() as u32,
        height: geometry.height() as u32,
        lighting: drives.lighting,
        // One more readout than needed, so that rounding leaves the last one inside.
        duration_s: (drives.readouts() as f64 / options.rate()?.hz()).max(2e-3),
        speed_kmh: drives.speed_kmh,
        vehicles: drives.vehicles,
        flicker_hz: drives.flicker_hz,
        fov_deg: None,
    })
}

fn drive(
    options: &Options,
    drives: &Drives,
    entry: &Entry,
    folder: &Path,
    watch: Watch<'_>,
) -> Result<(Value, u64)> {
    let rate = options.rate()?;
    let readouts = drives.readouts();
    let seed = entry.scene_seed.unwrap_or_else(|| options.scene_seed(&entry.id));
    let scene = Scene::random(seed, &scene_options(options, drives)?)?;
    let mut drive = Drive::new(scene, rate, readouts, drives.white_cd_m2, drives.samples, options.threads)?;
    let images = folder.join("images");
    fs::create_dir_all(&images).map_err(|e| Error::io(images.display(), e))?;
    let every = u64::from(drives.readouts_per_image);
    let middle = (readouts / 2) / every * every;
    let mut tap =
        Tap { source: &mut drive, every, npy: drives.npy, folder: folder.to_owned(), middle, next: 0 };
    let timeline = Timeline::per_frame(1, Insertion::Hold)?;
    let seeds = options.seeds(&entry.id);
    let outcome = streams(options, seeds, timeline, &mut tap, folder, &mut *watch)?;
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
        "image_readouts": "the number in the file's name", "clear_readout": middle,
        "label_readouts": labelled, "max_px_per_readout": plan.max_px_per_readout,
        "key_frames": plan.keys.len(), "too_fast": plan.too_fast(),
        "needed_readout_hz": plan.needed_hz(rate.hz()) as u64,
        "frames_beyond_greatest_light": outcome.too_bright,
    });
    Ok((about, outcome.readouts))
}

fn input(
    options: &Options,
    inputs: &Inputs,
    entry: &Entry,
    folder: &Path,
    watch: Watch<'_>,
) -> Result<(Value, u64)> {
    let name = entry.input.as_deref().unwrap_or_default();
    let mut how = light::Options::of(&options.camera);
    (how.fit, how.transfer) = (inputs.fit, inputs.transfer);
    let mut source = light::open(&inputs.folder.join(name), &how)?;
    let timeline = Timeline::per_frame(inputs.readouts_per_frame, inputs.insertion)?;
    let seeds = options.seeds(&entry.id);
    let outcome = streams(options, seeds, timeline, &mut *source, folder, watch)?;
    let glance = &outcome.glance;
    write(folder, "clear.png", &picture(&glance.frame.to_f32(), glance.frame.geometry())?)?;
    let about = json!({
        "kind": "input", "input": name, "frames": outcome.frames, "readouts": outcome.readouts,
        "readouts_per_frame": inputs.readouts_per_frame, "clear_readout": glance.readout,
        "frames_beyond_greatest_light": outcome.too_bright,
    });
    Ok((about, outcome.readouts))
}

/// The noisy and the clean stream with their sidecar.
fn streams(
    options: &Options,
    seeds: Seeds,
    timeline: Timeline,
    source: &mut dyn Source,
    folder: &Path,
    watch: Watch<'_>,
) -> Result<Outcome> {
    let mut job = Run::new(options.camera.clone(), seeds, timeline);
    job.layout = StreamLayout::Dat;
    job.threads = options.threads;
    let outcome =
        run(&job, source, &folder.join("stream.dat"), Some(&folder.join("stream.clean.dat")), watch)?;
    let geometry = options.camera.sensor.geometry;
    let facts = |w| StreamFacts::new(w, geometry, outcome.readouts);
    let mut sidecar = Sidecar::new(geometry, job.layout, outcome.readouts, facts(&outcome.noisy));
    sidecar.readout_hz = Some(options.camera.sensor.readout_hz);
    sidecar.clean = outcome.clean.as_ref().map(facts);
    sidecar.seeds = Some(Sidecar::seed_facts(seeds));
    sidecar.camera = Some(CameraFacts::new(&options.camera)?);
    let electrons = options.camera.operating(0.0).electrons;
    sidecar.light = Some(LightFacts {
        insertion: format!("{:?}", timeline.insertion()).to_lowercase(),
        readouts_per_frame: timeline.readouts(1).map(|n| n.to_string()),
        frames: outcome.frames,
        exposure_electrons: electrons * options.camera.sensor.thresholds_at_full_scale,
        greatest_light: outcome.greatest_light,
        frames_beyond_greatest_light: outcome.too_bright,
        ..LightFacts::of(source)
    });
    sidecar.write(&folder.join("stream.json"), false)?;
    Ok(outcome)
}
