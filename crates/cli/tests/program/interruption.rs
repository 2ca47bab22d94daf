//! Stops processes at random moments. No file may be lost or incomplete. `partials` must list the remaining hidden files.
//!
//! The test suite tests a few moments. The long version tests 200 moments for each signal and each command. The variable
//! `SPIKELANE` selects the program:
//! `SPIKELANE=target/release/spikelane cargo test --test program interruption::long -- --ignored --nocapture`

use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::cases::{Case, CaseRun, RECORDINGS, command, files_below, run, run_successfully};

const JOBS: &[Case] = &[
    Case {
        name: "simulate",
        prepare: &[],
        copied_folder: None,
        line: "simulate --builtin-light chart --width 64 --height 48 --readouts 3000 --clean --images-every 500 -o out/a",
        earlier_flags: Some("--seed 7"),
        resume_flags: "--force",
        verify: &["verify out/a.dat", "verify out/a.clean.dat"],
    },
    Case {
        name: "convert",
        prepare: &["simulate --builtin-light chart --width 64 --height 48 --readouts 20000 -o in/a"],
        copied_folder: None,
        line: "convert in/a.dat out/b.npy",
        earlier_flags: Some("--readouts 100..15000"),
        resume_flags: "--force",
        verify: &["verify out/b.npy"],
    },
    Case {
        name: "dataset",
        prepare: &[],
        copied_folder: None,
        line: "dataset SCENES -o out/set",
        earlier_flags: None,
        resume_flags: "--resume",
        verify: &[],
    },
    Case {
        name: "run",
        prepare: &["dataset plan SCENES -o in/plan --sequences-per-shard 2"],
        copied_folder: Some("plan"),
        line: "dataset run out/plan --shards all",
        earlier_flags: None,
        resume_flags: "",
        verify: &[],
    },
    Case {
        name: "merge",
        prepare: &[
            "dataset plan SCENES -o in/plan --sequences-per-shard 2",
            "dataset run in/plan --shards all",
        ],
        copied_folder: Some("plan"),
        line: "dataset merge out/plan",
        earlier_flags: None,
        resume_flags: "",
        verify: &[],
    },
    Case {
        name: "calibrate",
        prepare: RECORDINGS,
        copied_folder: None,
        line: "calibrate in/set.toml -o out/made",
        earlier_flags: Some("--dead-time-fraction 0.01"),
        resume_flags: "--force",
        verify: &["preset show out/made/camera.toml"],
    },
    Case {
        name: "diagnose",
        prepare: RECORDINGS,
        copied_folder: None,
        line: "diagnose in/set.toml --camera physical -o out/made",
        earlier_flags: Some("--seed 5"),
        resume_flags: "--force",
        verify: &["preset show out/made/camera.toml"],
    },
];

