//! Tests which light the ground truth of a dataset shows, and which codes represent this light.

use std::fs;
use std::path::{Path, PathBuf};

use spikelane::spikes::bit;
use spikelane::{ErrorKind, Geometry, presets};
use spikelane_dataset::{
    self as dataset, Access, Content, DatasetLayout, DatasetOptions, Drive, InputContent, Manifest, Pictures,
    ReferenceImageOptions, SceneContent, SequenceRecord, Splits,
};
use spikelane_io::formats::StreamReader;
use spikelane_io::light::{self, Interpolation, ResizeMode, Timeline};
use spikelane_io::simulate::{ImageFormat, light_at};
use spikelane_scene::{Lens, Lighting, SamplesPerPixel, Scene, SceneOptions};

const WIDTH: usize = 48;
const HEIGHT: usize = 32;

fn options(output: &Path, work: Content, structure: DatasetLayout) -> DatasetOptions {
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(WIDTH as u32, HEIGHT as u32).unwrap();
    DatasetOptions::new(output.to_owned(), work, camera)
        .with_seed(5)
        .with_scene_seed(5)
        .with_camera_seed(1)
        .with_dataset_layout(structure)
        .with_splits(Splits::default())
        .with_license(None)
}

fn make(options: &DatasetOptions) -> PathBuf {
    dataset::generate(options, &mut |_| Ok(())).unwrap();
    let entry = &Manifest::read(&options.output, Access::Read).unwrap().entries[0];
    options.output.join("sequences").join(entry.id.as_str())
}

fn inputs(folder: &Path, readouts_per_frame: u64) -> Content {
    Content::Inputs(InputContent {
        folder: folder.to_owned(),
        list: None,
        pictures: Pictures::Auto,
        readouts_per_frame: Some(readouts_per_frame),
        interpolation: Interpolation::Linear,
        resize_mode: ResizeMode::Cover,
        transfer: None,
        full_scale: None,
        accept_damage: false,
    })
}

/// Writes a `.npy` of float frames. All pixels of a frame have the same light, so a single number describes the light
/// of a readout.
fn clip(path: &Path, lights: &[f32]) {
    clip_of(path, lights.len(), |frame, _| lights[frame]);
}

