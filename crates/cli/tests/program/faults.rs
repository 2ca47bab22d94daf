//! Makes calls of the C library fail, one in each run. No file may be lost or incomplete, each run ends with a listed exit
//! code, and a rerun without a fault succeeds.
//!
//! `faults.c` is preloaded into the program and counts its calls. The test suite tries a few calls of short commands.
//! `tests/faults.sh` tries every call and a sample of the allocations.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::cases::{Case, CaseRun, RECORDINGS, command, files_below};

const STREAM: &str = "simulate --builtin-light chart --width 16 --height 16 --readouts 60 -o in/a";
const CLIPS: &[&str] = &[
    STREAM,
    "reconstruct in/a.dat -o in/clips/one --every 20",
    "reconstruct in/a.dat -o in/clips/two --every 20 --method tfi",
];
const PLAN: &str = "dataset plan --from in/clips --width 16 --height 16 --sequences-per-shard 1 -o in/plan";

const CASES: &[Case] = &[
    Case {
        name: "simulate",
        prepare: &[],
        copied_folder: None,
        line: "simulate --builtin-light chart --width 16 --height 16 --readouts 60 --clean --images-every 30 -o out/a",
        earlier_flags: None,
        resume_flags: "--force",
        verify: &[],
    },
    Case {
        name: "convert",
        prepare: &[STREAM],
        copied_folder: None,
        line: "convert in/a.dat out/b.npy",
        earlier_flags: None,
        resume_flags: "--force",
        verify: &[],
    },
    Case {
        name: "dataset",
        prepare: CLIPS,
        copied_folder: None,
        line: "dataset --from in/clips --width 16 --height 16 -o out/set",
        earlier_flags: None,
        resume_flags: "--resume",
        verify: &[],
    },
    Case {
        name: "dataset scenes",
        prepare: &[],
        copied_folder: None,
        line: "dataset --scene-preset tiny --sequences 1 --images-per-scene 3 --label-every 2 --width 16 --height 12 -o out/set",
        earlier_flags: None,
        resume_flags: "--resume",
        verify: &[],
    },
    Case {
        name: "dataset run",
        prepare: &[CLIPS[0], CLIPS[1], CLIPS[2], PLAN],
        copied_folder: Some("plan"),
        line: "dataset run out/plan --shards all",
        earlier_flags: None,
        resume_flags: "",
        verify: &[],
    },
    Case {
        name: "dataset merge",
        prepare: &[CLIPS[0], CLIPS[1], CLIPS[2], PLAN, "dataset run in/plan --shards all"],
        copied_folder: Some("plan"),
        line: "dataset merge out/plan",
        earlier_flags: None,
        resume_flags: "",
        verify: &[],
    },
    Case {
        name: "benchmark run",
        prepare: &["benchmark generate tiny.toml -o in/data"],
        copied_folder: None,
        line: "benchmark run in/data --baseline tfp -o out/run",
        earlier_flags: None,
        resume_flags: "--resume",
        verify: &[],
    },
    Case {
        name: "calibrate",
        prepare: RECORDINGS,
        copied_folder: None,
        line: "calibrate in/set.toml -o out/made",
        earlier_flags: None,
        resume_flags: "--force",
        verify: &[],
    },
];

/// Calls that fail in the same way.
struct Fault {
    name: &'static str,
    /// The names of `faults.c`, separated by spaces.
    calls: &'static str,
    error: &'static str,
    /// Whether the command succeeds in spite of the fault.
    is_harmless: bool,
}