impl CaseRun<'_> {
    /// Runs the command, stops it after `wait` with `signal`, and checks its outputs. Returns the number of hidden files.
    fn stop(&self, signal: &str, wait: Duration, forced: bool, finish: bool) -> usize {
        let (job, place) = (self.job, &self.place);
        self.begin(forced);
        let line = if forced { format!("{} --force", job.line) } else { job.line.to_owned() };
        let context = format!("{line}, SIG{signal} after {wait:?}");
        let mut child = command(place, &line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(wait);
        // The process may already have ended, so an error of `kill` is ignored.
        let _ = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).output().unwrap();
        let status = child.wait().unwrap();
        let (faults, mut hidden) = self.faults(forced);
        assert!(faults.is_empty(), "{context}: {faults:?}");
        // A process that is killed before it writes its number leaves an empty lock file. The file can be the lock of
        // another program, so it is not listed.
        let is_empty =
            |name: &String| fs::metadata(place.path(name)).is_ok_and(|metadata| metadata.len() == 0);
        hidden.retain(|name| !(name.ends_with(".lock") && is_empty(name)));
        for line in job.verify {
            let ran = run(place, line);
            assert!([0, 2, 5].contains(&ran.code), "{context}: {line}: {} {}", ran.code, ran.stderr);
        }
        let listed: Vec<String> = run(place, "partials out --json")
            .events()
            .iter()
            .filter(|e| e["event"] == "partial")
            .inspect(|e| assert_eq!(e["running"], false, "{context}: {e}"))
            .map(|e| e["file"].as_str().unwrap().to_owned())
            .collect();
        assert_eq!(listed, hidden, "{context}");
        if signal == "TERM" {
            assert!(hidden.is_empty(), "{context}: {hidden:?}");
            let code = status.code();
            // If the process has not yet installed its handlers, the signal ends the process before it has written
            // anything.
            assert!(matches!(code, Some(0 | 130 | 75) | None), "{context}: {code:?}");
        }
        if finish {
            let flags = if forced { "--force" } else { job.resume_flags };
            run_successfully(place, &format!("{} {flags}", job.line));
            assert_eq!(self.differences(), Vec::<String>::new(), "{context}");
            run_successfully(place, "partials out --delete");
            assert_eq!(files_below(place, "out").1, Vec::<String>::new(), "{context}");
        }
        hidden.len()
    }

    /// Tests `moments` stops with each signal. Half of the moments are uniformly distributed. The other half are near the
    /// end of the run, when files are renamed.
    fn try_moments(&self, moments: u64, finish_every: u64) {
        let mut seed = self.job.name.bytes().fold(1_u64, |s, b| s.wrapping_mul(31).wrapping_add(b.into()));
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let takes = self.duration.as_secs_f64();
        for signal in ["TERM", "KILL"] {
            let (mut left, mut stopped) = (0, 0);
            for i in 0..moments {
                let at_random = i % 2 == 0;
                let wait = if at_random { uniform() * takes } else { takes - 0.1 * uniform() };
                let forced = self.job.earlier_flags.is_some() && i % 4 < 2;
                let hidden =
                    self.stop(signal, Duration::from_secs_f64(wait.max(0.0)), forced, i % finish_every == 0);
                left += hidden;
                stopped += u64::from(hidden > 0);
            }
            println!(
                "{:<10} SIG{signal:<4} {moments} moments in {takes:.2} s: {stopped} left {left} hidden files, all listed",
                self.job.name
            );
        }
    }
}

fn try_job(name: &str, moments: u64, finish_every: u64) {
    let job = JOBS.iter().find(|job| job.name == name).unwrap();
    CaseRun::new(job).try_moments(moments, finish_every);
}

macro_rules! jobs {
    ($($short:ident $long:ident $job:literal,)*) => {$(
        #[test]
        fn $short() {
            try_job($job, 4, 4);
        }

        #[test]
        #[ignore = "minutes: 200 moments of each signal"]
        fn $long() {
            try_job($job, 200, 10);
        }
    )*};
}

jobs! {
    a_stopped_simulate_leaves_nothing_torn long_simulate "simulate",
    a_stopped_convert_leaves_nothing_torn long_convert "convert",
    a_stopped_dataset_leaves_nothing_torn long_dataset "dataset",
    a_stopped_shard_leaves_nothing_torn long_run "run",
    a_stopped_merge_leaves_nothing_torn long_merge "merge",
    a_stopped_calibrate_leaves_nothing_torn long_calibrate "calibrate",
    a_stopped_diagnose_leaves_nothing_torn long_diagnose "diagnose",
}

/// `nohup` starts a command with SIGHUP ignored, which this test reproduces.
#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_was_ignored_from_the_start_stops_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let line = "trap '' HUP; exec \"$0\" simulate --builtin-light chart --width 64 --height 48 --readouts 30000 -o out";
    let mut child = Command::new("sh")
        .args(["-c", line, env!("CARGO_BIN_EXE_spikelane")])
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let begun = || {
        fs::read_dir(folder.path())
            .unwrap()
            .flatten()
            .any(|e| e.path().extension() == Some("partial".as_ref()))
    };
    while !begun() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    Command::new("kill").args(["-HUP", &child.id().to_string()]).status().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
