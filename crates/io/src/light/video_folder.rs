//! Decides whether the pictures of a folder are the frames of a video.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::images::folder::{check_same_size, list_images};
use super::images::image_file::ImageFile;
use super::images::linearization::Linearization;
use super::images::names::decimal_numbers;
use super::resize_mode::ResizeMode;
use super::timestamps;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::Access;

/// Maximum number of pairs of neighbors whose content is compared.
const MAX_PAIRS: usize = 8;

/// Sides in pixels of the reduced pictures that are compared.
const REDUCED_SIDE: u32 = 16;

/// Neighbors with at least this correlation are frames of a video.
///
/// Of pairs of 22 unrelated photographs, 95 % correlate by less than 0.31. In a video of a lake, frames at a distance of 1 s
/// correlate by 0.76, and in driving scenes at 5 frames per second, by 0.78.
const MIN_CORRELATION: f64 = 0.4;

/// Checks that the pictures of a folder are the frames of a video.
///
/// The criteria in this order are:
/// 1. A folder with frame times is a video.
/// 2. Pictures of different sizes are no video.
/// 3. Pictures with numbered names are a video: more than half of the names differ from the next name in one number only,
///    by regular steps.
/// 4. Other pictures are a video if most neighbors correlate, or if neighbors are more similar than distant pictures. In
///    a folder of unrelated pictures, the order has no meaning, so half of the neighbors are more similar, and 7 of 8
///    are with a probability of 4 %.
///
/// Pictures and times that cannot be read are not examined, because the reader of the folder reports them. If
/// `follow_links` is true, pictures and times may be links to files outside the folder.
///
/// # Errors
/// * [`ErrorKind::Io`] if the folder cannot be listed.
/// * [`ErrorKind::Input`] if the pictures are unrelated, or if a picture is a link that is not allowed.
pub fn check_is_video(folder: &Path, follow_links: bool) -> Result<()> {
    let access = Access::for_reading(follow_links);
    let (files, ..) = list_images(folder, access)?;
    let times = timestamps::read_beside(folder, &files, access, &mut Vec::new());
    if files.len() < 2 || !matches!(times, Ok(None)) {
        return Ok(());
    }
    check_sizes(&files)?;
    let names = files.iter().map(|file| file.file_stem().unwrap_or_default().to_string_lossy().into_owned());
    if are_numbered(&names.collect::<Vec<_>>()) || are_similar(&files, &mut |file| reduced(file).ok()) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, folder.display())
        .found(format_args!("{} without a common numbering, whose neighbors differ", Count(files.len(), "picture")))
        .expected("the frames of a video, such as 0001.png, 0002.png")
        .remedy(format_args!(
            "set {} if the pictures are the frames of a video in the order of their names, or simulate each picture alone",
            Setting("video")
        )))
}

/// Checks the sizes of the first, the last and some other pictures.
fn check_sizes(files: &[PathBuf]) -> Result<()> {
    let size = |file: &Path| ImageFile::open(file).map(|image| image.size).ok();
    let Some(first) = size(&files[0]) else { return Ok(()) };
    for file in (1..=MAX_PAIRS).map(|k| &files[k * (files.len() - 1) / MAX_PAIRS]) {
        if let Some(found) = size(file) {
            check_same_size(file, found, &files[0], first)?;
        }
    }
    Ok(())
}

/// Returns whether more than half of the neighbors differ in one number only, by a step within 25 % of the median step.
///
/// Frame numbers have equal steps, and times of frames nearly equal steps. The gaps between random numbers are
/// exponentially distributed: 17 % are within 25 % of the median.
fn are_numbered(names: &[String]) -> bool {
    let stems: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut steps: Vec<f64> = match decimal_numbers(&stems) {
        Some(numbers) => numbers.windows(2).map(|pair| pair[1] - pair[0]).collect(),
        None => names.windows(2).filter_map(|pair| step(&pair[0], &pair[1])).collect(),
    };
    steps.sort_by(f64::total_cmp);
    let Some(&median) = steps.get(steps.len() / 2) else { return false };
    let regular = steps.iter().filter(|&&step| 4.0 * (step - median).abs() <= median).count();
    2 * regular > names.len() - 1
}

