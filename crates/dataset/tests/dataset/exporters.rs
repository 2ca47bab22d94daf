//! Tests of the exports for loaders. The exports are the labels of a split in the formats of COCO, MOT, KITTI and
//! SpikeCV, and the Croissant file.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;
use spikelane_dataset::{Access, DatasetLayout, DatasetOptions, Manifest, Split, Splits};

use crate::generate::{generate_dataset, inputs, options, scene_content};
use spikelane_io::formats::StreamReader;

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))).unwrap()
}

/// Generates three scenes in the training split.
fn scenes(root: &Path) -> DatasetOptions {
    let options = options(&root.join("set"), scene_content(3)).with_splits(Splits::default());
    generate_dataset(&options).unwrap();
    options
}

/// Returns the labeled readouts of a sequence from its `labels.json`.
fn frames(root: &Path, id: &str) -> Vec<Value> {
    json(&root.join("set/sequences").join(id).join("labels/labels.json"))["frames"]
        .as_array()
        .unwrap()
        .clone()
}

fn visible_boxes(frame: &Value) -> Vec<&Value> {
    let boxes = frame["boxes"].as_array().unwrap().iter();
    boxes.filter(|b| b["visible_pixels"].as_u64().unwrap() > 0).collect()
}

#[test]
fn coco_of_a_split_holds_every_annotation_under_a_number_of_its_own() {
    let dir = tempfile::tempdir().unwrap();
    scenes(dir.path());
    let merged = json(&dir.path().join("set/train/coco.json"));
    let (images, annotations) =
        (merged["images"].as_array().unwrap(), merged["annotations"].as_array().unwrap());
    let numbers = |all: &[Value]| all.iter().map(|v| v["id"].as_u64().unwrap()).collect::<BTreeSet<_>>();
    assert_eq!((numbers(images).len(), numbers(annotations).len()), (images.len(), annotations.len()));
    let mut expected = (0, 0);
    for id in ["scene-0000", "scene-0001", "scene-0002"] {
        let sequence_coco = json(&dir.path().join("set/sequences").join(id).join("labels/coco.json"));
        expected.0 += sequence_coco["images"].as_array().unwrap().len();
        expected.1 += sequence_coco["annotations"].as_array().unwrap().len();
        assert_eq!(sequence_coco["categories"], merged["categories"]);
        for image in images.iter().filter(|i| i["sequence"] == id) {
            assert!(dir.path().join("set").join(image["file_name"].as_str().unwrap()).is_file(), "{image}");
            let boxes_of = |all: &[Value], image: &Value| {
                let image_annotations = all.iter().filter(|a| a["image_id"] == image["id"]);
                image_annotations.map(|a| (a["track_id"].clone(), a["bbox"].clone())).collect::<Vec<_>>()
            };
            let there = sequence_coco["images"]
                .as_array()
                .unwrap()
                .iter()
                .find(|i| i["readout"] == image["readout"])
                .unwrap();
            assert_eq!(
                boxes_of(annotations, image),
                boxes_of(sequence_coco["annotations"].as_array().unwrap(), there)
            );
        }
    }
    assert_eq!((images.len(), annotations.len()), expected);
}

