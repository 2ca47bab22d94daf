//! Processes that are stopped at random moments: nothing is lost, nothing is torn, and what is left is listed.
//!
//! The suite tries a few moments. The long version, 200 of each signal for each command, with a program of your choice:
//! `SPIKELANE=target/release/spikelane cargo test --test program stopped::long -- --ignored --nocapture`

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{Place, Ran};

/// A command under test; it writes below `out`.
struct Job {
    name: &'static str,
    /// Makes `in`.
    prepare: &'static [&'static str],
    /// Copied from `in` to `out` before each run.
    copied: Option<&'static str>,
    line: &'static str,
    /// Flags of an earlier run whose files `--force` replaces.
    old: Option<&'static str>,
    /// What is added to `line` to finish after a stop.
    again: &'static str,
    /// Lines that check what is there; none of them may report torn files (code 3 or 9).
    verify: &'static [&'static str],
    /// Whether a run takes seconds.
    slow: bool,
}

const SCENES: &str = "--kind tiny --sequences 3 --images 3 --label-every 2 --width 32 --height 24";

const RECORDINGS: &[&str] = &[
    "simulate p0.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/a",
    "simulate p1.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/b",
    "simulate p2.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/c",
];

const JOBS: &[Job] = &[
    Job {
        name: "simulate",
        prepare: &[],
        copied: None,
        line: "simulate --source chart --width 64 --height 48 --readouts 3000 --clean --images-every 500 -o out/a",
        old: Some("--seed 7"),
        again: "--force",
        verify: &["verify out/a.dat", "verify out/a.clean.dat"],
        slow: false,
    },
    Job {
        name: "convert",
        prepare: &["simulate --source chart --width 64 --height 48 --readouts 20000 -o in/a"],
        copied: None,
        line: "convert in/a.dat out/b.npy",
        old: Some("--readouts 100..15000"),
        again: "--force",
        verify: &["verify out/b.npy"],
        slow: false,
    },
    Job {
        name: "dataset",
        prepare: &[],
        copied: None,
        line: "dataset SCENES -o out/set",
        old: None,
        again: "--resume",
        verify: &[],
        slow: false,
    },
    Job {
        name: "run",
        prepare: &["dataset plan SCENES -o in/plan --per-shard 2"],
        copied: Some("plan"),
        line: "dataset run out/plan --shard all",
        old: None,
        again: "",
        verify: &[],
        slow: false,
    },
    Job {
        name: "merge",
        prepare: &["dataset plan SCENES -o in/plan --per-shard 2", "dataset run in/plan --shard all"],
        copied: Some("plan"),
        line: "dataset merge out/plan",
        old: None,
        again: "",
        verify: &[],
        slow: false,
    },
    Job {
        name: "calibrate",
        prepare: RECORDINGS,
        copied: None,
        line: "calibrate in/set.toml -o out/made",
        old: Some("--dead-time 0.01"),
        again: "--force",
        verify: &["preset show out/made/camera.toml"],
        slow: true,
    },
    Job {
        name: "diagnose",
        prepare: RECORDINGS,
        copied: None,
        line: "diagnose in/set.toml --camera physical -o out/made",
        old: Some("--seed 5"),
        again: "--force",
        verify: &["preset show out/made/camera.toml"],
        slow: true,
    },
];

type Files = BTreeMap<String, Vec<u8>>;

/// Files below a folder; hidden ones and what is below them as one name each.
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

fn below(place: &Place, folder: &str) -> (Files, Vec<String>) {
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
        // With its time, by which a shard knows its files.
        let copied = Command::new("cp").arg("-p").arg(from).arg(to).status().unwrap();
        assert!(copied.success());
    }
}

/// Two files of two runs, one of which may have been forced, which only its recorded command shows.
fn are_equal(a: &[u8], b: &[u8]) -> bool {
    let plain = |bytes: &[u8]| {
        let mut value: serde_json::Value = serde_json::from_slice(bytes).ok()?;
        value["command"].as_array_mut()?.retain(|word| word != "--force");
        Some(value)
    };
    a == b || plain(a).is_some_and(|a| Some(a) == plain(b))
}

/// Whether a file may differ from run to run, and is whole all the same: a list that grows, or what names the time.
fn is_whole(name: &str, bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let json = |text: &str| serde_json::from_str::<serde_json::Value>(text).is_ok();
    match name.rsplit('/').next().unwrap() {
        "manifest.jsonl" | "journal.jsonl" => text.lines().all(json),
        "diagnosis.json" => json(&text),
        "report.html" => text.trim_end().ends_with("</html>"),
        // Only the name counts.
        "lock" => true,
        _ => false,
    }
}

fn command(place: &Place, line: &str) -> Command {
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

fn run(place: &Place, line: &str) -> Ran {
    Ran::of(line, command(place, line).output().unwrap())
}

fn good(place: &Place, line: &str) {
    let ran = run(place, line);
    assert_eq!(ran.code, 0, "{line}: {}", ran.stderr);
}

/// A place with the inputs of a job, `out` as it is before a run, and what a run leaves there.
struct Stage<'a> {
    job: &'a Job,
    place: Place,
    inputs: Files,
    old: Files,
    new: Files,
    takes: Duration,
}