/// Returns the difference of the only number in which two names differ.
fn step(a: &str, b: &str) -> Option<f64> {
    let (a, b) = (parts(a), parts(b));
    let mut differing = a.iter().zip(&b).filter(|(a, b)| a != b);
    let (a, b) = match (a.len() == b.len(), differing.next(), differing.next()) {
        (true, Some(pair), None) => pair,
        _ => return None,
    };
    Some(b.parse::<u128>().ok()?.checked_sub(a.parse().ok()?)? as f64)
}

/// Splits a name into runs of digits and of other characters.
fn parts(name: &str) -> Vec<&str> {
    let is_digit = |c: char| c.is_ascii_digit();
    let (mut parts, mut rest) = (Vec::new(), name);
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c| is_digit(c) != is_digit(first)).unwrap_or(rest.len());
        let (part, behind) = rest.split_at(end);
        parts.push(part);
        rest = behind;
    }
    parts
}

/// Returns whether most neighbors correlate, or more than three quarters of [`MAX_PAIRS`] neighbors are more similar than
/// distant pictures. `read` returns the values of a reduced picture.
fn are_similar(files: &[PathBuf], read: &mut dyn FnMut(&Path) -> Option<Vec<f32>>) -> bool {
    let mut pictures = BTreeMap::new();
    let mut similarity = |a: usize, b: usize| -> Option<f64> {
        for i in [a, b] {
            pictures.entry(i).or_insert_with(|| read(&files[i]));
        }
        Some(correlation(pictures[&a].as_deref()?, pictures[&b].as_deref()?))
    };
    let pairs = MAX_PAIRS.min(files.len() - 1);
    let (mut near, mut closer, mut compared) = (Vec::new(), 0, 0);
    for i in (0..pairs).map(|k| k * (files.len() - 1) / pairs) {
        let Some(neighbors) = similarity(i, i + 1) else { continue };
        near.push(neighbors);
        let distant = (i + files.len() / 2) % files.len();
        if let Some(far) = similarity(i, distant).filter(|_| distant.abs_diff(i) > 1) {
            compared += 1;
            closer += usize::from(neighbors > far);
        }
    }
    near.sort_by(f64::total_cmp);
    let Some(median) = near.get(near.len() / 2) else { return true };
    *median >= MIN_CORRELATION || (compared == MAX_PAIRS && 4 * closer > 3 * compared)
}

/// Returns the square roots of the light of a picture at a small size.
fn reduced(path: &Path) -> Result<Vec<f32>> {
    let image = ImageFile::open(path)?;
    let light = image.light(image.read_page(0, &mut Vec::new())?, &Linearization::new(None))?;
    let small = ResizeMode::Stretch.apply(light, Geometry::new(REDUCED_SIDE, REDUCED_SIDE)?)?;
    Ok(small.to_f32().iter().map(|light| light.sqrt()).collect())
}

