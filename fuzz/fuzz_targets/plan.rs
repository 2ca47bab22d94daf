//! Any bytes as the `plan.json` of a data set of shards: refused, or read.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::Kind;
use spikelane_dataset::shards::Plan;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::folder("plan"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("plan.json"), data).expect("a temporary file");
    if let Err(error) = Plan::read(&FOLDER) {
        let kinds = [Kind::Config, Kind::Input, Kind::Io, Kind::Corrupt, Kind::Usage];
        assert!(kinds.contains(&error.kind()), "{error}");
        assert!(error.to_string().len() > 10);
    }
    // Nothing but the file itself is there afterwards.
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 1);
});