fn clip_of(path: &Path, frames: usize, light: impl Fn(usize, usize) -> f32) {
    let values: Vec<f32> =
        (0..frames * WIDTH * HEIGHT).map(|i| light(i / (WIDTH * HEIGHT), i % (WIDTH * HEIGHT))).collect();
    let bytes = spikelane_scene::labels::npy_f32(&[frames, HEIGHT, WIDTH], &values).unwrap();
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

fn codes(path: &Path) -> Vec<u8> {
    image::open(path).unwrap().into_luma8().into_raw()
}

fn floats(path: &Path) -> Vec<f32> {
    let bytes = fs::read(path).unwrap();
    let data = &bytes[bytes.len() - 4 * WIDTH * HEIGHT..];
    data.chunks(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// The clip has n readouts. During its middle half, the light increases by 510 / n codes per readout.
///
/// For n = 400, the increase is 1.27 codes per readout. For smaller n, the increase is larger. Rounding hides at most
/// 0.5 codes, so the test detects light of a wrong readout.
#[test]
fn ground_truth_of_a_clip_is_the_light_of_readout_half_of_all() {
    let dir = tempfile::tempdir().unwrap();
    for (readouts, per_frame, frames) in [(8, 4, 2), (200, 8, 25), (257, 1, 257), (400, 16, 25)] {
        let clips = dir.path().join(format!("clips{readouts}-{per_frame}"));
        let light = |t: usize| (2.0 * t as f32 / readouts as f32 - 0.5).clamp(0.0, 1.0);
        let lights: Vec<f32> = (0..frames).map(|k| light(k * per_frame)).collect();
        clip(&clips.join("a.npy"), &lights);
        let out = dir.path().join(format!("set{readouts}-{per_frame}"));
        let sequence_folder = make(&options(&out, inputs(&clips, per_frame as u64), DatasetLayout::SpikeCv));
        let record = SequenceRecord::read(&sequence_folder, Access::Read).unwrap();
        let middle = readouts / 2;
        assert_eq!(record.facts["readouts"], readouts);
        assert_eq!(record.facts["reference_readout"], middle);
        let expected = 255.0 * light(middle);
        let code = f32::from(codes(&sequence_folder.join("gt.png"))[0]);
        assert!((code - expected).abs() <= 0.51, "{readouts}: {code} for {expected}");
    }
}

/// The readout rate is only 200 Hz, so the scene moves by more than half a pixel per readout. Therefore every readout
/// is rendered.
///
/// Rounding to codes causes a mean error of a quarter of a code, which is 0.001 of white. If the image showed the light
/// of another readout, the error would be much larger.
#[test]
fn ground_truth_of_a_scene_is_drawn_for_its_readout_whatever_the_spacing_of_images() {
    let dir = tempfile::tempdir().unwrap();
    std::thread::scope(|scope| {
        for (images, each) in [(8, 1), (4, 50), (257, 1), (5, 80)] {
            let dir = &dir;
            scope.spawn(move || check_reference_render(dir.path(), images, each));
        }
    });
}

fn check_reference_render(dir: &Path, images: u32, each: u32) {
    let readouts = images * each;
    let drives = SceneContent::rhdd()
        .with_sequences(1)
        .with_images_per_scene(images)
        .with_readouts_per_image(each)
        .with_label_every(0)
        .with_lighting(vec![Lighting::Overcast])
        .with_npy(true);
    let mut all = options(&dir.join(readouts.to_string()), Content::Scenes(drives), DatasetLayout::SpikeCv);
    all.camera.sensor.readout_hz = 200.0;
    let sequence_folder = make(&all);
    let facts = SequenceRecord::read(&sequence_folder, Access::Read).unwrap().facts;
    assert_eq!((&facts["reference_readout"], &facts["is_too_fast"]), (&(readouts / 2).into(), &true.into()));
    let scene = Scene::from_seed(
        facts["scene_seed"].as_u64().unwrap(),
        &SceneOptions::default()
            .with_width(WIDTH as u32)
            .with_height(HEIGHT as u32)
            .with_lighting(Some(Lighting::Overcast))
            .with_duration_s((f64::from(readouts) / 200.0).max(2e-3))
            .with_lens(Some(Lens::from_seed(5))),
    )
    .unwrap();
    let drive = Drive::new(scene, all.rate().unwrap(), readouts.into(), SamplesPerPixel::Sixteen, 1).unwrap();
    let error = |readout: u32| -> f32 {
        let light = drive.light(readout.into()).unwrap().to_f32();
        let gt_codes = codes(&sequence_folder.join("gt.png"));
        let each = light.iter().zip(&gt_codes).map(|(l, &c)| (l.min(1.0) - f32::from(c) / 255.0).abs());
        each.sum::<f32>() / light.len() as f32
    };
    let right = error(readouts / 2);
    assert!(right < 0.002, "{readouts}: {right}");
    if readouts > 8 {
        let offset_error = error(readouts / 2 - readouts / 8);
        assert!(offset_error > 2.0 * right, "{readouts}: {offset_error} away, {right} there");
    }
}

/// In n readouts, a pixel with rate r has one of two integer spike counts. The start phase of the pixel determines
/// which one. Over all start phases, the variance of this count is f (1 - f), where f is the fractional part of n r.
/// The rounding of codes adds a variance of 1/12.
///
/// The start phases and the rounding of codes must explain the whole difference between the ground truth and a clean
/// stream.
#[test]
fn clean_rates_match_ground_truth_up_to_quantization() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    clip_of(&clips.join("a.npy"), 2, |_, p| (p as f32 + 0.5) / (WIDTH * HEIGHT) as f32);
    for (structure, rate) in [(DatasetLayout::SpikeZoo, 0.6), (DatasetLayout::SpikeCv, 1.0)] {
        let out = dir.path().join(structure.name());
        let sequence_folder = make(&options(&out, inputs(&clips, 60), structure));
        let gt_codes = codes(&sequence_folder.join("gt.png"));
        let reader = StreamReader::open(&sequence_folder.join("stream.clean.dat"), None, None).unwrap();
        let n = 41;
        let mut packed = vec![0; n * reader.geometry().frame_bytes()];
        reader.read_frames(40, &mut packed).unwrap();
        let (mut actual, mut expected) = (0.0, 0.0);
        for (p, &code) in gt_codes.iter().enumerate() {
            let frames = packed.chunks(reader.geometry().frame_bytes());
            let count = frames.filter(|frame| bit(frame, p)).count() as f64;
            let truth = f64::from(code) / 255.0;
            let part = (n as f64 * truth * rate).fract();
            actual += (count / n as f64 / rate - truth).powi(2);
            expected += part * (1.0 - part) / (n as f64 * rate).powi(2) + 1.0 / 12.0 / 255.0_f64.powi(2);
        }
        // The mean square difference of 1,536 pixels has a standard error of 4 %. With sRGB codes or another full
        // scale, this mean would be at least 10 times as large.
        let ratio = actual / expected;
        assert!((0.8..1.2).contains(&ratio), "{}: {ratio}", structure.name());
    }
}

/// The lamps are 30 times as bright as white, so their pixels fire at every readout. The exposure of the other pixels
/// must be unchanged.
#[test]
fn lamps_that_saturate_the_sensor_do_not_darken_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    clip_of(&clips.join("a.npy"), 2, |_, p| if p % 50 == 0 { 30.0 } else { 0.5 });
    let sequence_folder = make(&options(&dir.path().join("set"), inputs(&clips, 8), DatasetLayout::SpikeZoo));
    assert_eq!(SequenceRecord::read(&sequence_folder, Access::Read).unwrap().facts["light_scale"], 1.0);
    let gt_codes = codes(&sequence_folder.join("gt.png"));
    assert_eq!([gt_codes[0], gt_codes[1]], [255, 128]);
}

/// Half of the pixels are brighter than white, by a factor of up to 2. Without a shorter exposure, half of the codes
/// would be 255.
#[test]
fn light_is_exposed_so_that_spike_zoo_codes_cut_a_thousandth_at_most() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    clip_of(&clips.join("a.npy"), 2, |_, p| 2.0 * (p as f32 + 0.5) / (WIDTH * HEIGHT) as f32);
    let out = dir.path().join("set");
    let all = options(&out, inputs(&clips, 8), DatasetLayout::SpikeZoo);
    let sequence_folder = make(&all);
    let gt_codes = codes(&sequence_folder.join("gt.png"));
    let cut = gt_codes.iter().filter(|&&c| c == 255).count();
    assert!(cut <= gt_codes.len() / 1000, "{cut} codes of 255");
    // One exposure step changes the light by 1 %, which is 2.6 codes.
    assert!(gt_codes.iter().any(|&c| c >= 251), "exposed too little");
    let scale =
        SequenceRecord::read(&sequence_folder, Access::Read).unwrap().facts["light_scale"].as_f64().unwrap();
    assert!((0.49..0.51).contains(&scale), "{scale}");
    assert_eq!(Manifest::read(&out, Access::Read).unwrap().options["ground_truth"]["rate_at_255"], 0.6);
    let sheet = fs::read_to_string(out.join("DATASHEET.md")).unwrap();
    assert!(sheet.contains("rate=0.6") && sheet.contains("| rate of ground truth 255 | 0.6 |"), "{sheet}");
    assert_eq!(codes(&out.join("train/gt").join(format!("{}.png", name_of(&sequence_folder)))), gt_codes);
}