#[test]
fn tracks_are_those_of_the_labels_in_mots_and_kittis_text() {
    let dir = tempfile::tempdir().unwrap();
    scenes(dir.path());
    for id in ["scene-0000", "scene-0001", "scene-0002"] {
        let frames = frames(dir.path(), id);
        let mut tracks = Vec::new();
        for (i, frame) in frames.iter().enumerate() {
            tracks.extend(visible_boxes(frame).into_iter().map(|b| (i, b["track_id"].as_u64().unwrap())));
        }
        let read = |path: String| fs::read_to_string(dir.path().join("set/train").join(path)).unwrap();
        let columns = |text: &str, by: char, less: usize| -> Vec<(usize, u64)> {
            let two = |line: &str| {
                let words: Vec<_> = line.split(by).collect();
                (words[0].parse::<usize>().unwrap() - less, words[1].parse().unwrap())
            };
            text.lines().map(two).collect()
        };
        assert_eq!(columns(&read(format!("mot/{id}/gt/gt.txt")), ',', 1), tracks);
        let kitti = read(format!("kitti/label_02/{id}.txt"));
        assert_eq!(columns(&kitti, ' ', 0), tracks);
        assert!(kitti.lines().all(|line| line.split(' ').count() == 17), "{kitti}");
        let camera = &frames[0]["camera"];
        let calib = read(format!("kitti/calib/{id}.txt"));
        let p2: Vec<f64> = calib
            .lines()
            .find_map(|l| l.strip_prefix("P2: "))
            .unwrap()
            .split(' ')
            .map(|w| w.parse().unwrap())
            .collect();
        // In KITTI files, the center of the first pixel has coordinate 0, so 0.5 is added.
        assert_eq!(
            (p2[0], p2[2] + 0.5),
            (camera["focal_px"].as_f64().unwrap(), camera["center_px"][0].as_f64().unwrap())
        );
        let info = read(format!("mot/{id}/seqinfo.ini"));
        // At 20 kHz, labeled readouts that are 12 readouts apart have a rate of 20000 / 12 = 1666.67 per second.
        assert!(info.contains(&format!("seqLength={}\n", frames.len())), "{info}");
        assert!(info.contains("frameRate=1666.6666666666667\n"), "{info}");
    }
}

#[test]
fn spikecv_finds_each_kind_of_label_beside_its_own_configuration() {
    let dir = tempfile::tempdir().unwrap();
    scenes(dir.path());
    let at = |path: &str| dir.path().join("set/spikecv").join(path);
    for (kind, numbers, ending) in
        [("boxes", "[4, 5]", "txt"), ("depth", "[3.1]", "npy"), ("flow", "[2]", "flo")]
    {
        let config = fs::read_to_string(at(&format!("{kind}/config.yaml"))).unwrap();
        for line in [
            format!("labeled_data_type: {numbers}\n"),
            format!("labeled_data_suffix: {ending}\n"),
            format!("label_field_identifier: {kind}\n"),
        ] {
            assert!(config.contains(&line), "{config}");
        }
        assert!(at(&format!("{kind}/train/spike/scene-0001/scene-0001.dat")).is_file());
    }
    let bytes = |path: &Path| fs::read(path).unwrap();
    let labels_folder = dir.path().join("set/sequences/scene-0001/labels");
    assert_eq!(
        bytes(&at("depth/train/depth/scene-0001/000012.npy")),
        bytes(&labels_folder.join("000012.depth.npy"))
    );
    assert_eq!(
        bytes(&at("flow/train/flow/scene-0001/000000.flo")),
        bytes(&labels_folder.join("000000.forward.flo"))
    );
    assert!(!at("flow/train/flow/scene-0001/000012.flo").exists(), "the last readout has no flow");
    let mot = dir.path().join("set/train/mot/scene-0001/gt/gt.txt");
    assert_eq!(bytes(&at("boxes/train/boxes/scene-0001/scene-0001.txt")), bytes(&mot));
}

#[test]
fn labels_that_are_gone_come_back_with_the_sequence() {
    let dir = tempfile::tempdir().unwrap();
    let options = scenes(dir.path());
    // The digest is wrong, so the sequence must be generated again.
    let mut manifest = Manifest::read(&options.output, Access::Read).unwrap();
    assert_eq!(manifest.entries[2].split, Split::Train);
    manifest.entries[2].digest = Some(format!("blake3:{}", "0".repeat(64)));
    manifest.write(&options.output).unwrap();
    fs::remove_dir_all(options.output.join("train/mot/scene-0002")).unwrap();
    generate_dataset(&options.with_resume(true)).unwrap();
    assert!(dir.path().join("set/train/mot/scene-0002/gt/gt.txt").is_file());
}

