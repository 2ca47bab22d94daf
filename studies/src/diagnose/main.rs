//! Blind study of `diagnose`: the library diagnoses hidden sensors about which it has no information.
//!
//! `cargo run --release -p spikelane-studies --bin study-diagnose -- FOLDER [--clean N] [--singles N] [--outside N]
//! [--doubles N] [--triples N] [--names A,B] [--filter TEXT] [--minutes M] [--profile]` adds sensors to FOLDER, one JSON
//! file each. Sensors that this version of the code has diagnosed are skipped.
//!
//! * `--report FILE` writes the tables of the existing records.
//! * `--records FILE` restores the records from a file of lines, and writes all records to it.
//! * `--profile` prints the seconds of every phase.
//! * `--filter TEXT` selects sensors whose id contains TEXT.
//! * `--rejudge LIST` diagnoses the sensors in LIST, one per line, again. It compares nine digits with the records, and
//!   fails if one differs.

mod diagnose_sensor;
#[path = "../../../crates/diagnose/tests/hidden_sensor/mod.rs"]
#[allow(unreachable_pub, reason = "shared with the tests")]
mod hidden_sensor;
mod jobs;
mod multiple_effects;
mod outcomes;
mod phases;
mod records;
mod rejudge;
mod report;
mod score;
mod share;
mod summary;
mod version;

use std::path::PathBuf;
use std::time::Instant;

use hidden_sensor::SMALL_SIZE;
use jobs::{SensorJob, jobs, uniform_hash};
use phases::PhaseTimer;
use serde_json::{Value, json};
use spikelane_diagnose::NullModel;

/// Range of the strengths, relative to the smallest detectable strength, log-uniform.
const STRENGTH_RANGE: (f64, f64) = (2.0, 30.0);

/// Smallest strength of an effect outside the catalog, relative to its largest strength.
///
/// At strength 0.3, the weakest of these effects is a diagonal band of amplitude 0.015. It affects 2,304 pixels whose
/// gain scatters by 0.073. In the spectrum of the gain, the peak of the band is 2304 * 0.015^2 / (4 * 0.073^2) = 24
/// times the mean. If the band is between two frequencies of the spectrum, the peak is 16 times the mean. The highest
/// peak of the scatter alone is at 8 to 9 +- 1.3 times the mean. In a test, a band of 0.015 was not detected, so it is
/// at the limit.
const MIN_OUTSIDE_STRENGTH: f64 = 0.3;

/// The smallest detectable strength of each effect.
type SmallestStrengths = Vec<(String, f64)>;

struct Args {
    folder: PathBuf,
    /// Numbers of sensors: clean, with one effect of the catalog, with one effect from outside the catalog, with two
    /// effects, with three effects.
    counts: [usize; 5],
    profile: bool,
    names: Vec<String>,
    id_filter: String,
    minutes: f64,
    report: Option<PathBuf>,
    records: Option<PathBuf>,
    rejudge_list: Option<PathBuf>,
}

fn arguments() -> Args {
    let mut args = Args {
        folder: PathBuf::from("target/diagnosis"),
        counts: [0; 5],
        profile: false,
        names: Vec::new(),
        id_filter: String::new(),
        minutes: 1e9,
        report: None,
        records: None,
        rejudge_list: None,
    };
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        let mut next = || all.next().unwrap_or_else(|| panic!("{arg} needs a value"));
        match arg.as_str() {
            "--clean" => args.counts[0] = next().parse().unwrap(),
            "--singles" => args.counts[1] = next().parse().unwrap(),
            "--outside" => args.counts[2] = next().parse().unwrap(),
            "--doubles" => args.counts[3] = next().parse().unwrap(),
            "--triples" => args.counts[4] = next().parse().unwrap(),
            "--profile" => args.profile = true,
            "--names" => args.names = next().split(',').map(str::to_owned).collect(),
            "--filter" => args.id_filter = next(),
            "--minutes" => args.minutes = next().parse().unwrap(),
            "--records" => args.records = Some(PathBuf::from(next())),
            "--rejudge" => args.rejudge_list = Some(PathBuf::from(next())),
            "--report" => args.report = Some(PathBuf::from(next())),
            folder => args.folder = PathBuf::from(folder),
        }
    }
    args
}

