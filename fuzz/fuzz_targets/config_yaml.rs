//! Uses any bytes as the `config.yaml` in a folder above a stream. A reader must reject or ignore the bytes, or the
//! bytes must contain the frame size that the reader uses.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane_io::formats::{GeometryOrigin, StreamReader};

static STREAM: LazyLock<PathBuf> = LazyLock::new(|| {
    let stream = spikelane_fuzz::temp_folder("config-yaml").join("s.dat");
    std::fs::write(&stream, [0x5a; 5040]).expect("a temporary file");
    stream
});

fuzz_target!(|data: &[u8]| {
    std::fs::write(STREAM.with_file_name("config.yaml"), data).expect("a temporary file");
    match StreamReader::open(&STREAM, None, None) {
        Ok(reader) => {
            assert!(matches!(reader.origin(), GeometryOrigin::Dataset(_)));
            let text = String::from_utf8_lossy(data);
            let g = reader.geometry();
            assert!(text.contains(&g.width().to_string()) && text.contains(&g.height().to_string()), "{g}");
        }
        Err(error) => {
            assert!(
                matches!(error.kind(), ErrorKind::Config | ErrorKind::Input | ErrorKind::Usage),
                "{error}"
            );
        }
    }
});
