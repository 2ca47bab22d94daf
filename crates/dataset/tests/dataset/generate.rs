//! Tests of the generation of small datasets.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use spikelane::{Error, ErrorKind, Geometry, Result, presets};
use spikelane_dataset::{
    self as dataset, Access, Content, DatasetLayout, DatasetOptions, DatasetReport, InputContent, Manifest,
    Pictures, SceneContent, SequenceRecord, SequenceStatus, Splits,
};
use spikelane_io::light::{Interpolation, ResizeMode};
use spikelane_scene::Lighting;

pub(crate) fn options(output: &Path, work: Content) -> DatasetOptions {
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(48, 32).unwrap();
    DatasetOptions::new(output.to_owned(), work, camera)
        .with_seed(5)
        .with_camera_seed(1)
        .with_scene_seed(5)
        .with_dataset_layout(DatasetLayout::SpikeCv)
        .with_splits(Splits { test: 0.3, ..Splits::default() })
        .with_license(Some("CC-BY-4.0".into()))
}

pub(crate) fn scene_content(sequences: u32) -> Content {
    let some = SceneContent::rhdd()
        .with_sequences(sequences)
        .with_images_per_scene(12)
        .with_readouts_per_image(2)
        .with_label_every(6);
    Content::Scenes(some.with_lighting(vec![Lighting::Overcast]))
}

pub(crate) fn generate_dataset(options: &DatasetOptions) -> Result<DatasetReport> {
    dataset::generate(options, &mut |_| Ok(()))
}

/// Returns the report with an empty digest.
fn without_digest(report: DatasetReport) -> DatasetReport {
    DatasetReport { digest: String::new(), ..report }
}

/// Returns the path and the bytes of every file in a folder and its subfolders.
fn read_files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let (mut all, mut folders) = (BTreeMap::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
                all.insert(name, fs::read(path).unwrap());
            }
        }
    }
    all
}

#[test]
fn a_sequence_holds_streams_images_and_labels_of_named_readouts() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    generate_dataset(&options(&out, scene_content(1))).unwrap();
    let all = read_files(&out);
    let at = |name: &str| all.contains_key(&format!("sequences/scene-0000/{name}"));
    for name in ["stream.dat", "stream.clean.dat", "stream.json", "reference.png", "images/000022.png"] {
        assert!(at(name), "{name}");
    }
    // The scene has 24 readouts, an image every 2 readouts, and labels every 6 images. Therefore readouts 0 and 12 are
    // labeled.
    for name in ["000000.depth.npy", "000012.depth.npy", "000000.forward.flo", "000012.backward.flo"] {
        assert!(at(&format!("labels/{name}")), "{name}");
    }
    assert!(!at("labels/000006.depth.npy") && !at("images/000001.png"));
    let stream = all["sequences/scene-0000/stream.dat"].len();
    assert_eq!(stream, 24 * 48 * 32 / 8);
    for name in ["DATASHEET.md", "LICENSE.txt", "config.yaml", "manifest.jsonl"] {
        assert!(all.contains_key(name), "{name}");
    }
}

#[test]
fn labels_come_in_kittis_pictures_and_light_in_exr_when_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    let Content::Scenes(some) = scene_content(1) else { panic!("scenes") };
    generate_dataset(&options(&out, Content::Scenes(some.with_kitti(true).with_exr(true)))).unwrap();
    let at = |name: &str| out.join("sequences/scene-0000/labels").join(name);
    // In KITTI files, depth is a multiple of 1/256 m. The test compares the KITTI depth with the exact depth.
    let depth = image::open(at("000012.depth.kitti.png")).unwrap().into_luma16();
    let exact = fs::read(at("000012.depth.npy")).unwrap();
    let exact: Vec<f32> = exact[exact.len() - 48 * 32 * 4..]
        .chunks(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    assert!(depth.iter().zip(&exact).all(|(&d, &m)| {
        if m < 255.99 { (f32::from(d) / 256.0 - m).abs() <= 0.5 / 256.0 } else { d == 0 }
    }));
    let flow = image::open(at("000000.forward.kitti.png")).unwrap().into_rgb16();
    assert!(flow.pixels().any(|p| p.0[2] == 1));
    let light = image::open(at("000012.light.exr")).unwrap().into_rgb32f();
    assert_eq!((light.width(), light.height()), (48, 32));
    assert!(light.as_raw().iter().all(|v| v.is_finite() && *v >= 0.0));
}