fn name_of(folder: &Path) -> String {
    folder.file_name().unwrap().to_string_lossy().into_owned()
}

#[test]
fn clear_light_of_clips_is_kept_by_readout_in_every_form() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    clip(&clips.join("a.npy"), &[0.1, 0.5, 0.7]);
    for form in ImageFormat::ALL {
        let out = dir.path().join(form.name());
        let mut all = options(&out, inputs(&clips, 8), DatasetLayout::SpikeCv);
        all.images = ReferenceImageOptions { every: Some(6), format: form };
        let sequence_folder = make(&all);
        let mut names: Vec<_> =
            fs::read_dir(sequence_folder.join("images")).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        let ending = form.extension();
        assert_eq!(
            names,
            ["000000", "000006", "000012", "000018"]
                .map(|n| std::ffi::OsString::from(format!("{n}.{ending}")))
        );
        // The time of readout 6 is at three quarters of the interval between the first and the second frame.
        let file = sequence_folder.join(format!("images/000006.{ending}"));
        let (actual, expected) = match form {
            ImageFormat::U8 => (f32::from(codes(&file)[7]), spikelane_io::light::srgb_code(0.4) * 255.0),
            ImageFormat::U16 => {
                (f32::from(image::open(&file).unwrap().into_luma16()[(7, 0)].0[0]), 0.4 * 65535.0)
            }
            ImageFormat::F32 => (floats(&file)[7], 0.4),
            _ => panic!("{form:?} has no test"),
        };
        assert!((actual - expected).abs() <= if form == ImageFormat::F32 { 1e-6 } else { 0.51 }, "{actual}");
        let facts = SequenceRecord::read(&sequence_folder, Access::Read).unwrap().facts;
        let transfer = if form == ImageFormat::U8 { "srgb" } else { "linear" };
        assert_eq!(facts["images"]["transfer"], transfer);
        assert_eq!((&facts["images"]["every"], &facts["images"]["format"]), (&6.into(), &form.name().into()));
    }
}

