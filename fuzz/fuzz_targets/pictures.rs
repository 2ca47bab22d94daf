//! Uses any bytes as an image of each format that is detected by content.
//!
//! The decoder must reject the image, or return light of the size that the header declares. Light must be finite and
//! not negative.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane_io::light::image_file::{self, Linearization};

static LINEAR: LazyLock<Linearization> = LazyLock::new(|| Linearization::new(None));

/// One file per format, with the usual extension. The first byte of the input selects the file. If the content does not
/// determine the format, the extension does.
static FILES: LazyLock<Vec<PathBuf>> = LazyLock::new(|| {
    let folder = spikelane_fuzz::temp_folder("pictures");
    ["png", "jpg", "tiff", "exr", "bmp", "ppm", "webp", "fits"].map(|e| folder.join(format!("a.{e}"))).into()
});

fuzz_target!(|data: &[u8]| {
    let Some((which, bytes)) = data.split_first() else { return };
    let path = &FILES[usize::from(*which) % FILES.len()];
    std::fs::write(path, bytes).expect("a temporary file");
    let check = |error: &spikelane::Error| {
        assert!(matches!(error.kind(), ErrorKind::Input | ErrorKind::Usage | ErrorKind::Memory), "{error}");
    };
    match (image_file::read_header(path), image_file::read(path, &LINEAR)) {
        (Ok(header), Ok(frame)) => {
            assert_eq!(frame.geometry(), header.size);
            assert!(frame.to_f32().iter().all(|v| v.is_finite() && *v >= 0.0));
        }
        (Ok(_), Err(error)) | (Err(error), Err(_)) => check(&error),
        (Err(error), Ok(_)) => panic!("a picture without a header: {error}"),
    }
});
