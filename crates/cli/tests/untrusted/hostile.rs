//! Tests untrusted folders. For all file names, contents and types, commands must exit with a documented code. No file
//! outside the folder may be read, written or removed.
//!
//! Each case copies a small valid folder and applies up to three random changes. The case number is the seed. The case
//! then runs the commands that read such a folder. Environment variables:
//! * `SPIKELANE_HOSTILE_CASES` is the number of cases, and `SPIKELANE_HOSTILE_FIRST` is the number of the first case.
//! * `SPIKELANE_HOSTILE_PROGRAM` is another program to test. With an older version, the cases must find known errors.
//! * `SPIKELANE_HOSTILE_SECONDS` is the time limit of a command in seconds.
#![cfg(unix)]

#[path = "hostile/folders.rs"]
mod folders;
#[path = "hostile/mutations.rs"]
mod mutations;
#[path = "hostile/signing.rs"]
mod signing;
#[path = "hostile/values.rs"]
mod values;

use std::collections::BTreeMap;
use std::fs::{self, File, FileTimes};
use std::os::unix::fs::{MetadataExt as _, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant, SystemTime};

use folders::{FolderKind, KINDS};
use mutations::Random;
use spikelane_io::storage::Digest;

/// The exit codes that `docs/reference/errors.md` lists.
const CODES: [i32; 13] = [0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 75, 130];

/// Time limit of a command in seconds. A command normally takes a fraction of a second.
const HANG_SECONDS: u64 = 60;

/// Limit of the address space of a command in KiB. If a command allocated memory for an unchecked count, it would exceed
/// this limit.
const ADDRESS_SPACE_KIB: u64 = 8_000_000;

/// Text in the files outside the folder. It must not occur in any output.
const SECRET: &str = "precious-0d1e6c";

/// Returns every path below a folder with its mode, its change time, and its bytes or link target.
fn snapshot(root: &Path) -> BTreeMap<PathBuf, (u32, i64, i64, Vec<u8>)> {
    let (mut all, mut folders) = (BTreeMap::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let metadata = fs::symlink_metadata(&path).unwrap();
            let bytes = if metadata.is_symlink() {
                fs::read_link(&path).unwrap().into_os_string().into_encoded_bytes()
            } else if metadata.is_file() {
                fs::read(&path).unwrap()
            } else {
                Vec::new()
            };
            if metadata.is_dir() {
                folders.push(path.clone());
            }
            let below = path.strip_prefix(root).unwrap().to_owned();
            all.insert(below, (metadata.mode(), metadata.mtime(), metadata.mtime_nsec(), bytes));
        }
    }
    all
}

/// The result of a command.
struct CommandResult {
    /// Exit code. `None` if a signal or the time limit ended the command.
    code: Option<i32>,
    hung: bool,
    output: String,
}

/// Returns the program under test, and whether it differs from the program of this build.
fn program() -> (String, bool) {
    match std::env::var("SPIKELANE_HOSTILE_PROGRAM") {
        Ok(other) => (other, true),
        Err(_) => (env!("CARGO_BIN_EXE_spikelane").to_owned(), false),
    }
}

fn run(folder: &Path, arguments: &[String]) -> CommandResult {
    let limit = Duration::from_secs(number("SPIKELANE_HOSTILE_SECONDS", HANG_SECONDS));
    let log = folder.parent().unwrap().join("log");
    let file = File::create(&log).unwrap();
    let mut child = Command::new("sh")
        .args(["-c", &format!("ulimit -v {ADDRESS_SPACE_KIB}; exec \"$@\""), "sh"])
        .arg(program().0)
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(file.try_clone().unwrap())
        .stderr(file)
        .spawn()
        .unwrap();
    let start = Instant::now();
    let mut hung = false;
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > limit {
            hung = true;
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let output = String::from_utf8_lossy(&fs::read(&log).unwrap()).into_owned();
    fs::remove_file(log).unwrap();
    CommandResult { code: status.code(), hung, output }
}

/// Sets the access time of all files below `folder` to the past. If a file is read later, its access time changes.
fn mark_unread(folder: &Path) {
    for (path, (mode, ..)) in snapshot(folder) {
        if mode & 0o170_000 == 0o100_000 {
            let times = FileTimes::new().set_accessed(SystemTime::UNIX_EPOCH);
            File::open(folder.join(path)).unwrap().set_times(times).unwrap();
        }
    }
}

/// Returns a file below `folder` that was read after [`mark_unread`]. The function requires a file system that stores
/// access times.
fn was_read(folder: &Path) -> Option<PathBuf> {
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let metadata = fs::symlink_metadata(&path).unwrap();
            if metadata.is_dir() {
                folders.push(path);
            } else if metadata.is_file() && metadata.accessed().unwrap() != SystemTime::UNIX_EPOCH {
                return Some(path);
            }
        }
    }
    None
}

/// Returns a file below `folder` that contains the secret text. Links are not followed.
fn holds_secret(folder: &Path) -> Option<PathBuf> {
    let holds = |bytes: &[u8]| bytes.windows(SECRET.len()).any(|part| part == SECRET.as_bytes());
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let metadata = fs::symlink_metadata(&path).unwrap();
            if metadata.is_dir() {
                folders.push(path);
            } else if metadata.is_file() && metadata.len() < 1 << 24 && holds(&fs::read(&path).unwrap()) {
                return Some(path);
            }
        }
    }
    None
}

/// Creates files and folders beside the untrusted folder. No case may change them.
fn make_surroundings(around: &Path) {
    fs::create_dir_all(around.join("home/alice")).unwrap();
    fs::create_dir_all(around.join("empty")).unwrap();
    for name in [
        "secret.txt",
        "record.json",
        "stream.dat",
        "home/alice/thesis.txt",
        "home/alice/.draft.spikelane.partial",
    ] {
        fs::write(around.join(name), format!("{SECRET} {name}\n")).unwrap();
    }
}

