//! Stops processes at random moments. No file may be lost or incomplete. `partials` must list the remaining hidden files.
//!
//! The test suite tests a few moments. The long version tests 200 moments for each signal and each command. The variable
//! `SPIKELANE` selects the program:
//! `SPIKELANE=target/release/spikelane cargo test --test program interruption::long -- --ignored --nocapture`

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{CommandResult, TestFolder};

/// A command to interrupt. It writes below `out`.
struct InterruptionCase {
    name: &'static str,
    /// Commands that create the folder `in`.
    prepare: &'static [&'static str],
    /// Folder that is copied from `in` to `out` before each run.
    copied_folder: Option<&'static str>,
    line: &'static str,
    /// Flags of an earlier run. The files of that run are replaced with `--force`.
    earlier_flags: Option<&'static str>,
    /// Flags that are added to `line` to resume after a stop.
    resume_flags: &'static str,
    /// Commands that verify the outputs. No command may report incomplete files (exit code 3 or 9).
    verify: &'static [&'static str],
}

const SCENES: &str =
    "--scene-preset tiny --sequences 3 --images-per-scene 3 --label-every 2 --width 32 --height 24";

const RECORDINGS: &[&str] = &[
    "simulate p0.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/a",
    "simulate p1.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/b",
    "simulate p2.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/c",
];

const JOBS: &[InterruptionCase] = &[
    InterruptionCase {
        name: "simulate",
        prepare: &[],
        copied_folder: None,
        line: "simulate --builtin-light chart --width 64 --height 48 --readouts 3000 --clean --images-every 500 -o out/a",
        earlier_flags: Some("--seed 7"),
        resume_flags: "--force",
        verify: &["verify out/a.dat", "verify out/a.clean.dat"],
    },
    InterruptionCase {
        name: "convert",
        prepare: &["simulate --builtin-light chart --width 64 --height 48 --readouts 20000 -o in/a"],
        copied_folder: None,
        line: "convert in/a.dat out/b.npy",
        earlier_flags: Some("--readouts 100..15000"),
        resume_flags: "--force",
        verify: &["verify out/b.npy"],
    },
    InterruptionCase {
        name: "dataset",
        prepare: &[],
        copied_folder: None,
        line: "dataset SCENES -o out/set",
        earlier_flags: None,
        resume_flags: "--resume",
        verify: &[],
    },
    InterruptionCase {
        name: "run",
        prepare: &["dataset plan SCENES -o in/plan --sequences-per-shard 2"],
        copied_folder: Some("plan"),
        line: "dataset run out/plan --shards all",
        earlier_flags: None,
        resume_flags: "",
        verify: &[],
    },
    InterruptionCase {
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
    InterruptionCase {
        name: "calibrate",
        prepare: RECORDINGS,
        copied_folder: None,
        line: "calibrate in/set.toml -o out/made",
        earlier_flags: Some("--dead-time-fraction 0.01"),
        resume_flags: "--force",
        verify: &["preset show out/made/camera.toml"],
    },
    InterruptionCase {
        name: "diagnose",
        prepare: RECORDINGS,
        copied_folder: None,
        line: "diagnose in/set.toml --camera physical -o out/made",
        earlier_flags: Some("--seed 5"),
        resume_flags: "--force",
        verify: &["preset show out/made/camera.toml"],
    },
];

type Files = BTreeMap<String, Vec<u8>>;

/// Collects the files below a folder. A hidden file is collected as a name only, and so is a hidden folder.
fn walk(root: &Path, folder: &Path, files: &mut Files, hidden: &mut Vec<String>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries {
        let path = entry.unwrap().path();
        let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
        if path.file_name().unwrap().to_string_lossy().starts_with('.') {
            hidden.push(name);
        } else if path.is_dir() && !path.is_symlink() {
            walk(root, &path, files, hidden);
        } else {
            files.insert(name, fs::read(&path).unwrap_or_default());
        }
    }
}

fn files_below(place: &TestFolder, folder: &str) -> (Files, Vec<String>) {
    let (mut files, mut hidden) = (Files::new(), Vec::new());
    walk(&place.path(""), &place.path(folder), &mut files, &mut hidden);
    hidden.sort();
    (files, hidden)
}

fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            copy(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        // The modification time is copied too, because a shard compares it.
        let copied = Command::new("cp").arg("-p").arg(from).arg(to).status().unwrap();
        assert!(copied.success());
    }
}

/// Whether two files are equal. The flag `--force` in the recorded command is ignored.
fn are_equal(a: &[u8], b: &[u8]) -> bool {
    let without_force = |bytes: &[u8]| {
        let mut value: serde_json::Value = serde_json::from_slice(bytes).ok()?;
        value["command"].as_array_mut()?.retain(|word| word != "--force");
        Some(value)
    };
    a == b || without_force(a).is_some_and(|a| Some(a) == without_force(b))
}

