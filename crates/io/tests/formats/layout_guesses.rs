//! Tests that wrong layouts and geometries are detected, and that right layouts and geometries are never reported as
//! wrong.

use spikelane::Geometry;
use spikelane::error::render_settings;
use spikelane::spikes::set_bit;
use spikelane::unstable::draws::hash::mix64;
use spikelane_io::formats::{Codec, Layout, StreamReader};

/// Uniform random numbers from 0 to 1.
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Returns packed frames. Each pixel starts with a random charge, adds `rate` per readout and fires at a charge of 1.
fn fire(g: Geometry, readouts: usize, seed: u64, rate: impl Fn(usize, usize, &mut Draws) -> f64) -> Vec<u8> {
    let mut draws = Draws(seed);
    let mut packed = vec![0; readouts * g.frame_bytes()];
    for p in 0..g.pixels() {
        let rate = rate(p / g.width(), p % g.width(), &mut draws).clamp(0.0, 1.0);
        let mut charge = draws.next();
        for frame in packed.chunks_exact_mut(g.frame_bytes()) {
            charge += rate;
            if charge >= 1.0 {
                charge -= 1.0;
                set_bit(frame, p);
            }
        }
    }
    packed
}

fn file(layout: Layout, g: Geometry, packed: &[u8]) -> Vec<u8> {
    let codec = Codec::new(layout, g).unwrap();
    let readouts = packed.len() / g.frame_bytes();
    let mut bytes = layout.header(g, readouts as u64).unwrap();
    let start = bytes.len();
    bytes.resize(start + readouts * codec.frame_bytes(), 0);
    codec.encode(packed, &mut bytes[start..]).unwrap();
    bytes
}

fn geometry(width: u32, height: u32) -> Geometry {
    Geometry::new(width, height).unwrap()
}

/// Returns a smooth light pattern.
fn scene(row: usize, col: usize) -> f64 {
    let (y, x) = (row as f64, col as f64);
    0.3 + 0.12 * (x / 11.0 + y / 23.0).sin()
        + 0.1 * (y / 7.0 - x / 31.0).cos()
        + 0.06 * (x / 5.0).sin() * (y / 4.0).cos()
}

/// Returns light without image content, or light with a regular pattern.
fn light(kind: usize, row: usize, col: usize, draws: &mut Draws) -> f64 {
    let noise = draws.next() - 0.5;
    let of_row = Draws(row as u64 * 7919).next() - 0.5;
    let of_col = Draws(col as u64 * 104_729).next() - 0.5;
    let stripes = |n: usize, period: usize| if n % period < period.div_ceil(2) { 0.1 } else { 0.5 };
    // The cells of these checkerboards are not a whole number of pixels wide or high.
    let cells =
        |across: f64, down: f64| stripes((col as f64 / across) as usize + (row as f64 / down) as usize, 2);
    match kind {
        0 => 0.2,
        1 => 0.2 * (1.0 + 0.1 * noise),
        // A dark recording with hot pixels.
        2 => 0.004 * (1.0 + noise) + if draws.next() < 0.002 { 0.4 } else { 0.0 },
        3 => 0.0,
        4 => 0.3 * (1.0 + 0.2 * of_row + 0.05 * noise),
        5 => 0.3 * (1.0 + 0.2 * of_col + 0.05 * noise),
        6 => stripes(row, 2),
        7 => stripes(row, 3 + col / 1000),
        8 => stripes(row, 5) + 0.1 * noise,
        9 => stripes(col, 2),
        10 => stripes(col, 3),
        11 => stripes(col, 5) + 0.1 * noise,
        12 => stripes(col, 8),
        13 => stripes(col, 16),
        14 => stripes(row + col, 2),
        15 => stripes(row + 2 * col, 7),
        16 => scene(row, col),
        17 => scene(row, col) * stripes(row, 2),
        18 => 0.6 * (row as f64 / 250.0) + 0.1,
        19 => 0.25 + 0.5 * (draws.next() - 0.5),
        20 => cells(6.25, 2.5),
        21 => cells(3.25, 2.5) + 0.1 * noise,
        22 => cells(8.0, 6.0),
        _ => cells(5.0, 1.5),
    }
}

#[test]
fn none_of_360_correct_layouts_is_rejected() {
    let layouts =
        [Layout::Dat, Layout::DatTop, Layout::DatMsb, Layout::NpyBits, Layout::NpyBytes, Layout::NpyBitsMsb];
    let sizes = [(64, 48), (48, 64), (104, 60), (61, 45), (200, 40), (128, 96), (100, 60), (400, 250)];
    for case in 0..360 {
        let kind = case % 24;
        let (w, h) = sizes[(case / 24 + kind) % if kind % 5 == 0 { 8 } else { 7 }];
        let g = geometry(w, h);
        let readouts = [1, 2, 5, 10, 20, 100][(case / 3) % 6];
        let packed = fire(g, readouts, case as u64, |r, c, d| light(kind, r, c, d));
        let layout = layouts[case % layouts.len()];
        let reader = StreamReader::from_bytes("s", file(layout, g, &packed), Some(layout), Some(g)).unwrap();
        let readings = reader.layout_guesses().unwrap();
        assert!(
            readings.better_guess.is_none(),
            "light {kind}, {readouts} readouts of {g} in {layout}: {:?}",
            readings.warning()
        );
    }
}

