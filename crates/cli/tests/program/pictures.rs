//! Tests folders of pictures that are not the frames of a video.

use crate::program_support::{TestFolder, exists};

/// Writes a picture of random squares of 8 pixels. Equal seeds give equal pictures.
fn picture(place: &TestFolder, name: &str, (width, height): (u32, u32), seed: u32) {
    let image = image::GrayImage::from_fn(width, height, |x, y| {
        let mix =
            |hash: u32, value: u32| ((hash ^ value).wrapping_mul(0x9E37_79B1)).rotate_left(13) ^ (hash >> 7);
        let hash = [seed, x / 8, y / 8, 1, 2].into_iter().fold(0x1234_5678, mix);
        image::Luma([(hash >> 24) as u8])
    });
    let path = place.path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image.save(path).unwrap();
}

/// Class folders: unrelated pictures of one size, of different sizes, and a single picture.
fn classes() -> TestFolder {
    let place = TestFolder::new();
    for (i, name) in ["beach", "dog", "house", "kite", "lamp"].iter().enumerate() {
        picture(&place, &format!("in/mixed/{name}.png"), (64, 64), i as u32);
    }
    for (i, name) in ["oak", "pine"].iter().enumerate() {
        picture(&place, &format!("in/trees/{name}.png"), (64, 32 + 16 * i as u32), 50 + i as u32);
    }
    picture(&place, "in/one/cat.png", (64, 64), 90);
    place
}

const CAMERA: &str = "--camera ideal --width 32 --height 32";

#[test]
fn a_dataset_of_unrelated_pictures_asks_what_they_are() {
    let place = classes();
    for folder in ["in", "in/mixed", "in/trees"] {
        let line = format!("dataset --from {folder} {CAMERA} -o set");
        place.run_refused(&line, 4, &["--stills", "--video"]);
    }
}

#[test]
fn every_still_becomes_a_sequence_with_its_class_as_label() {
    let place = classes();
    let ran = place.run_ok(&format!("dataset --from in --stills --readouts-per-frame 30 {CAMERA} -o set"));
    assert!(!ran.stderr.contains("ignored"), "{}", ran.stderr);
    let ids = std::fs::read_dir(place.path("set/sequences")).unwrap();
    let mut found: Vec<(String, String, u64)> = ids
        .map(|entry| {
            let id = entry.unwrap().file_name().to_string_lossy().into_owned();
            let record = place.json(&format!("set/sequences/{id}/record.json"));
            let label = record["facts"]["label"].as_str().unwrap().to_owned();
            assert!(id.starts_with(&format!("{label}-")), "{id}");
            (
                label,
                record["facts"]["input"].as_str().unwrap().to_owned(),
                record["facts"]["readouts"].as_u64().unwrap(),
            )
        })
        .collect();
    found.sort();
    assert_eq!(found.len(), 8);
    assert_eq!(found[5], ("one".to_owned(), "one/cat.png".to_owned(), 30));
}

#[test]
fn the_flag_video_makes_frames_of_unrelated_pictures() {
    let place = classes();
    let ran = place.run_ok(&format!("dataset --from in/mixed --video {CAMERA} -o set"));
    assert!(ran.stdout.contains("1 generated"), "{}", ran.stdout);
    place.run_ok(&format!("simulate in/mixed --video {CAMERA} -o a"));
}

#[test]
fn simulate_refuses_unrelated_pictures() {
    let place = classes();
    place.run_refused(&format!("simulate in/mixed {CAMERA} -o a"), 4, &["5 pictures", "--video"]);
    assert!(!exists(&place.path("a.dat")));
}

#[test]
fn the_frames_of_a_video_are_never_refused() {
    let place = TestFolder::new();
    for i in 0..6 {
        // Each frame differs from all others, as in fast cuts, so only the numbers show the order.
        picture(&place, &format!("cuts/img{:04}.png", 3 * i), (32, 32), i);
        // Without numbers, similar neighbors show the order.
        let name = char::from(b'a' + i as u8);
        let gray = image::GrayImage::from_fn(32, 32, |x, y| image::Luma([(5 * (x + i) + y) as u8]));
        std::fs::create_dir_all(place.path("words")).unwrap();
        gray.save(place.path(&format!("words/{name}.png"))).unwrap();
        picture(&place, &format!("timed/{name}.png"), (32, 32), i);
    }
    let times: String = (0..6).map(|i| format!("{:.3}\n", f64::from(i) * 0.001)).collect();
    place.write("timed/timestamps.txt", times);
    for folder in ["cuts", "words", "timed"] {
        let ran = place.run_ok(&format!("simulate {folder} {CAMERA} --readouts 20 -o {folder}"));
        assert!(exists(&place.path(&format!("{folder}.dat"))), "{}", ran.stderr);
    }
}

#[test]
fn a_list_of_class_folders_gives_stills_too() {
    let place = classes();
    place.write("list.txt", "\u{feff}in\\one\r\nin/trees/oak.png\r\n");
    let ran = place.run_ok(&format!("dataset --from-list list.txt --stills {CAMERA} -o set"));
    assert!(ran.stdout.contains("2 generated"), "{}", ran.stdout);
}
