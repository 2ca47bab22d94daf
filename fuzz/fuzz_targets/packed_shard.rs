//! Uses any bytes as the tar of a packed shard. The tar must be rejected, or the files of its sequences must be rejected
//! or read.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_dataset::DatasetReader;
use spikelane_fuzz::{check_file_error, temp_folder};
use spikelane_io::formats::OpenOptions;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| temp_folder("shard"));

fuzz_target!(|data: &[u8]| {
    let path = FOLDER.join("000000.tar");
    std::fs::write(&path, data).expect("a temporary file");
    if let Err(error) = DatasetReader::open(&path, false).and_then(|reader| read(&reader)) {
        check_file_error(&error);
    }
    // Reading must not unpack the tar.
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 1);
});

fn read(reader: &DatasetReader) -> spikelane::Result<()> {
    for entry in reader.done_entries() {
        let files = reader.sequence(entry)?;
        files.record()?;
        files.sidecar()?;
        let stream = files.stream("stream.dat", &OpenOptions::default())?;
        let mut frame = vec![0; stream.geometry().frame_bytes()];
        for readout in 0..stream.readouts().min(4) {
            stream.read_frame(readout, &mut frame)?;
        }
    }
    Ok(())
}