#[test]
fn correct_camera_rows_are_not_rejected() {
    for (layout, g) in [(Layout::Rows416, geometry(400, 250)), (Layout::Rows1024, geometry(1000, 1000))] {
        for (kind, readouts) in [(0, 10), (4, 3), (16, 1), (16, 20), (3, 2)] {
            let packed = fire(g, readouts, 5, |r, c, d| light(kind, r, c, d));
            let reader = StreamReader::from_bytes("s", file(layout, g, &packed), Some(layout), None).unwrap();
            assert!(reader.layout_guesses().unwrap().better_guess.is_none(), "{layout} {kind} {readouts}");
        }
    }
}

#[test]
fn swapped_sides_and_wrong_shapes_are_detected() {
    let g = geometry(64, 48);
    let bytes = file(Layout::Dat, g, &fire(g, 24, 3, |r, c, _| scene(r, c)));
    for (w, h) in [(48, 64), (96, 32), (32, 96)] {
        let reader = StreamReader::from_bytes("s", bytes.clone(), None, Some(geometry(w, h))).unwrap();
        let readings = reader.layout_guesses().unwrap();
        if (w, h) == (32, 96) {
            // If the assumed width is half the true width, the rate map cannot be distinguished from a texture that
            // changes at every second row.
            continue;
        }
        let better = readings.better_guess.unwrap_or_else(|| panic!("{w}x{h}: {readings:?}"));
        assert_eq!(better.geometry, g, "{w}x{h}");
        assert!(better.row_correlation.unwrap() > 0.8, "{readings:?}");
        let text = readings.warning().unwrap();
        let warning = render_settings(&text, &|key| format!("`{key}`"));
        assert!(warning.contains("`width` to 64 and `height` to 48"), "{warning}");
    }
}

#[test]
fn rows_of_416_bits_read_as_dat_are_detected() {
    let g = geometry(400, 250);
    let bytes = file(Layout::Rows416, g, &fire(g, 25, 8, |r, c, _| scene(r, c)));
    let reader = StreamReader::from_bytes("s", bytes, None, Some(g)).unwrap();
    assert_eq!(reader.readouts(), 26);
    let readings = reader.layout_guesses().unwrap();
    assert_eq!(readings.better_guess.map(|b| b.layout), Some(Layout::Rows416), "{readings:?}");
    let warning = readings.warning().unwrap();
    let text = render_settings(&warning, &|key| format!("--{key}"));
    assert!(text.contains("set --layout to rows416"), "{text}");
}

#[test]
fn the_wrong_camera_is_detected() {
    let large = geometry(1000, 1000);
    let bytes = file(Layout::Dat, large, &fire(large, 4, 8, |r, c, _| scene(r, c)));
    let readings = StreamReader::from_bytes("s", bytes, None, Some(geometry(400, 250)))
        .unwrap()
        .layout_guesses()
        .unwrap();
    assert_eq!(readings.better_guess.map(|b| b.geometry), Some(large), "{readings:?}");
}

#[test]
fn the_wrong_bit_order_is_detected() {
    let g = geometry(64, 48);
    let packed = fire(g, 24, 3, |r, c, _| scene(r, c));
    for layout in Layout::ALL {
        let Some(other) = layout.other_bit_order() else { continue };
        let reader = StreamReader::from_bytes("s", file(layout, g, &packed), Some(other), Some(g)).unwrap();
        let better = reader.layout_guesses().unwrap().better_guess.unwrap_or_else(|| panic!("{layout}"));
        assert_eq!(better.layout, layout);
    }
}

#[test]
fn an_array_with_readouts_last_is_detected() {
    let g = geometry(64, 48);
    let packed = fire(g, 24, 3, |r, c, _| scene(r, c));
    let frames = file(Layout::NpyBytes, g, &packed);
    let data = &frames[frames.len() - 24 * 64 * 48..];
    // The axes of shape (48, 64, 24) are rows, columns and readouts.
    let mut bytes = Layout::NpyBytes.header(geometry(24, 64), 48).unwrap();
    bytes.extend((0..data.len()).map(|i| data[i % 24 * 3072 + i / 24]));
    let reader = StreamReader::from_bytes("a.npy", bytes.clone(), None, None).unwrap();
    assert_eq!(reader.layout_guesses().unwrap().better_guess.map(|b| b.geometry), Some(g));
    // A geometry from the caller determines the axis order.
    let reader = StreamReader::from_bytes("a.npy", bytes, None, Some(g)).unwrap();
    assert_eq!(reader.readouts(), 24);
    let mut read = vec![0; packed.len()];
    reader.read_frames(0, &mut read).unwrap();
    assert!(read == packed);
}