/// Whether a file is complete, for files that can differ between runs: growing lists, and files that contain times.
fn is_whole(name: &str, bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let json = |text: &str| serde_json::from_str::<serde_json::Value>(text).is_ok();
    match name.rsplit('/').next().unwrap() {
        "manifest.jsonl" | "journal.jsonl" => text.lines().all(json),
        "diagnosis.json" => json(&text),
        "report.html" => text.trim_end().ends_with("</html>"),
        // The content of a lock file does not matter.
        "lock" => true,
        _ => false,
    }
}

fn command(place: &TestFolder, line: &str) -> Command {
    let line = line.replace("SCENES", SCENES);
    let mut command = place.command(&line);
    if let Some(program) = std::env::var_os("SPIKELANE") {
        let program = std::path::absolute(program).unwrap();
        let folder = command.get_current_dir().unwrap().to_path_buf();
        command = Command::new(program);
        command.args(line.split_whitespace()).current_dir(folder).stdin(Stdio::null());
    }
    command
}

fn run(place: &TestFolder, line: &str) -> CommandResult {
    CommandResult::from_output(line, command(place, line).output().unwrap())
}

fn run_successfully(place: &TestFolder, line: &str) {
    let ran = run(place, line);
    assert_eq!(ran.code, 0, "{line}: {}", ran.stderr);
}

/// A folder with the inputs of a case. It also stores the state of `out` before and after a complete run.
struct CaseRun<'a> {
    job: &'a InterruptionCase,
    place: TestFolder,
    inputs: Files,
    old: Files,
    new: Files,
    duration: Duration,
}

impl<'a> CaseRun<'a> {
    fn new(job: &'a InterruptionCase) -> Self {
        let place = TestFolder::new();
        fs::create_dir(place.path("in")).unwrap();
        for (name, level) in [("p0.png", 0), ("p1.png", 80), ("p2.png", 160)] {
            place.picture(name, 8, 8, level);
        }
        job.prepare.iter().for_each(|line| run_successfully(&place, line));
        if job.prepare == RECORDINGS {
            let one = |(file, light): (&str, f64)| {
                format!("[[recording]]\nfile = \"{file}.dat\"\nlight = {light:?}\n")
            };
            let all: String = [("a", 0.0), ("b", 0.31), ("c", 0.63)].map(one).concat();
            place.write("in/set.toml", format!("width = 8\nheight = 8\nreadout_hz = 20000\n{all}"));
        }
        let mut stage = Self {
            job,
            place,
            inputs: Files::new(),
            old: Files::new(),
            new: Files::new(),
            duration: Duration::ZERO,
        };
        if let Some(flags) = job.earlier_flags {
            run_successfully(&stage.place, &format!("{} {flags}", job.line));
            fs::rename(stage.place.path("out"), stage.place.path("old")).unwrap();
            stage.old = files_below(&stage.place, "old").0;
            stage.old = stage
                .old
                .into_iter()
                .map(|(name, bytes)| (name.replacen("old/", "out/", 1), bytes))
                .collect();
        }
        stage.inputs = files_below(&stage.place, "in").0;
        stage.begin(false);
        let start = Instant::now();
        run_successfully(&stage.place, job.line);
        stage.duration = start.elapsed();
        stage.new = files_below(&stage.place, "out").0;
        stage
    }

    /// Creates `out` with a file of the user. If `forced` is true, `out` also contains the files of an earlier run.
    fn begin(&self, forced: bool) {
        let out = self.place.path("out");
        if out.exists() {
            fs::remove_dir_all(&out).unwrap();
        }
        fs::create_dir(&out).unwrap();
        if forced {
            copy(&self.place.path("old"), &out);
        }
        if let Some(folder) = self.job.copied_folder {
            copy(&self.place.path(&format!("in/{folder}")), &out.join(folder));
        }
        fs::write(out.join("mine.dat"), "mine").unwrap();
    }

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
        let (files, hidden) = files_below(place, "out");
        assert_eq!(files.get("out/mine.dat").map(Vec::as_slice), Some(&b"mine"[..]), "{context}");
        assert!(files_below(place, "in").0 == self.inputs, "{context}: inputs changed");
        for (name, bytes) in &files {
            let is = |files: &Files| files.get(name).is_some_and(|b| are_equal(b, bytes));
            let old = forced && is(&self.old);
            let is_complete = is(&self.new) || old || name == "out/mine.dat" || is_whole(name, bytes);
            assert!(is_complete, "{context}: {name} is torn");
        }
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
            let (files, _) = files_below(place, "out");
            for (name, bytes) in &self.new {
                let content = files.get(name).unwrap_or_else(|| panic!("{context}: {name} is missing"));
                assert!(
                    are_equal(content, bytes) || is_whole(name, content),
                    "{context}: {name} differs in the end"
                );
            }
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
