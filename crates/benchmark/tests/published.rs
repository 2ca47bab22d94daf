//! Generates the suites with a published digest and compares the digests.

use spikelane_benchmark::generated::{GenerateOptions, generate};
use spikelane_benchmark::suite::Suite;

/// Generates about 5 GB in total. The environment variable `SPIKELANE_SUITE` selects one suite.
#[test]
#[ignore = "needs about an hour"]
fn generated_suites_have_their_published_digests() {
    let chosen = std::env::var("SPIKELANE_SUITE").ok();
    let is_chosen = |name: &&str| chosen.as_deref().is_none_or(|chosen| chosen == *name);
    let mut compared = 0;
    for name in Suite::builtin_names().filter(is_chosen) {
        let suite = Suite::builtin(name).unwrap();
        let Some(published) = suite.published_digest() else { continue };
        let folder = tempfile::tempdir().unwrap();
        let options = GenerateOptions {
            output: folder.path().join(name),
            splits: Vec::new(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            resume: false,
        };
        assert_eq!(generate(&suite, &options, &mut |_| Ok(())).unwrap().digest, published, "{name}");
        compared += 1;
    }
    assert!(compared > 0, "no suite with a published digest");
}
