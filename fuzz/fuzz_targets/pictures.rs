//! Any bytes as a picture of each format that is known by its content: refused, or light of the size that its header
//! declares, finite and not negative.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::Kind;
use spikelane_io::light::picture::{self, Linear};

static LINEAR: LazyLock<Linear> = LazyLock::new(|| Linear::new(None));

/// The first byte chooses the name, which decides where the content does not.
static FILES: LazyLock<Vec<PathBuf>> = LazyLock::new(|| {
    let folder = spikelane_fuzz::folder("pictures");
    ["png", "jpg", "tiff", "exr", "bmp", "ppm", "webp"].map(|e| folder.join(format!("a.{e}"))).into()
});

fuzz_target!(|data: &[u8]| {
    let Some((which, bytes)) = data.split_first() else { return };
    let path = &FILES[usize::from(*which) % FILES.len()];
    std::fs::write(path, bytes).expect("a temporary file");
    let check = |error: &spikelane::Error| {
        assert!(matches!(error.kind(), Kind::Input | Kind::Usage | Kind::Memory), "{error}");
    };
    match (picture::header(path), picture::read(path, &LINEAR)) {
        (Ok(header), Ok(frame)) => {
            assert_eq!(frame.geometry(), header.size);
            assert!(frame.to_f32().iter().all(|v| v.is_finite() && *v >= 0.0));
        }
        (Ok(_), Err(error)) | (Err(error), Err(_)) => check(&error),
        (Err(error), Ok(_)) => panic!("a picture without a header: {error}"),
    }
});
