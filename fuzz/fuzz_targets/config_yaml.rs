//! Any bytes as the `config.yaml` above a stream: refused or left aside, or the frames have a size that it names.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::Kind;
use spikelane_io::formats::{Origin, Reader};

static STREAM: LazyLock<PathBuf> = LazyLock::new(|| {
    let stream = spikelane_fuzz::folder("config-yaml").join("s.dat");
    std::fs::write(&stream, [0x5a; 5040]).expect("a temporary file");
    stream
});

fuzz_target!(|data: &[u8]| {
    std::fs::write(STREAM.with_file_name("config.yaml"), data).expect("a temporary file");
    match Reader::open(&STREAM, None, None) {
        Ok(reader) => {
            assert!(matches!(reader.origin(), Origin::DataSet(_)));
            let text = String::from_utf8_lossy(data);
            let g = reader.geometry();
            assert!(text.contains(&g.width().to_string()) && text.contains(&g.height().to_string()), "{g}");
        }
        Err(error) => {
            assert!(matches!(error.kind(), Kind::Config | Kind::Input | Kind::Usage), "{error}");
        }
    }
});
