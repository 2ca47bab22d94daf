//! Uses any bytes as the `suite.json` of a generated suite. The bytes must be rejected, or a missing file must be found
//! for each listed file.
//!
//! An index with a wrong digest is opened again with the digest of its files, so that the checks after the digest are
//! reached.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use serde_json::Value;
use spikelane::ErrorKind;
use spikelane_benchmark::generated::GeneratedSuite;
use spikelane_fuzz::{check_file_error, suite_text, temp_folder};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = temp_folder("generated-suite");
    std::fs::write(folder.join("suite.toml"), suite_text("tracking", r#"["hota/1"]"#))
        .expect("a temporary file");
    folder
});

fn open(index: &[u8]) -> spikelane::Result<GeneratedSuite> {
    std::fs::write(FOLDER.join("suite.json"), index).expect("a temporary file");
    GeneratedSuite::open(&FOLDER)
}

fuzz_target!(|data: &[u8]| {
    let mut opened = open(data);
    if let Err(error) = &opened {
        check_file_error(error);
        let Ok(mut index) = serde_json::from_slice::<Value>(data) else { return };
        let found = error.parts().found.into_owned();
        if error.kind() != ErrorKind::Corrupt || !index.is_object() {
            return;
        }
        let digest = found.rsplit(' ').next().expect("a digest");
        index["digest"] = digest.into();
        opened = open(index.to_string().as_bytes());
    }
    // A repeated key in the fuzzed text can differ from the first key after the rewrite.
    let suite = match opened {
        Ok(suite) => suite,
        Err(error) => return check_file_error(&error),
    };
    let files: usize = suite.groups.iter().flat_map(|g| &g.sequences).map(|s| s.files.len()).sum();
    let faults = suite.verify(&mut |_| Ok(())).expect("no stop");
    assert_eq!(faults.len(), files);
    faults.iter().for_each(check_file_error);
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 2);
});
