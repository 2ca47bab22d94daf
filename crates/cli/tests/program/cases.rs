//! Commands that tests disturb, and the checks of their outputs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{CommandResult, TestFolder};

/// A command to disturb. It writes below `out`.
pub(crate) struct Case {
    pub name: &'static str,
    /// Commands that create the folder `in`.
    pub prepare: &'static [&'static str],
    /// Folder that is copied from `in` to `out` before each run.
    pub copied_folder: Option<&'static str>,
    pub line: &'static str,
    /// Flags of an earlier run. The files of that run are replaced with `--force`.
    pub earlier_flags: Option<&'static str>,
    /// Flags that are added to `line` to resume after a stop.
    pub resume_flags: &'static str,
    /// Commands that verify the outputs. No command may report incomplete files (exit code 3 or 9).
    pub verify: &'static [&'static str],
}

const SCENES: &str =
    "--scene-preset tiny --sequences 3 --images-per-scene 3 --label-every 2 --width 32 --height 24";

pub(crate) const RECORDINGS: &[&str] = &[
    "simulate p0.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/a",
    "simulate p1.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/b",
    "simulate p2.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/c",
];

pub(crate) type Files = BTreeMap<String, Vec<u8>>;

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

pub(crate) fn files_below(place: &TestFolder, folder: &str) -> (Files, Vec<String>) {
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

/// Whether two files are equal. The flag `--force` in the recorded command is ignored, and so are measured times
/// and the description of the machine.
pub(crate) fn are_equal(a: &[u8], b: &[u8]) -> bool {
    fn strip(value: &mut serde_json::Value) {
        if let Some(object) = value.as_object_mut() {
            ["seconds", "memory_peak_bytes", "cost", "environment"]
                .iter()
                .for_each(|key| drop(object.remove(*key)));
            if let Some(command) = object.get_mut("command").and_then(|command| command.as_array_mut()) {
                command.retain(|word| word != "--force" && word != "--resume");
            }
            object.values_mut().for_each(strip);
        }
        value.as_array_mut().into_iter().flatten().for_each(strip);
    }
    let stripped = |bytes: &[u8]| {
        let mut value: serde_json::Value = serde_json::from_slice(bytes).ok()?;
        strip(&mut value);
        Some(value)
    };
    a == b || stripped(a).is_some_and(|a| Some(a) == stripped(b))
}

/// Whether a file is complete, for files that can differ between runs: growing lists, and files that contain times.
pub(crate) fn is_whole(name: &str, bytes: &[u8]) -> bool {
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

pub(crate) fn command(place: &TestFolder, line: &str) -> Command {
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

pub(crate) fn run(place: &TestFolder, line: &str) -> CommandResult {
    CommandResult::from_output(line, command(place, line).output().unwrap())
}

pub(crate) fn run_successfully(place: &TestFolder, line: &str) {
    let ran = run(place, line);
    assert_eq!(ran.code, 0, "{line}: {}", ran.stderr);
}

/// A folder with the inputs of a case. It also stores the state of `out` before and after a complete run.
pub(crate) struct CaseRun<'a> {
    pub job: &'a Case,
    pub place: TestFolder,
    inputs: Files,
    old: Files,
    pub new: Files,
    pub duration: Duration,
}

impl<'a> CaseRun<'a> {
    pub(crate) fn new(job: &'a Case) -> Self {
        let place = TestFolder::new();
        fs::create_dir(place.path("in")).unwrap();
        for (name, level) in [("p0.png", 0), ("p1.png", 80), ("p2.png", 160)] {
            place.picture(name, 8, 8, level);
        }
        place.write("tiny.toml", crate::benchmark::short_suite(1));
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
    pub(crate) fn begin(&self, forced: bool) {
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

    /// Returns the faults of `out` after a disturbed run, and its hidden files: a lost or changed file of the user, or an
    /// incomplete file under its final name.
    pub(crate) fn faults(&self, forced: bool) -> (Vec<String>, Vec<String>) {
        let (files, hidden) = files_below(&self.place, "out");
        let mut faults = Vec::new();
        if files.get("out/mine.dat").map(Vec::as_slice) != Some(b"mine") {
            faults.push("the file of the user is lost".to_owned());
        }
        if files_below(&self.place, "in").0 != self.inputs {
            faults.push("inputs changed".to_owned());
        }
        // A data set lists the inputs that the program could not read. Its descriptions then have fewer sequences.
        let is_failed = |(name, bytes): (&String, &Vec<u8>)| {
            name.ends_with("manifest.jsonl") && String::from_utf8_lossy(bytes).contains("\"failed\"")
        };
        let descriptions: &[&str] = match files.iter().any(is_failed) {
            true => &["DATASHEET.md", "croissant.json", "metadata.jsonl"],
            false => &[],
        };
        for (name, bytes) in &files {
            let is_description = descriptions.iter().any(|ending| name.ends_with(ending));
            let is = |files: &Files| files.get(name).is_some_and(|b| are_equal(b, bytes));
            let old = forced && is(&self.old);
            if !(is(&self.new) || old || is_description || name == "out/mine.dat" || is_whole(name, bytes)) {
                faults.push(format!("{name} is torn"));
            }
        }
        (faults, hidden)
    }

    /// Returns the faults of `out` after a successful run: a missing or different file.
    pub(crate) fn differences(&self) -> Vec<String> {
        let (files, _) = files_below(&self.place, "out");
        let fault = |(name, bytes): (&String, &Vec<u8>)| match files.get(name) {
            None => Some(format!("{name} is missing")),
            Some(content) if are_equal(content, bytes) || is_whole(name, content) => None,
            Some(_) => Some(format!("{name} differs in the end")),
        };
        self.new.iter().filter_map(fault).collect()
    }
}