#[test]
fn resume_makes_a_sequence_with_a_damaged_clear_image_again() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    clip(&clips.join("a.npy"), &[0.1, 0.5]);
    let mut all = options(&dir.path().join("set"), inputs(&clips, 8), DatasetLayout::SpikeCv);
    all.images = ReferenceImageOptions { every: Some(5), format: ImageFormat::U16 };
    let sequence_folder = make(&all);
    let image = sequence_folder.join("images/000005.png");
    let good = fs::read(&image).unwrap();
    all.resume = true;
    for damage in ["cut", "gone"] {
        if damage == "cut" { fs::write(&image, &good[..9]) } else { fs::remove_file(&image) }.unwrap();
        assert_eq!(dataset::generate(&all, &mut |_| Ok(())).unwrap().generated, 1, "{damage}");
        assert!(fs::read(&image).unwrap() == good);
    }
    assert_eq!(dataset::generate(&all, &mut |_| Ok(())).unwrap().verified_sequences, 1);
    all.images.every = Some(4);
    assert_eq!(dataset::generate(&all, &mut |_| Ok(())).unwrap_err().kind(), ErrorKind::Config);
}

/// Tests the light of one readout of an input whose length is known only at its end. An input of unknown length is read
/// twice.
///
/// The light of the readout must be interpolated between frames as in the stream. The rounding error of floats is 6e-8.
#[test]
fn light_of_a_readout_is_interpolated_by_the_timeline() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.npy");
    clip(&path, &[0.1, 0.5, 0.3]);
    let input_options = light::InputOptions::new(Geometry::new(WIDTH as u32, HEIGHT as u32).unwrap());
    let at = |readout, interpolation| {
        let mut source = light::open(&path, &input_options).unwrap();
        light_at(&mut *source, Timeline::from_readouts_per_frame(8, interpolation).unwrap(), readout)
            .map(|f| f.to_f32()[5])
    };
    for (readout, hold, linear) in
        [(0, 0.1, 0.1), (6, 0.1, 0.4), (8, 0.5, 0.5), (12, 0.5, 0.4), (23, 0.3, 0.3)]
    {
        assert!((at(readout, Interpolation::Hold).unwrap() - hold).abs() < 1e-6, "{readout}");
        assert!((at(readout, Interpolation::Linear).unwrap() - linear).abs() < 1e-6, "{readout}");
    }
    assert_eq!(at(24, Interpolation::Linear).unwrap_err().kind(), ErrorKind::Input);
}
