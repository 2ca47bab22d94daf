//! Uses any bytes as the sidecar of a stream. The stream reader must reject the bytes, or have the geometry and the
//! layout that a general JSON parser reads from the bytes.
//!
//! A new sidecar with these values must open the same stream.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use serde_json::{Value, json};
use spikelane::ErrorKind;
use spikelane_io::formats::{Layout, StreamReader};

/// A stream whose length is a multiple of the frame sizes of many geometries. Its sidecar is in the same folder.
static STREAM: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("spikelane-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let stream = folder.join("s.dat");
    let bytes: Vec<u8> = (0..5040u32).map(|i| (i * 37 >> 3) as u8).collect();
    std::fs::write(&stream, bytes).expect("a temporary file");
    stream
});

fn open(sidecar: &[u8]) -> spikelane::Result<StreamReader> {
    std::fs::write(STREAM.with_extension("json"), sidecar).expect("a temporary file");
    StreamReader::open(&STREAM, None, None)
}

fuzz_target!(|data: &[u8]| {
    let reader = match open(data) {
        Ok(reader) => reader,
        Err(error) => {
            let kinds = [ErrorKind::Config, ErrorKind::Input, ErrorKind::Usage];
            assert!(kinds.contains(&error.kind()), "{error}");
            assert!(error.to_string().len() > 10);
            return;
        }
    };
    let g = reader.geometry();
    let value: Value = serde_json::from_slice(data).expect("accepted, so it is JSON");
    // Layouts with a fixed geometry may omit width and height.
    if let (Some(w), Some(h)) = (value["width"].as_u64(), value["height"].as_u64()) {
        assert_eq!((g.width() as u64, g.height() as u64), (w, h));
    }
    match value["layout"].as_str() {
        Some(name) => assert_eq!(reader.layout(), Layout::parse(name).expect("accepted")),
        None => assert_eq!(reader.layout(), Layout::Dat),
    }
    if let Some(readouts) = value["readouts"].as_u64() {
        // A truncated recording has fewer readouts than its sidecar declares.
        assert!(reader.readouts() as u64 <= readouts);
    }
    let facts = json!({
        "width": g.width(), "height": g.height(),
        "layout": reader.layout().name(), "readouts": reader.readouts(),
    });
    let again = open(facts.to_string().as_bytes()).expect("the facts of an accepted sidecar");
    assert_eq!((again.geometry(), again.layout(), again.readouts()), (g, reader.layout(), reader.readouts()));
    let mut frames = [vec![0; g.frame_bytes()], vec![0; g.frame_bytes()]];
    for (reader, frame) in [reader, again].iter().zip(&mut frames) {
        let _ = reader.read_frame(0, frame);
    }
    assert_eq!(frames[0], frames[1]);
});