/// Runs the case `number`. Returns descriptions of the errors that it found.
fn run_case(number: u64, base: &Path, top: &Path) -> Vec<String> {
    let mut random = Random::new(number);
    let kind: &FolderKind = &KINDS[random.number_below(KINDS.len())];
    let place = top.join(number.to_string());
    let (work, around) = (place.join("work"), place.join("around"));
    folders::copy(&base.join(kind.folder), &work);
    make_surroundings(&around);
    // Creates a sequence outside the folder. Paths in the untrusted files must not reach it.
    let inner = ["sequences", "shards/000000/sequences"].map(|below| work.join(below).join("scene-0000"));
    if let Some(sequence) = inner.iter().find(|folder| folder.is_dir()) {
        folders::copy(sequence, &around.join("sequence"));
    }
    let changes = mutations::apply(&mut random, &work, &around);
    // If another program is tested, it may lack the flag `--follow-links`.
    let follows = kind.follows_links && random.number_below(4) == 0 && !program().1;
    // In a quarter of the cases, the folder on the command line is a link.
    let is_linked = random.number_below(4) == 0;
    if is_linked {
        symlink(&work, place.join("link")).unwrap();
    }
    let before = snapshot(&around);
    let secret = Digest::hash_bytes(&fs::read(around.join("secret.txt")).unwrap());
    mark_unread(&around);
    let mut wrong = Vec::new();
    for line in kind.commands {
        let mut arguments: Vec<String> = line.split(' ').map(str::to_owned).collect();
        for argument in arguments.iter_mut().filter(|argument| is_linked && *argument == ".") {
            "../link".clone_into(argument);
        }
        if follows {
            arguments.push("--follow-links".to_owned());
        }
        let ran = run(&work, &arguments);
        let mut say = |what: &str| {
            let end: String = ran.output.chars().take(2000).collect();
            wrong.push(format!("case {number}, {}, {changes:?}\n  {line}: {what}\n  {end}", kind.folder));
        };
        if ran.hung {
            say("no end");
        } else if !ran.code.is_some_and(|code| CODES.contains(&code)) {
            say(&format!("code {:?}", ran.code));
        }
        let read = was_read(&around);
        if snapshot(&around) != before {
            say("files outside changed");
        }
        mark_unread(&around);
        let names: Vec<_> = fs::read_dir(&place).unwrap().map(|e| e.unwrap().file_name()).collect();
        if names.len() != 2 + usize::from(is_linked) {
            say(&format!("files beside: {names:?}"));
        }
        // Control characters must be escaped in JSON lines and in text.
        let is_control = |c: char| c.is_control() && c != '\n' && c != '\t';
        if ran.output.contains(is_control) {
            say("control characters in the output");
        }
        // A file on the command line may be a link to any file. Links to files are rejected only inside a folder.
        let is_file_link = |name: &String| {
            let path = work.join(name);
            fs::symlink_metadata(&path).is_ok_and(|m| m.is_symlink()) && !path.is_dir()
        };
        if !follows && !arguments.iter().any(is_file_link) {
            if ran.output.contains(SECRET) || kind.folder == "stream" && ran.output.contains(&secret) {
                say("a file outside is in the output");
            }
            // Some paths may be outside the folder: paths in the user's own `dataset.toml`, and paths in the list of inputs of
            // a plan. A path on the command line may also contain a link.
            let is_link = |path: &Path| fs::symlink_metadata(work.join(path)).is_ok_and(|m| m.is_symlink());
            let leads_through_link =
                |name: &String| !name.starts_with("..") && Path::new(name).ancestors().any(is_link);
            let is_free = kind.folder == "text"
                || changes.iter().any(|change| change.contains("list = "))
                || arguments.iter().any(leads_through_link);
            if let (Some(path), false) = (read, is_free) {
                say(&format!("{} was read", path.display()));
            }
            if let Some(path) = holds_secret(&work) {
                say(&format!("a file outside was copied to {}", path.display()));
            }
        }
    }
    fs::remove_dir_all(place).unwrap();
    wrong
}

fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| text.parse().unwrap())
}

#[test]
fn commands_end_with_a_listed_code_and_leave_everything_outside_as_it_is() {
    let top = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
    let base = top.path().join("base");
    folders::make(&base);
    let before = snapshot(&base);
    let (first, cases) = (number("SPIKELANE_HOSTILE_FIRST", 0), number("SPIKELANE_HOSTILE_CASES", 60));
    let (next, wrong) = (AtomicU64::new(first), Mutex::new(Vec::new()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= first + cases {
                        break;
                    }
                    let findings = run_case(number, &base, top.path());
                    if !findings.is_empty() {
                        wrong.lock().unwrap().push(findings);
                    }
                }
            });
        }
    });
    let wrong: Vec<Vec<String>> = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{} of {cases} cases:\n{}", wrong.len(), wrong.concat().join("\n"));
    assert!(snapshot(&base) == before, "a folder that commands may only read has changed");
}

/// Tests that the folders are valid before they are changed. Otherwise the cases would test nothing.
#[test]
fn every_valid_folder_is_accepted_as_it_is() {
    let top = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
    let base = top.path().join("base");
    folders::make(&base);
    for kind in KINDS {
        let work = top.path().join("work");
        folders::copy(&base.join(kind.folder), &work);
        for line in kind.commands {
            let arguments: Vec<String> = line.split(' ').map(str::to_owned).collect();
            let ran = run(&work, &arguments);
            assert_eq!(ran.code, Some(0), "{}: {line}: {}", kind.folder, ran.output);
        }
        fs::remove_dir_all(work).unwrap();
    }
}