#[test]
fn inputs_have_no_labels_but_croissant_names_their_tables() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    crate::generate::clip(&clips.join("a"), 200);
    let options = options(&dir.path().join("set"), inputs(&clips))
        .with_splits(Splits::default())
        .with_dataset_layout(DatasetLayout::SpikeCv)
        .with_data_version(Some("1.2.0".into()));
    generate_dataset(&options).unwrap();
    for path in ["train/coco.json", "train/mot", "spikecv"] {
        assert!(!options.output.join(path).exists(), "{path}");
    }
    let described = json(&options.output.join("croissant.json"));
    assert_eq!((&described["version"], &described["@type"]), (&"1.2.0".into(), &"sc:Dataset".into()));
    assert_eq!(described["license"], "https://spdx.org/licenses/CC-BY-4.0.html");
    assert_eq!(described["distribution"][0]["contentUrl"], "train/metadata.jsonl");
    assert_eq!(described["distribution"][0]["sha256"].as_str().unwrap().len(), 64);
    let fields = described["recordSet"][0]["field"].as_array().unwrap();
    assert!(fields.iter().any(|f| f["name"] == "input") && fields.iter().all(|f| f["name"] != "scene_seed"));
}

/// Reads the files as the loader `CSPK` of SSL-CSC does: bit `i % 8` of byte `i / 8` is pixel `i` in row-major order from the
/// top, and the image is an array of the shape (1, 3, height, width).
#[test]
fn ssl_csc_folders_have_the_readouts_around_the_ground_truth() {
    let dir = tempfile::tempdir().unwrap();
    let scenes = spikelane_dataset::SceneContent::rhdd()
        .with_sequences(2)
        .with_images_per_scene(12)
        .with_readouts_per_image(4)
        .with_label_every(6)
        .with_lighting(vec![spikelane_scene::Lighting::Overcast]);
    let mut options = options(&dir.path().join("set"), spikelane_dataset::Content::Scenes(scenes))
        .with_dataset_layout(DatasetLayout::SslCsc)
        .with_splits(Splits::default());
    let refused = generate_dataset(&options).unwrap_err().to_string();
    assert!(refused.contains("gray camera") && refused.contains("RGGB"), "{refused}");
    options.camera.mosaic = Some("RGGB".parse().unwrap());
    generate_dataset(&options).unwrap();
    for id in ["scene-0000", "scene-0001"] {
        let sequence = dir.path().join("set/sequences").join(id);
        let stream = StreamReader::open(&sequence.join("stream.dat"), None, None).unwrap();
        let (geometry, pixels) = (stream.geometry(), 48 * 32);
        assert_eq!((geometry.width(), geometry.height()), (48, 32));
        let first = stream.readouts() / 2 - 20;
        let spikes = fs::read(dir.path().join("set/train/spk/spikelane").join(format!("{id}.dat"))).unwrap();
        assert_eq!(spikes.len(), 41 * pixels / 8);
        let readable = dir.path().join("set/train/spk/spikelane").join(format!("{id}.dat"));
        assert_eq!(StreamReader::open(&readable, None, None).unwrap().readouts(), 41);
        let mut packed = vec![0; 41 * geometry.frame_bytes()];
        stream.read_frames(first, &mut packed).unwrap();
        for (t, frame) in packed.chunks(geometry.frame_bytes()).enumerate() {
            for i in 0..pixels {
                let bit = spikes[t * pixels / 8 + i / 8] >> (i % 8) & 1 == 1;
                assert_eq!(bit, spikelane::spikes::bit(frame, i), "{id}, readout {t}, pixel {i}");
            }
        }
        let array = fs::read(dir.path().join("set/train/gt/spikelane").join(format!("{id}.npy"))).unwrap();
        let header = String::from_utf8_lossy(&array[..array.len() - 3 * pixels]).into_owned();
        assert!(header.contains("'|u1'") && header.contains("(1, 3, 32, 48)"), "{header}");
        let codes = &array[array.len() - 3 * pixels..];
        let image = image::open(sequence.join("gt.png")).unwrap().into_rgb8();
        for (i, pixel) in image.pixels().enumerate() {
            assert_eq!([0, 1, 2].map(|color| codes[color * pixels + i]), pixel.0);
        }
    }
}