impl<'a> Stage<'a> {
    fn new(job: &'a Job) -> Self {
        let place = Place::new();
        fs::create_dir(place.path("in")).unwrap();
        for (name, level) in [("p0.png", 0), ("p1.png", 80), ("p2.png", 160)] {
            place.picture(name, 8, 8, level);
        }
        job.prepare.iter().for_each(|line| good(&place, line));
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
            takes: Duration::ZERO,
        };
        if let Some(flags) = job.old {
            good(&stage.place, &format!("{} {flags}", job.line));
            fs::rename(stage.place.path("out"), stage.place.path("old")).unwrap();
            stage.old = below(&stage.place, "old").0;
            stage.old = stage
                .old
                .into_iter()
                .map(|(name, bytes)| (name.replacen("old/", "out/", 1), bytes))
                .collect();
        }
        stage.inputs = below(&stage.place, "in").0;
        stage.begin(false);
        let start = Instant::now();
        good(&stage.place, job.line);
        stage.takes = start.elapsed();
        stage.new = below(&stage.place, "out").0;
        stage
    }

    /// Makes `out` anew, with a file of the user's, and with an earlier run's where `--force` is to replace it.
    fn begin(&self, forced: bool) {
        let out = self.place.path("out");
        if out.exists() {
            fs::remove_dir_all(&out).unwrap();
        }
        fs::create_dir(&out).unwrap();
        if forced {
            copy(&self.place.path("old"), &out);
        }
        if let Some(folder) = self.job.copied {
            copy(&self.place.path(&format!("in/{folder}")), &out.join(folder));
        }
        fs::write(out.join("mine.dat"), "mine").unwrap();
    }

    /// Stops a run after `wait` and looks at what it left. Returns how many hidden files that were.
    fn stop(&self, signal: &str, wait: Duration, forced: bool, finish: bool) -> usize {
        let (job, place) = (self.job, &self.place);
        self.begin(forced);
        let line = if forced { format!("{} --force", job.line) } else { job.line.to_owned() };
        let about = format!("{line}, SIG{signal} after {wait:?}");
        let mut child = command(place, &line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(wait);
        // One that has ended already is as good.
        let _ = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).output().unwrap();
        let status = child.wait().unwrap();
        let (files, hidden) = below(place, "out");
        assert_eq!(files.get("out/mine.dat").map(Vec::as_slice), Some(&b"mine"[..]), "{about}");
        assert!(below(place, "in").0 == self.inputs, "{about}: inputs changed");
        for (name, bytes) in &files {
            let is = |files: &Files| files.get(name).is_some_and(|b| are_equal(b, bytes));
            let old = forced && is(&self.old);
            let whole = is(&self.new) || old || name == "out/mine.dat" || is_whole(name, bytes);
            assert!(whole, "{about}: {name} is torn");
        }
        for line in job.verify {
            let ran = run(place, line);
            assert!([0, 2, 5].contains(&ran.code), "{about}: {line}: {} {}", ran.code, ran.stderr);
        }
        let listed: Vec<String> = run(place, "partials out --json")
            .events()
            .iter()
            .filter(|e| e["event"] == "partial")
            .inspect(|e| assert_eq!(e["running"], false, "{about}: {e}"))
            .map(|e| e["file"].as_str().unwrap().to_owned())
            .collect();
        assert_eq!(listed, hidden, "{about}");
        if signal == "TERM" {
            assert!(hidden.is_empty(), "{about}: {hidden:?}");
            let code = status.code();
            // Before it listens to signals a process ends by them; it has written nothing then.
            assert!(matches!(code, Some(0 | 130 | 75) | None), "{about}: {code:?}");
        }
        if finish {
            let flags = if forced { "--force" } else { job.again };
            good(place, &format!("{} {flags}", job.line));
            let (files, _) = below(place, "out");
            for (name, bytes) in &self.new {
                let found = files.get(name).unwrap_or_else(|| panic!("{about}: {name} is missing"));
                assert!(
                    are_equal(found, bytes) || is_whole(name, found),
                    "{about}: {name} differs in the end"
                );
            }
            good(place, "partials out --delete");
            assert_eq!(below(place, "out").1, Vec::<String>::new(), "{about}");
        }
        hidden.len()
    }

    /// `moments` of each signal: half of them anywhere, half around the end, where files get their names.
    fn try_moments(&self, moments: u64, finish_every: u64) {
        let mut seed = self.job.name.bytes().fold(1_u64, |s, b| s.wrapping_mul(31).wrapping_add(b.into()));
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let takes = self.takes.as_secs_f64();
        for signal in ["TERM", "KILL"] {
            let (mut left, mut stopped) = (0, 0);
            for i in 0..moments {
                let anywhere = i % 2 == 0;
                let wait = if anywhere { uniform() * takes } else { takes - 0.1 * uniform() };
                let forced = self.job.old.is_some() && i % 4 < 2;
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
    let moments = if job.slow && moments < 20 { 3 } else { moments };
    Stage::new(job).try_moments(moments, finish_every);
}

macro_rules! jobs {
    ($($short:ident $long:ident $job:literal,)*) => {$(
        #[test]
        fn $short() {
            try_job($job, 10, 5);
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

/// `nohup` starts its command so that it ignores SIGHUP.
#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_was_ignored_from_the_start_stops_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let line =
        "trap '' HUP; exec \"$0\" simulate --source chart --width 64 --height 48 --readouts 30000 -o out";
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