#[test]
fn too_fast_scenes_report_the_required_readout_rate() {
    let dir = tempfile::tempdir().unwrap();
    let make_at = |readout_hz: f64, name: &str| {
        let mut slow = options(&dir.path().join(name), scene_content(1));
        slow.camera.sensor.readout_hz = readout_hz;
        generate_dataset(&slow).unwrap()
    };
    let report = make_at(200.0, "slow");
    assert_eq!(report.too_fast_scenes, 1);
    assert!(report.required_readout_hz > 200, "{report:?}");
    let enough = make_at(report.required_readout_hz as f64 * 1.2, "fast");
    assert_eq!((enough.too_fast_scenes, enough.required_readout_hz), (0, 0));
}

#[test]
fn a_changed_input_is_made_again() {
    let dir = tempfile::tempdir().unwrap();
    let (clips, out) = (dir.path().join("clips"), dir.path().join("set"));
    for name in ["a", "b"] {
        clip(&clips.join(name), 200);
    }
    generate_dataset(&options(&out, inputs(&clips))).unwrap();
    let resumed = || generate_dataset(&options(&out, inputs(&clips)).with_resume(true)).unwrap();
    assert_eq!(
        without_digest(resumed()),
        DatasetReport { verified_sequences: 2, ..DatasetReport::default() }
    );
    clip(&clips.join("b"), 90);
    assert_eq!(
        without_digest(resumed()),
        DatasetReport { generated: 1, verified_sequences: 1, ..DatasetReport::default() }
    );
}

#[test]
fn threads_change_no_byte() {
    let dir = tempfile::tempdir().unwrap();
    let mut outputs = Vec::new();
    for threads in [1, 2] {
        // The SpikeCV configuration contains the name of the folder, so the name must be the same in both runs.
        let out = dir.path().join(threads.to_string()).join("set");
        generate_dataset(&options(&out, scene_content(1)).with_threads(threads)).unwrap();
        outputs.push(read_files(&out));
    }
    assert!(outputs[0] == outputs[1]);
}

#[test]
fn every_sequence_has_its_own_scene_and_noise() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    generate_dataset(&options(&out, scene_content(2))).unwrap();
    let manifest = Manifest::read(&out, Access::Read).unwrap();
    let [a, b] = &manifest.entries[..] else { panic!("two sequences") };
    assert_ne!(a.scene_seed, b.scene_seed);
    assert_ne!(a.seeds[2], b.seeds[2]);
    assert_eq!(a.seeds[0], b.seeds[0], "one camera");
    let all = read_files(&out);
    assert_ne!(all["sequences/scene-0000/reference.png"], all["sequences/scene-0001/reference.png"]);
}

#[test]
fn resume_makes_a_corrupted_and_a_missing_sequence_again_and_no_other() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    generate_dataset(&options(&out, scene_content(3))).unwrap();
    let before = read_files(&out);
    let broken = out.join("sequences/scene-0000/labels/000000.depth.npy");
    let mut bytes = fs::read(&broken).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&broken, bytes).unwrap();
    fs::remove_file(out.join("sequences/scene-0002/images/000002.png")).unwrap();
    let report = generate_dataset(&options(&out, scene_content(3)).with_resume(true)).unwrap();
    assert_eq!(
        without_digest(report),
        DatasetReport {
            generated: 2,
            verified_sequences: 1,
            failed_sequences: 0,
            ..DatasetReport::default()
        }
    );
    assert!(read_files(&out) == before);
}

