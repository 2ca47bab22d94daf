//! Uses any bytes as a TIFF stack, an animated PNG or an animated WebP. The file must be rejected, or each page must be
//! rejected or have finite light that is not negative. There are at most as many pages as the header states.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane::light::Frame;
use spikelane_fuzz::temp_folder;
use spikelane_io::light::{InputOptions, image_file, open};

/// Maximum size of a page. Larger pages only make the target slow.
const MAX_PIXELS: usize = 1 << 16;

/// Maximum number of pages that are read.
const MAX_PAGES: u64 = 16;

static PATH: LazyLock<PathBuf> = LazyLock::new(|| temp_folder("pages").join("a.png"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(&*PATH, data).expect("a temporary file");
    if let Err(error) = read() {
        let kinds = [ErrorKind::Input, ErrorKind::Usage, ErrorKind::Memory];
        assert!(kinds.contains(&error.kind()), "{:?}: {error}", error.kind());
    }
});

fn read() -> spikelane::Result<()> {
    let header = image_file::read_header(&PATH)?;
    if header.size.pixels() > MAX_PIXELS {
        return Ok(());
    }
    let mut source = open(&PATH, &InputOptions::new(header.size))?;
    if let Some(times) = source.frame_times() {
        assert!(times.is_sorted());
    }
    let mut frame = Frame::dark(source.geometry());
    let mut pages = 0;
    while pages < MAX_PAGES && source.next_frame(&mut frame)? {
        assert_eq!(frame.geometry(), header.size);
        assert!(frame.to_f32().iter().all(|v| v.is_finite() && *v >= 0.0));
        pages += 1;
    }
    assert!(pages <= header.pages);
    Ok(())
}