/// Returns the correlation of two pictures. It does not change if the lighting does. A uniform picture correlates with
/// every picture.
fn correlation(a: &[f32], b: &[f32]) -> f64 {
    let deviations = |values: &[f32]| -> Vec<f64> {
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
        values.iter().map(|&v| f64::from(v) - mean).collect()
    };
    let (a, b) = (deviations(a), deviations(b));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let norm = (dot(&a, &a) * dot(&b, &b)).sqrt();
    if norm > 1e-9 { dot(&a, &b) / norm } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(names: &[&str]) -> bool {
        are_numbered(&names.iter().map(ToString::to_string).collect::<Vec<_>>())
    }

    #[test]
    fn frame_numbers_and_times_are_a_numbering() {
        for names in [
            &["0001", "0002", "0003"][..],
            &["img_9_left", "img_10_left", "img_11_left"],
            &["f1", "f2", "f3", "f7", "f8", "f9"],
            &["cut1_001", "cut1_002", "cut1_003", "cut2_001", "cut2_002"],
            &["1403636579763", "1403636579813", "1403636579864", "1403636579913"],
            &["1305031102.175304", "1305031102.211214", "1305031102.243211", "1305031102.275326"],
            &["frame_-0.5", "frame_-0.25", "frame_0", "frame_0.25"],
            &["120000000000000000000000000001", "120000000000000000000000000002"],
        ] {
            assert!(numbered(names), "{names:?}");
        }
    }

    #[test]
    fn words_and_scattered_numbers_are_no_numbering() {
        for names in [
            &["beach", "dog", "house"][..],
            &["left", "right"],
            &["000000000139", "000000000285", "000000000632", "000000000724", "000000000776", "000000001490"],
            &["n01440764_10026", "n01440764_10027", "n01440764_10034", "n01440764_10045", "n01440764_10110"],
            &["3f2a", "7c01", "b2d4"],
        ] {
            assert!(!numbered(names), "{names:?}");
        }
    }

    /// Returns a picture of smooth random patches. Equal seeds give equal pictures, and `shift` moves the picture.
    fn picture(seed: u64, shift: f64) -> Vec<f32> {
        let side = REDUCED_SIDE as usize;
        // The hash of SplitMix64.
        let wave = |k: u64| {
            let mut hash = (64 * seed + k).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            hash = (hash ^ (hash >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            hash = (hash ^ (hash >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((hash ^ (hash >> 31)) >> 40) as f64 / f64::from(1 << 24)
        };
        let value = |p: usize| {
            let (x, y) = ((p % side) as f64 / side as f64 - shift, (p / side) as f64 / side as f64);
            let term = |k: u64| {
                let (fx, fy) = (3.0 * wave(3 * k), 3.0 * wave(3 * k + 1));
                (std::f64::consts::TAU * (fx * x + fy * y + wave(3 * k + 2))).cos()
            };
            (0..6).map(term).sum::<f64>() as f32
        };
        (0..side * side).map(value).collect()
    }

    fn similar(pictures: &[Vec<f32>]) -> bool {
        let files: Vec<PathBuf> = (0..pictures.len()).map(|i| PathBuf::from(i.to_string())).collect();
        are_similar(&files, &mut |file| Some(pictures[file.to_str()?.parse::<usize>().ok()?].clone()))
    }

    #[test]
    fn moving_cut_and_flickering_scenes_are_similar() {
        let fast: Vec<_> = (0..12).map(|i| picture(1, 0.08 * f64::from(i))).collect();
        assert!(similar(&fast));
        let cuts: Vec<_> = (0..12).map(|i| picture(i / 3, 0.02 * i as f64)).collect();
        assert!(similar(&cuts));
        let flicker: Vec<_> = (0..12)
            .map(|i| picture(2, 0.0).iter().map(|v| v * if i % 2 == 0 { 0.1 } else { 3.0 } + 1.0).collect())
            .collect();
        assert!(similar(&flicker));
    }

    #[test]
    fn uniform_and_unreadable_pictures_are_similar() {
        assert!(similar(&[vec![0.2; 256], vec![0.9; 256], vec![0.4; 256]]));
        assert!(are_similar(&[PathBuf::from("a"), PathBuf::from("b")], &mut |_| None));
    }

    #[test]
    fn unrelated_pictures_are_not_similar() {
        let found =
            (0..40).filter(|set| !similar(&(0..9).map(|i| picture(100 * set + i, 0.0)).collect::<Vec<_>>()));
        // The order of 9 of 256 sets is similar by chance.
        assert!(found.count() >= 34);
    }
}
