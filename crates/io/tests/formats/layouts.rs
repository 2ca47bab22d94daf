//! Checks every layout against a rule that gives the position of each bit.

use proptest::prelude::*;
use spikelane::spikes::{bit, set_bit};
use spikelane::{ErrorKind, Geometry};
use spikelane_io::formats::Layout;

/// Returns pseudorandom spikes. The test needs a pattern in which no two rows are equal.
fn spikes(geometry: Geometry, seed: u64) -> Vec<u8> {
    let mut state = seed | 1;
    let mut frame = vec![0; geometry.frame_bytes()];
    for p in 0..geometry.pixels() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        if state >> 63 == 1 {
            set_bit(&mut frame, p);
        }
    }
    frame
}

fn encoded(layout: Layout, geometry: Geometry, packed: &[u8]) -> Vec<u8> {
    // The buffer is filled with nonzero bytes, so that the test detects padding that the encoder does not write.
    let mut file = vec![0xa5; layout.frame_bytes(geometry).unwrap()];
    layout.encode_frame(geometry, packed, &mut file).unwrap();
    file
}

fn decoded(layout: Layout, geometry: Geometry, file: &[u8]) -> Vec<u8> {
    let mut packed = vec![0x5a; geometry.frame_bytes()];
    layout.decode_frame(geometry, file, &mut packed).unwrap();
    packed
}

/// Returns the bit position of pixel (row, col) in the file, according to the rule of the layout.
fn place(layout: Layout, g: Geometry, row: usize, col: usize) -> usize {
    let from_bottom = g.height() - 1 - row;
    match layout {
        Layout::Dat => from_bottom * g.width() + col,
        Layout::DatTop => row * g.width() + col,
        Layout::Rows416 => from_bottom * 416 + col,
        Layout::Rows1024 => row * 1024 + col + if col < 500 { 0 } else { 12 },
        Layout::NpyBits => row * g.width().div_ceil(8) * 8 + col,
        Layout::NpyBytes => (row * g.width() + col) * 8,
        Layout::DatMsb => reversed_bit(place(Layout::Dat, g, row, col)),
        Layout::DatTopMsb => reversed_bit(place(Layout::DatTop, g, row, col)),
        Layout::NpyBitsMsb => reversed_bit(place(Layout::NpyBits, g, row, col)),
        _ => unreachable!("a layout without a rule here"),
    }
}

/// Returns the bit position that is mirrored within the same byte.
fn reversed_bit(bit: usize) -> usize {
    bit / 8 * 8 + 7 - bit % 8
}

fn check_rule(layout: Layout, g: Geometry, seed: u64) {
    let packed = spikes(g, seed);
    let file = encoded(layout, g, &packed);
    let mut expected = vec![0u8; file.len()];
    for row in 0..g.height() {
        for col in 0..g.width() {
            if bit(&packed, row * g.width() + col) {
                set_bit(&mut expected, place(layout, g, row, col));
            }
        }
    }
    if layout == Layout::Rows1024 {
        // The twelve tag bits of each half row are not pixels. A separate test checks the tags.
        for half in file.chunks(64).zip(expected.chunks_mut(64)) {
            half.1[62] |= half.0[62] & 0xf0;
            half.1[63] = half.0[63];
        }
    }
    assert!(file == expected, "{layout} {g}");
    assert!(decoded(layout, g, &file) == packed, "{layout} {g} back");
}

fn any_size() -> impl Strategy<Value = Geometry> {
    // Half of the widths are multiples of 8, so that the faster code for multiples of 8 is tested as well.
    let width = prop_oneof![1u32..200, (1u32..40).prop_map(|w| w * 8)];
    (width, 1u32..40).prop_map(|(w, h)| Geometry::new(w, h).unwrap())
}

const ANY_SIZE_LAYOUTS: [Layout; 7] = [
    Layout::Dat,
    Layout::DatTop,
    Layout::NpyBits,
    Layout::NpyBytes,
    Layout::DatMsb,
    Layout::DatTopMsb,
    Layout::NpyBitsMsb,
];

proptest! {
    #[test]
    fn each_pixel_lies_where_the_rule_says(g in any_size(), seed: u64) {
        for layout in ANY_SIZE_LAYOUTS {
            check_rule(layout, g, seed);
        }
    }

    #[test]
    fn bits_that_are_no_pixel_do_not_come_back(g in any_size(), seed: u64) {
        for layout in ANY_SIZE_LAYOUTS.into_iter().filter(|l| *l != Layout::NpyBytes) {
            let packed = spikes(g, seed);
            let mut file = encoded(layout, g, &packed);
            let mut is_pixel = vec![false; file.len() * 8];
            for p in 0..g.pixels() {
                is_pixel[place(layout, g, p / g.width(), p % g.width())] = true;
            }
            for b in (0..is_pixel.len()).filter(|&b| !is_pixel[b]) {
                set_bit(&mut file, b);
            }
            prop_assert_eq!(decoded(layout, g, &file), packed);
        }
    }
}