const FAULTS: &[Fault] = &[
    Fault {
        name: "disk full",
        calls: "open write pwrite fsync ftruncate fallocate rename link symlink mkdir copy",
        error: "ENOSPC",
        is_harmless: false,
    },
    Fault {
        name: "disk broken",
        calls: "open opendir readdir read pread write pwrite fsync ftruncate fallocate stat statfs flock rename link \
                symlink unlink mkdir rmdir readlink realpath copy mmap",
        error: "EIO",
        is_harmless: false,
    },
    Fault {
        name: "no permission",
        calls: "open opendir stat rename link symlink unlink mkdir rmdir readlink realpath",
        error: "EACCES",
        is_harmless: false,
    },
    Fault { name: "no descriptor", calls: "open opendir pipe", error: "EMFILE", is_harmless: false },
    Fault { name: "no thread", calls: "thread spawn", error: "EAGAIN", is_harmless: false },
    Fault {
        name: "signal",
        calls: "open read pread write pwrite fsync ftruncate fallocate copy",
        error: "EINTR",
        is_harmless: true,
    },
    Fault {
        name: "half of the bytes",
        calls: "read pread write pwrite copy",
        error: "SHORT",
        is_harmless: true,
    },
    Fault { name: "no memory", calls: "malloc mmap", error: "ENOMEM", is_harmless: false },
];

/// The exit codes of `docs/reference/errors.md`.
const CODES: [i32; 13] = [0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 75, 130];

/// Exit code of `timeout` for a command that ran too long.
const HANGS: i32 = 124;

/// Compiles `faults.c` to `library`.
fn compile(library: &Path) {
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/faults.c");
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"]).arg(library).arg(source);
    assert!(compiler.status().unwrap().success());
}

/// A command whose calls fail.
struct FaultRun<'a> {
    case: CaseRun<'a>,
    library: PathBuf,
}

/// The end of a run with a fault.
struct End {
    code: i32,
    stderr: String,
    /// The call that failed, or `None` if the command made fewer calls.
    failed: Option<String>,
    /// Number of calls. It is known only after a regular end.
    calls: Option<u64>,
}

impl<'a> FaultRun<'a> {
    fn new(case: &'a Case) -> Self {
        let case = CaseRun::new(case);
        let library = case.place.path("faults.so");
        compile(&library);
        Self { case, library }
    }

    /// Runs the command with a fault in call `n`. With `n` = 0 no call fails.
    fn run(&self, fault: &Fault, n: u64) -> End {
        self.case.begin(false);
        let calls: Vec<String> =
            fault.calls.split_whitespace().map(|call| format!("{call}={}", fault.error)).collect();
        let log = self.case.place.path("log");
        let _ = fs::remove_file(&log);
        let command = command(&self.case.place, self.case.job.line);
        let program = command.get_program();
        let ran = Command::new("timeout")
            .args(["-k", "1", "20"])
            .arg(program)
            .args(command.get_args())
            .current_dir(command.get_current_dir().unwrap())
            .env("LD_PRELOAD", &self.library)
            .env("FAULT_PROGRAM", PathBuf::from(program).file_name().unwrap())
            .env("FAULT_CALLS", calls.join(","))
            .env("FAULT_AT", n.to_string())
            .env("FAULT_LOG", &log)
            // A backtrace takes longer than the command, so few runs print it.
            .env("RUST_BACKTRACE", if n.is_multiple_of(10) { "1" } else { "0" })
            .env("RAYON_NUM_THREADS", "2")
            .output()
            .unwrap();
        let log = fs::read_to_string(&log).unwrap_or_default();
        let lines: Vec<_> = log.lines().filter_map(|line| line.split_once(' ')).collect();
        End {
            code: ran.status.code().unwrap_or(-1),
            stderr: String::from_utf8_lossy(&ran.stderr).into_owned(),
            failed: lines.iter().find(|(name, _)| *name != "calls").map(|(name, _)| (*name).to_owned()),
            calls: lines.iter().find(|(name, _)| *name == "calls").and_then(|(_, n)| n.parse().ok()),
        }
    }

