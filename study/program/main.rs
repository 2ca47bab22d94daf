//! The study of the program's own path: laboratories whose cameras, lamps and protocols differ, and what `diagnose` says of them.
//!
//! `cargo run --release --example study-program -- RECORDS.jsonl [--nulls N] [--singles N] [--doubles N] [--outside N] [--minutes M]
//! [--attempt K] [--table FILE]` adds sensors to RECORDS, one a line, and leaves those alone that are there. The simulator of the truth is
//! that of the tests and imports nothing from the library. Seeds are functions of a sensor's name and of the attempt. Clean sensors come
//! first, then single effects, doubles and what the catalogue does not hold. `--times FOLDER` prints how long clean, single and double
//! sensors take instead.

mod factors;
#[path = "../../tests/hidden_sensor/mod.rs"]
#[allow(unreachable_pub, reason = "shared with the tests")]
mod hidden_sensor;
#[path = "../diagnose/jobs.rs"]
mod jobs;
mod lab;
mod made;
#[path = "../diagnose/score.rs"]
mod score;
#[path = "../diagnose/share.rs"]
mod share;
mod table;

use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use factors::Factors;
use hidden_sensor::Sensor;
use jobs::{Job, jobs, uniform};
use serde_json::{Value, json};
use spikelane::diagnose::{DiagnoseOptions, diagnose};

/// Pixels of a side.
const SIDE: usize = 48;

/// Strengths over the smallest that the first study could name, log-uniform.
const STRENGTHS: (f64, f64) = (6.0, 20.0);

/// Processor seconds of a sensor in which nothing is found, and of one in which something is, as first measured.
const SECONDS: [f64; 2] = [45.0, 120.0];

struct Args {
    records: PathBuf,
    counts: [usize; 5],
    minutes: f64,
    attempt: u64,
    table: Option<PathBuf>,
}

fn main() {
    let args = args();
    let mut jobs = jobs(args.counts, &[]);
    // A run that is cut short has the clean ones, which tell most.
    jobs.sort_by_key(|job| {
        ["null", "single", "double", "outside"].iter().position(|class| *class == job.class)
    });
    let known = known(&args.records);
    let open: Vec<&Job> = jobs.iter().filter(|j| !known.iter().any(|r| r["id"] == j.id().as_str())).collect();
    let seconds: f64 = open.iter().map(|j| SECONDS[usize::from(j.class != "null")]).sum();
    println!(
        "{} sensors asked for, {} open: about {:.1} h of processor time",
        jobs.len(),
        open.len(),
        seconds / 3600.0
    );
    let strengths = smallest();
    let start = Instant::now();
    let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&args.records).unwrap();
    for job in open {
        let next = SECONDS[usize::from(job.class != "null")];
        if start.elapsed().as_secs_f64() + next > 60.0 * args.minutes {
            println!("stopped after {} minutes; the same command goes on", args.minutes);
            break;
        }
        let begun = Instant::now();
        let record = judged(job, args.attempt, &strengths);
        let seconds = begun.elapsed().as_secs_f64();
        println!("{}: {} {} ({seconds:.0} s)", job.id(), record["said"]["verdict"], record["score"]["names"]);
        writeln!(file, "{record}").unwrap();
    }
    if let Some(path) = args.table {
        let text = made::by() + &table::table(&self::known(&args.records));
        std::fs::write(path, text).unwrap();
    }
}

fn args() -> Args {
    let mut words = std::env::args().skip(1);
    let records = words.next().expect("a file for the records");
    let mut args =
        Args { records: records.into(), counts: [0; 5], minutes: f64::INFINITY, attempt: 1, table: None };
    while let Some(word) = words.next() {
        let value = words.next().unwrap_or_else(|| panic!("{word} needs a value"));
        let number = || value.parse::<f64>().unwrap_or_else(|_| panic!("{word} {value}: a number"));
        match word.as_str() {
            "--nulls" => args.counts[0] = number() as usize,
            "--singles" => args.counts[1] = number() as usize,
            "--outside" => args.counts[2] = number() as usize,
            "--doubles" => args.counts[3] = number() as usize,
            "--minutes" => args.minutes = number(),
            "--attempt" => args.attempt = number() as u64,
            "--table" => args.table = Some(value.into()),
            _ => panic!("{word}: unknown"),
        }
    }
    args
}

fn known(path: &std::path::Path) -> Vec<Value> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect()
}

/// The smallest nameable strength of each effect in the first study.
fn smallest() -> Vec<(String, f64)> {
    let lines = include_str!("../../docs/data/diagnosis.jsonl");
    let mut all: Vec<(String, f64)> = Vec::new();
    for record in lines.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()) {
        for h in record["hidden"].as_array().into_iter().flatten() {
            let (Some(name), Some(strength)) = (h["name"].as_str(), h["nameable"].as_f64()) else { continue };
            if !all.iter().any(|a| a.0 == name) {
                all.push((name.to_owned(), strength));
            }
        }
    }
    all
}

fn judged(job: &Job, attempt: u64, smallest: &[(String, f64)]) -> Value {
    let seed = job.seed() ^ attempt.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let factors = Factors::drawn(seed);
    let mut physics = factors.physics();
    let mut hidden = Vec::new();
    for (i, kind) in job.kinds.iter().enumerate() {
        let u = [1, 2, 3].map(|k| uniform(seed, 10 * i as u64 + k));
        let times = STRENGTHS.0 * (STRENGTHS.1 / STRENGTHS.0).powf(uniform(seed, 100 + i as u64));
        let own = smallest.iter().find(|s| s.0 == kind.name).map(|s| s.1 * times);
        let strength = own.map_or(kind.largest, |s| s.min(kind.largest));
        (kind.set)(&mut physics, strength, u);
        hidden.push(json!({"name": kind.name, "strength": strength}));
    }
    let sensor = Sensor::new(physics, SIDE, SIDE, seed);
    let folder = tempfile::tempdir().unwrap();
    let first = lab::take(&sensor, &factors, 0, &folder.path().join("0"));
    let second = factors.second_set.then(|| lab::take(&sensor, &factors, 1, &folder.path().join("1")));
    let camera = factors.camera_file.then(|| lab::camera_file(&first, &factors));
    let options = DiagnoseOptions { camera: camera.as_ref(), ..DiagnoseOptions::default() };
    let found = diagnose(&first, second.as_ref(), options, &mut |_, _| {});
    let said = match &found {
        Ok(diagnosis) => serde_json::to_value(diagnosis).unwrap(),
        Err(error) => json!({ "error": error.to_string() }),
    };
    let levels: serde_json::Map<String, Value> =
        factors.levels().into_iter().map(|(name, level)| (name.to_owned(), level.into())).collect();
    // What a protocol cannot show is no miss.
    let cannot = |name: &str| said["not_testable"].as_array().into_iter().flatten().any(|n| n == name);
    let shown = job.kinds.iter().filter(|k| job.class != "outside" && !cannot(k.name)).count();
    let hidden = Value::from(hidden);
    let mut score = score::of(&hidden, &said);
    score["shown"] = shown.into();
    json!({"id": job.id(), "class": job.class, "attempt": attempt, "factors": levels, "hidden": hidden, "score": score, "said": kept(said)})
}

/// What a table and a question about a failure need.
fn kept(said: Value) -> Value {
    let keys =
        ["verdict", "effects", "misfits", "unknown", "gap", "faults", "seconds", "error", "not_testable"];
    let own = said.as_object().into_iter().flatten().filter(|(key, _)| keys.contains(&key.as_str()));
    Value::Object(own.map(|(key, value)| (key.clone(), value.clone())).collect())
}