#[test]
fn resume_with_other_options_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    generate_dataset(&options(&out, scene_content(1))).unwrap();
    assert_eq!(generate_dataset(&options(&out, scene_content(1))).unwrap_err().kind(), ErrorKind::Exists);
    let other = options(&out, scene_content(1)).with_seed(6).with_resume(true);
    let error = generate_dataset(&other).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Config);
    assert!(error.to_string().contains("seed = 6"), "{error}");
}

#[test]
fn an_interrupted_run_leaves_nothing_that_looks_finished() {
    let dir = tempfile::tempdir().unwrap();
    let (set, out) = (dir.path().join("a/set"), dir.path().join("b/set"));
    generate_dataset(&options(&set, scene_content(2))).unwrap();
    let mut stop = |p: dataset::SequenceProgress<'_>| {
        if p.index == 1 && p.readouts > 0 {
            Err(Error::new(ErrorKind::Interrupted, "stopped"))
        } else {
            Ok(())
        }
    };
    let error = dataset::generate(&options(&out, scene_content(2)), &mut stop).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Interrupted);
    let left: Vec<_> = fs::read_dir(out.join("sequences")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["scene-0000"]);
    assert_eq!(Manifest::read(&out, Access::Read).unwrap().entries[1].status, SequenceStatus::Planned);
    let report = generate_dataset(&options(&out, scene_content(2)).with_resume(true)).unwrap();
    assert_eq!((report.generated, report.verified_sequences), (1, 1));
    assert!(read_files(&out) == read_files(&set));
}

/// Writes a folder of three 48x32 images. The upper half of each image is bright.
pub(crate) fn clip(folder: &Path, brightness: u8) {
    fs::create_dir_all(folder).unwrap();
    for i in 0..3 {
        let picture =
            image::GrayImage::from_fn(48, 32, |_, y| image::Luma([if y < 16 { brightness } else { 20 }]));
        picture.save(folder.join(format!("{i}.png"))).unwrap();
    }
}

pub(crate) fn inputs(folder: &Path) -> Content {
    Content::Inputs(InputContent {
        folder: folder.to_owned(),
        list: None,
        pictures: Pictures::Auto,
        readouts_per_frame: Some(8),
        interpolation: Interpolation::Linear,
        resize_mode: ResizeMode::Cover,
        transfer: None,
        full_scale: None,
        accept_damage: false,
    })
}

/// Half of a JPEG would be simulated as gray.
#[test]
fn a_damaged_clip_fails_unless_damage_is_accepted() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    clip(&clips.join("whole"), 200);
    fs::create_dir_all(clips.join("a")).unwrap();
    let mut jpeg = std::io::Cursor::new(Vec::new());
    let image = image::GrayImage::from_fn(48, 32, |x, y| image::Luma([(x * y) as u8]));
    image.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    let jpeg = jpeg.into_inner();
    for (name, len) in [("1.jpg", jpeg.len()), ("2.jpg", jpeg.len() * 3 / 4)] {
        fs::write(clips.join("a").join(name), &jpeg[..len]).unwrap();
    }
    for accept_damage in [false, true] {
        let Content::Inputs(content) = inputs(&clips) else { unreachable!() };
        let content = Content::Inputs(InputContent { accept_damage, ..content });
        let out = dir.path().join(format!("set-{accept_damage}"));
        let report = generate_dataset(&options(&out, content)).unwrap();
        assert_eq!((report.generated, report.failed_sequences), if accept_damage { (2, 0) } else { (1, 1) });
        let has_note = |(name, bytes): (String, Vec<u8>)| {
            name.ends_with("record.json") && String::from_utf8_lossy(&bytes).contains("2.jpg: damaged")
        };
        assert_eq!(read_files(&out).into_iter().any(has_note), accept_damage);
    }
}

