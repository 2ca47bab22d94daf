//! Uses any bytes as the `run.json` or as a result in the folder of a run. The first byte selects the file. The run must
//! be rejected, or all scores must be finite.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use serde_json::json;
use spikelane_benchmark::generated::GeneratedSuite;
use spikelane_benchmark::score::score;
use spikelane_fuzz::{check_file_error, generate_suite, temp_folder};

static DATA: LazyLock<GeneratedSuite> =
    LazyLock::new(|| generate_suite("run-suite", "depth", r#"["depth_abs_rel/1"]"#));

/// The folder of a run, the file `run.json`, and the file of the only result.
static RUN: LazyLock<(PathBuf, PathBuf, PathBuf)> = LazyLock::new(|| {
    let folder = temp_folder("run");
    let (group, sequence) = DATA.scored().next().expect("a sequence");
    let results = folder.join("results").join(group.name.as_str());
    std::fs::create_dir_all(&results).expect("a temporary folder");
    (folder.clone(), folder.join("run.json"), results.join(format!("{}.json", sequence.id)))
});

// The generation takes longer than an input may take.
fuzz_target!(init: { LazyLock::force(&RUN); }, |data: &[u8]| {
    let Some((which, bytes)) = data.split_first() else { return };
    let (folder, run, result) = &*RUN;
    let description = json!({
        "format_version": 1, "suite": "tiny", "version": "0.1.0", "digest": DATA.digest, "time_limit_s": 1.0,
        "method": {"command": "method {stream} {output}"},
    });
    let (description, text) = if which % 2 == 0 {
        (description.to_string().into_bytes(), bytes)
    } else {
        (bytes.to_vec(), &b"{\"seconds\": 1.0}"[..])
    };
    std::fs::write(run, description).expect("a temporary file");
    std::fs::write(result, text).expect("a temporary file");
    match score(&DATA, folder, "method", &|| Ok(())) {
        Ok(file) => {
            assert!(file.sequences.iter().flat_map(|s| s.scores.values()).all(|score| score.is_finite()));
            assert_eq!(file.faults(), 1, "the sequence has no output");
        }
        Err(error) => check_file_error(&error),
    }
});
