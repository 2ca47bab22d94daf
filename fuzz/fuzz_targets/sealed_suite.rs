//! Uses any bytes as the public or the secret file of a sealed suite. Both files must be rejected, or the revealed suite
//! must have one scored split for each secret seed.
//!
//! The first byte selects the file. For a secret file, the public file has the matching commitment.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use serde_json::{Value, json};
use spikelane_benchmark::seal;
use spikelane_benchmark::suite::Suite;
use spikelane_fuzz::{check_file_error, suite_text, temp_folder};
use spikelane_io::storage::Digest;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| temp_folder("seal"));

static SUITE: LazyLock<Suite> =
    LazyLock::new(|| Suite::parse(&suite_text("reconstruction", r#"["psnr/1"]"#)).expect("a suite"));

fuzz_target!(|data: &[u8]| {
    let Some((which, bytes)) = data.split_first() else { return };
    let (public, secret) = (FOLDER.join("a.sealed.json"), FOLDER.join("a.secret.json"));
    std::fs::write(&secret, bytes).expect("a temporary file");
    let commitment = json!({
        "format_version": 1, "suite": "tiny", "version": "0.1.0", "seeds": 1, "has_secret_camera": false,
        "suite_text": Digest::hash_bytes(SUITE.text.as_bytes()), "commitment": Digest::hash_bytes(bytes),
    });
    let text = if which % 2 == 0 { commitment.to_string().into_bytes() } else { bytes.to_vec() };
    std::fs::write(&public, text).expect("a temporary file");
    let _ = seal::sealed_name(&public).map_err(|error| check_file_error(&error));
    match seal::reveal(&SUITE, &public, &secret) {
        Ok(suite) => {
            let secret: Value = serde_json::from_slice(bytes).expect("accepted, so it is JSON");
            let seeds = secret["seeds"].as_array().expect("accepted").len();
            assert_eq!(suite.splits.iter().filter(|split| split.is_scored).count(), seeds);
        }
        Err(error) => check_file_error(&error),
    }
});