#[test]
fn many_clips_become_sequences_of_their_own_and_broken_ones_are_set_aside() {
    let dir = tempfile::tempdir().unwrap();
    let (clips, out) = (dir.path().join("clips"), dir.path().join("set"));
    for i in 0..18 {
        clip(&clips.join(format!("day{}/clip {i}", i % 3)), 200);
    }
    fs::create_dir_all(clips.join("bad")).unwrap();
    fs::write(clips.join("bad/0.png"), b"no picture").unwrap();
    fs::write(clips.join("bad/1.png"), b"no picture").unwrap();
    // A folder with a single image is not a clip, so `cover.png` must be skipped.
    fs::write(clips.join("cover.png"), b"no picture").unwrap();
    fs::write(clips.join("bad.y4m"), b"YUV4MPEG2 W48").unwrap();
    let report = generate_dataset(&options(&out, inputs(&clips))).unwrap();
    assert_eq!((report.generated, report.verified_sequences, report.failed_sequences), (18, 0, 2));
    let aside: Vec<_> = report.failures.iter().map(|failure| failure.input.as_str()).collect();
    assert_eq!(aside, ["bad", "bad.y4m"]);
    let Content::Inputs(found) = inputs(&clips) else { unreachable!() };
    assert_eq!(dataset::skipped_files(&found, &out).unwrap(), [Path::new("cover.png")]);
    let manifest = Manifest::read(&out, Access::Read).unwrap();
    let (good, bad): (Vec<_>, Vec<_>) =
        manifest.entries.iter().partition(|e| e.status == SequenceStatus::Done);
    assert!(bad.iter().all(|e| e.reason.as_deref().is_some_and(|r| r.contains("bad"))));
    // The noise of the sequences differs although their images are equal.
    let streams: BTreeSet<_> = good
        .iter()
        .map(|e| fs::read(out.join("sequences").join(e.id.as_str()).join("stream.dat")).unwrap())
        .collect();
    assert_eq!(streams.len(), 18);
    for entry in &good {
        SequenceRecord::verify(
            &out.join("sequences").join(entry.id.as_str()),
            entry.digest.as_deref().unwrap(),
            Access::Read,
            &mut || Ok(()),
        )
        .unwrap();
    }
    // The damaged input is replaced with a valid input. Only the sequence of this input must be generated again.
    fs::remove_file(clips.join("bad.y4m")).unwrap();
    fs::remove_dir_all(clips.join("bad")).unwrap();
    clip(&clips.join("bad"), 90);
    let report = generate_dataset(&options(&out, inputs(&clips)).with_resume(true)).unwrap();
    assert_eq!(
        without_digest(report),
        DatasetReport {
            generated: 1,
            verified_sequences: 18,
            failed_sequences: 0,
            ..DatasetReport::default()
        }
    );
}

#[test]
fn loaders_find_streams_upright_where_they_look() {
    let dir = tempfile::tempdir().unwrap();
    let (clips, out) = (dir.path().join("clips"), dir.path().join("set"));
    clip(&clips.join("one"), 220);
    generate_dataset(&options(&out, inputs(&clips))).unwrap();
    let entry = &Manifest::read(&out, Access::Read).unwrap().entries[0];
    let stream = out.join(entry.split.name()).join("spike").join(format!("{}.dat", entry.id));
    assert!(out.join(entry.split.name()).join("gt").join(format!("{}.png", entry.id)).is_file());
    // Loaders flip the rows vertically. Therefore the last rows in the file are the first rows of the image.
    let bytes = fs::read(stream).unwrap();
    let frame = 48 * 32 / 8;
    let count = |half: usize| -> u32 {
        bytes
            .chunks(frame)
            .map(|f| f[half * frame / 2..][..frame / 2].iter().map(|b| b.count_ones()).sum::<u32>())
            .sum()
    };
    assert!(count(1) > 10 * count(0).max(1) / 2, "{} above, {} below", count(1), count(0));
    let config = fs::read_to_string(out.join("config.yaml")).unwrap();
    assert!(config.contains("spike_w: 48") && config.contains("spike_h: 32"));
}