#[test]
fn one_pixel_is_a_whole_byte_in_every_layout() {
    let g = Geometry::new(1, 1).unwrap();
    for layout in ANY_SIZE_LAYOUTS {
        let first = if layout.name().ends_with("msb") { 0x80 } else { 1 };
        assert_eq!(encoded(layout, g, &[1]), [first], "{layout}");
        check_rule(layout, g, 3);
    }
}

#[test]
fn camera_sizes_follow_the_rule() {
    for (w, h) in [(400, 250), (1000, 1000), (250, 250)] {
        for layout in ANY_SIZE_LAYOUTS {
            check_rule(layout, Geometry::new(w, h).unwrap(), 7);
        }
    }
    check_rule(Layout::Rows416, Geometry::new(400, 250).unwrap(), 8);
    check_rule(Layout::Rows1024, Geometry::new(1000, 1000).unwrap(), 9);
}

#[test]
fn header_bits_of_416_bit_rows_are_zero_and_ignored() {
    let g = Geometry::new(400, 250).unwrap();
    let packed = spikes(g, 5);
    let mut file = encoded(Layout::Rows416, g, &packed);
    assert_eq!(file.len(), 13_000);
    for row in file.chunks_exact_mut(52) {
        assert_eq!(row[50..], [0, 0]);
        row[50..].fill(0xff);
    }
    assert_eq!(decoded(Layout::Rows416, g, &file), packed);
}

#[test]
fn tags_of_1024_bit_rows_are_where_spikecv_reads_them() {
    let g = Geometry::new(1000, 1000).unwrap();
    // Every pixel fires, so the four pixel bits beside each tag are set.
    let file = encoded(Layout::Rows1024, g, &vec![0xff; 125_000]);
    assert_eq!(file.len(), 128_000);
    let tag = |end: usize| {
        let word = u16::from(file[end - 1]) << 8 | u16::from(file[end - 2]);
        assert_eq!(word & 0xf, 0xf, "the last pixels of the half row ending at {end}");
        ((word & 0x3ff0) >> 4, (word & 0xc000) >> 14)
    };
    assert_eq!(tag(64), (500, 0));
    assert_eq!(tag(128_000), (500, 3));
    for end in (64..=128_000).step_by(64) {
        assert!((1..=500).contains(&tag(end).0));
    }
}

#[test]
fn a_camera_layout_holds_only_its_camera() {
    let other = Geometry::new(640, 480).unwrap();
    for layout in [Layout::Rows416, Layout::Rows1024] {
        let error = layout.frame_bytes(other).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("640x480"), "{error}");
    }
}

#[test]
fn names_parse_back_and_an_unknown_one_lists_them() {
    for layout in Layout::ALL {
        assert_eq!(Layout::parse(layout.name()).unwrap(), layout);
    }
    let error = Layout::parse("avi").unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert!(error.to_string().contains("rows1024"), "{error}");
}

#[test]
fn a_file_of_npy_begins_as_numpy_writes_it() {
    let g = Geometry::new(13, 5).unwrap();
    for (layout, shape) in [(Layout::NpyBits, "(7, 5, 2)"), (Layout::NpyBytes, "(7, 5, 13)")] {
        let header = layout.header(g, 7).unwrap();
        assert_eq!(&header[..8], b"\x93NUMPY\x01\x00");
        let text = usize::from(u16::from_le_bytes([header[8], header[9]]));
        assert_eq!(header.len(), 10 + text);
        assert_eq!(header.len() % 64, 0, "data must be aligned");
        assert_eq!(*header.last().unwrap(), b'\n');
        let dict = std::str::from_utf8(&header[10..]).unwrap().trim_end();
        assert_eq!(dict, format!("{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}"));
        let data = 7 * layout.frame_bytes(g).unwrap();
        assert_eq!(layout.file_bytes(g, 7).unwrap(), (header.len() + data) as u64);
    }
}

#[test]
fn a_stream_longer_than_any_file_is_refused() {
    let g = Geometry::new(400, 250).unwrap();
    for layout in [Layout::Dat, Layout::NpyBytes] {
        let error = layout.file_bytes(g, u64::MAX / 2).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
    }
}
