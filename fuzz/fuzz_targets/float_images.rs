//! Uses any bytes as the samples of a `.pfm` or a `.hdr` image with a valid header. The decoder must reject the image, or
//! return finite light that is not negative.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane_io::light::image_file::{self, Linearization};

static LINEAR: LazyLock<Linearization> = LazyLock::new(|| Linearization::new(None));

static PATH: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::temp_folder("float").join("a.pfm"));

fuzz_target!(|data: &[u8]| {
    let &[kind, width, height, ref samples @ ..] = data else { return };
    let (width, height) = (width % 40 + 1, height % 8 + 1);
    let header = match kind % 4 {
        0 => format!("PF\n{width} {height}\n-1.0\n"),
        1 => format!("Pf\n{width} {height}\n1.0\n"),
        2 => format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"),
        _ => format!("#?RGBE\n\n-Y {height} +X {width}\n"),
    };
    std::fs::write(&*PATH, [header.as_bytes(), samples].concat()).expect("a temporary file");
    let header = image_file::read_header(&PATH).expect("a valid header");
    assert_eq!((header.size.width(), header.size.height()), (width.into(), height.into()));
    match image_file::read(&PATH, &LINEAR) {
        Ok(frame) => {
            assert_eq!(frame.geometry(), header.size);
            assert!(frame.to_f32().iter().all(|v| v.is_finite() && *v >= 0.0));
        }
        Err(error) => assert_eq!(error.kind(), ErrorKind::Input, "{error}"),
    }
});
