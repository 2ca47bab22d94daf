//! Uses any bytes as the `record.json` of a sequence. `SequenceRecord::read` and `SequenceRecord::verify` must accept
//! the bytes or return an expected error. They must not create files.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane_dataset::{Access, SequenceRecord};
use spikelane_io::storage::Digest;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::temp_folder("record"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("record.json"), data).expect("a temporary file");
    if let Err(error) =
        SequenceRecord::read(&FOLDER, Access::Read).and_then(|_| {
            SequenceRecord::verify(&FOLDER, &Digest::hash_bytes(data), Access::Read, &mut || Ok(()))
        })
    {
        let kinds =
            [ErrorKind::Config, ErrorKind::Input, ErrorKind::Io, ErrorKind::Corrupt, ErrorKind::Usage];
        assert!(kinds.contains(&error.kind()), "{error}");
        assert!(error.to_string().len() > 10);
    }
    // Reading must not leave other files in the folder.
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 1);
});