    /// Runs the command with a fault in call `n`, checks its end, and reruns the command. Returns the wrong ends.
    fn wrong_ends(&self, fault: &Fault, n: u64) -> Vec<String> {
        let end = self.run(fault, n);
        let Some(failed) = &end.failed else { return Vec::new() };
        let (mut wrong, hidden) = self.case.faults(false);
        if end.code == HANGS || !CODES.contains(&end.code) {
            wrong.push(format!("exit code {}", end.code));
        }
        // A method can deny the permission to read its output. Its score is then that of the trivial answer, with a message.
        let is_methods_fault = fault.error == "EACCES" && end.stderr.contains("trivial answer");
        if end.code == 0 && !is_methods_fault {
            wrong.extend(self.case.differences());
        } else if fault.is_harmless {
            wrong.push(format!("exit code {}", end.code));
        }
        // An abort for missing memory removes nothing, and a file remains if its removal fails.
        let may_remain =
            end.code == 11 || matches!(&**failed, "unlink" | "rmdir" | "opendir" | "readdir" | "stat");
        if !hidden.is_empty() && !may_remain {
            wrong.push(format!("hidden files {hidden:?}"));
        }
        if end.code != 0 {
            let ran = crate::cases::run(
                &self.case.place,
                &format!("{} {}", self.case.job.line, self.case.job.resume_flags),
            );
            if ran.code == 0 {
                wrong.extend(
                    self.case.differences().into_iter().map(|fault| format!("after the rerun, {fault}")),
                );
                crate::cases::run_successfully(&self.case.place, "partials out --delete");
                let (_, hidden) = files_below(&self.case.place, "out");
                if !hidden.is_empty() {
                    wrong.push(format!("after the rerun, {hidden:?}"));
                }
            } else {
                wrong.push(format!("the rerun ends with {}: {}", ran.code, ran.stderr.trim()));
            }
        }
        let last = end.stderr.lines().last().unwrap_or_default().to_owned();
        wrong.into_iter().map(|w| format!("{failed} {n} of {}: {w} [{last}]", fault.name)).collect()
    }

    /// Tries at most `most` calls. Prints a row of the table and returns the wrong ends.
    fn try_fault(&self, fault: &Fault, most: u64) -> Vec<String> {
        let end = self.run(fault, 0);
        assert_eq!(end.code, 0, "{}", end.stderr);
        let calls = end.calls.unwrap();
        // The numbers are spread evenly. Other runs may make a few more calls, so the last number is beyond `calls`.
        let tried: BTreeSet<u64> = (1..=most.min(calls)).map(|i| i * calls / most.min(calls)).collect();
        let wrong: Vec<String> = tried.iter().flat_map(|n| self.wrong_ends(fault, *n)).collect();
        println!(
            "{:<16} {:<18} {calls:>6} {:>6} {:>6}",
            self.case.job.name,
            fault.name,
            tried.len(),
            wrong.len()
        );
        wrong.iter().for_each(|w| println!("    {w}"));
        wrong
    }
}

/// Tries faults of each kind in the case `name`.
fn try_case(name: &str, most: u64, most_allocations: u64) {
    let case = FaultRun::new(CASES.iter().find(|case| case.name == name).unwrap());
    let only = std::env::var("FAULT").unwrap_or_default();
    let mut wrong = Vec::new();
    for fault in FAULTS.iter().filter(|fault| fault.name.contains(&only)) {
        let most = if fault.calls.contains("malloc") { most_allocations } else { most };
        wrong.extend(case.try_fault(fault, most));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

macro_rules! cases {
    ($($long:ident $case:literal,)*) => {$(
        #[test]
        #[ignore = "minutes: every call fails once"]
        fn $long() {
            try_case($case, u64::MAX, 300);
        }
    )*};
}

cases! {
    every_fault_simulate "simulate",
    every_fault_convert "convert",
    every_fault_dataset "dataset",
    every_fault_scenes "dataset scenes",
    every_fault_run "dataset run",
    every_fault_merge "dataset merge",
    every_fault_benchmark "benchmark run",
    every_fault_calibrate "calibrate",
}

#[test]
fn failing_calls_of_short_commands_leave_nothing_torn() {
    try_case("convert", 4, 4);
    try_case("dataset merge", 3, 3);
}
