//! Any bytes as the `record.json` of a sequence: refused, or read; its files are then missing or verified.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::Kind;
use spikelane_dataset::Record;
use spikelane_io::storage::Digest;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::folder("record"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("record.json"), data).expect("a temporary file");
    if let Err(error) = Record::read(&FOLDER).and_then(|_| Record::verify(&FOLDER, &Digest::of(data))) {
        let kinds = [Kind::Config, Kind::Input, Kind::Io, Kind::Corrupt, Kind::Usage];
        assert!(kinds.contains(&error.kind()), "{error}");
        assert!(error.to_string().len() > 10);
    }
    // Nothing but the file itself is there afterwards.
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 1);
});
