//! Uses any bytes as the `plan.json` of a sharded data set. The bytes must be rejected or read.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane_dataset::Access;
use spikelane_dataset::shards::ShardPlan;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::temp_folder("plan"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("plan.json"), data).expect("a temporary file");
    if let Err(error) = ShardPlan::open(&FOLDER, Access::Read) {
        let kinds =
            [ErrorKind::Config, ErrorKind::Input, ErrorKind::Io, ErrorKind::Corrupt, ErrorKind::Usage];
        assert!(kinds.contains(&error.kind()), "{error}");
        assert!(error.to_string().len() > 10);
    }
    // Reading must not leave other files in the folder.
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 1);
});