fn main() {
    let args = arguments();
    if let Some(list) = &args.rejudge_list {
        let lines = spikelane_studies::lines::read(
            args.records.as_deref().expect("--rejudge needs the --records to compare with"),
        );
        let reference = diagnose_sensor::shared_null_model(SMALL_SIZE, &mut PhaseTimer::new(args.profile));
        std::process::exit(i32::from(!rejudge::rejudge(
            &std::fs::read_to_string(list).unwrap(),
            &lines,
            &reference,
        )));
    }
    std::fs::create_dir_all(&args.folder).unwrap();
    if let Some(lines) = &args.records {
        records::restore_records(lines, &args.folder);
    }
    let jobs = jobs(args.counts, &args.names);
    let start = Instant::now();
    let mut reference: Option<(NullModel, SmallestStrengths)> = None;
    for job in jobs.iter().filter(|j| j.id().contains(&args.id_filter)) {
        let file = args.folder.join(format!("{}.json", job.id()));
        if records::is_current(&file) {
            continue;
        }
        if start.elapsed().as_secs_f64() > 60.0 * args.minutes {
            break;
        }
        let (shared, strengths) = reference.get_or_insert_with(|| shared_null_model(&args));
        let record = run_job(job, shared, strengths, &args);
        println!("{}", summary(&record));
        std::fs::write(&file, serde_json::to_string_pretty(&record).unwrap()).unwrap();
    }
    if let Some(lines) = &args.records {
        records::write_lines(&args.folder, lines);
    }
    if let Some(path) = &args.report {
        report::write(&args.folder, path);
    }
}

/// Returns the simulations that all sensors share, and the smallest detectable strength of each effect.
fn shared_null_model(args: &Args) -> (NullModel, SmallestStrengths) {
    let mut phases = PhaseTimer::new(args.profile);
    let start = Instant::now();
    let reference = diagnose_sensor::shared_null_model(SMALL_SIZE, &mut phases);
    let seconds = start.elapsed().as_secs_f64();
    phases.enter("nameable");
    let file = args.folder.join("nameable.txt");
    let version = version::alarm_version();
    let known = std::fs::read_to_string(&file).ok().and_then(|t| serde_json::from_str::<Value>(&t).ok());
    if let Some(rows) = known.filter(|k| k["version"] == version) {
        let strengths = rows["detectability"].as_array().into_iter().flatten();
        let strength = |n: &Value| Some((n["name"].as_str()?.to_owned(), n["strength"].as_f64()?));
        return (reference, strengths.filter_map(strength).collect());
    }
    let nameable = reference.detectabilities();
    phases.enter("");
    println!("reference in {seconds:.1} s, limits {:?}", reference.limits());
    let table: Vec<Value> = nameable.iter().map(|n| serde_json::to_value(n).unwrap()).collect();
    for n in &nameable {
        println!(
            "  {:<24} {} {:.3e}, like {} ({:+.2})",
            n.name, n.parameter, n.strength, n.nearest_candidate, n.cosine
        );
    }
    let document = json!({ "version": version, "seconds": seconds, "detectability": table });
    std::fs::write(&file, serde_json::to_string_pretty(&document).unwrap()).unwrap();
    (reference, nameable.into_iter().map(|n| (n.name.to_owned(), n.strength)).collect())
}

fn run_job(job: &SensorJob, reference: &NullModel, nameable: &SmallestStrengths, args: &Args) -> Value {
    let mut phases = PhaseTimer::new(args.profile);
    let strength = |i: usize| {
        let kind = job.kinds[i];
        let u = uniform_hash(job.seed(), 10 * i as u64);
        let smallest = nameable.iter().find(|n| n.0 == kind.name).map(|n| n.1);
        let wanted = match smallest {
            Some(s) => s * STRENGTH_RANGE.0 * (STRENGTH_RANGE.1 / STRENGTH_RANGE.0).powf(u),
            None => kind.largest * MIN_OUTSIDE_STRENGTH.powf(u),
        };
        (wanted.min(kind.largest), smallest)
    };
    let strengths: Vec<_> = (0..job.kinds.len()).map(strength).collect();
    diagnose_sensor::diagnose_hidden(job, &strengths, reference, SMALL_SIZE, &mut phases)
}

fn summary(record: &Value) -> String {
    let first = &record["hidden"][0];
    format!(
        "{:<44} {:>9.2e}  {:<16} exact {} ambiguous {} named {} wrong {} discrepancy {} -> {} noise floor {:.0} {:.1} s {}",
        record["id"].as_str().unwrap_or_default(),
        first["strength"].as_f64().unwrap_or(0.0),
        record["score"]["verdict"].as_str().unwrap_or("error"),
        record["score"]["exact"],
        record["score"]["named_or_ambiguous"],
        record["score"]["names"],
        record["score"]["wrong"],
        record["diagnosis"]["discrepancy"]["held_out_set"][0].as_f64().unwrap_or(0.0) as i64,
        record["diagnosis"]["discrepancy"]["held_out_set"]
            .as_array()
            .and_then(|a| a.last()?.as_f64())
            .unwrap_or(0.0) as i64,
        record["diagnosis"]["discrepancy"]["noise_floor"].as_f64().unwrap_or(0.0),
        record["diagnosis"]["seconds"].as_f64().unwrap_or(0.0),
        record["diagnosis"]["error"].as_str().unwrap_or(""),
    )
}
