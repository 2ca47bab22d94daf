//! One shard: what is missing of it is made, at most by one process at a time.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Instant;

use super::journal::{self, Head, Journal, Line};
use super::lock::{self, Lock};
use super::pack;
use super::plan::{Plan, Task};
use crate::from::located;
use crate::manifest::sequence_path;
use crate::record::if_intact;
use crate::{DatasetOptions, Entry, Progress, Record, Status, Work, sequence, stamp};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, PlainName};
use spikelane_io::storage::trees;

/// How a shard is run.
#[derive(Clone, Copy, Debug)]
pub struct Running {
    /// Threads; they change no byte.
    pub threads: usize,
    /// Check digests of what is there, not sizes and times alone.
    pub verify: bool,
    /// Try again what was set aside.
    pub retry: bool,
    /// Take the lock; without it nothing keeps two processes from one shard.
    pub lock: bool,
}

/// What was done of a shard.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ShardReport {
    /// Sequences made.
    pub made: usize,
    /// Sequences that were there.
    pub kept: usize,
    /// Sequences set aside, now or before, and why.
    pub set_aside: Vec<(String, String)>,
    /// What the user should know of the inputs of sequences made, one line each.
    pub notes: Vec<String>,
}

/// Attempts at a sequence before it is set aside.
const ATTEMPTS: u32 = 2;

/// Makes what is missing of shard `number`. What is there stays, if every file has its size and time; what a killed run
/// left behind is removed. `watch` hears of every batch, and its error stops the work, which loses no sequence
/// that is finished.
///
/// A sequence that fails twice is set aside with its reason, and so is one whose input is not as it was when the plan was
/// made; a full disk, a system that refuses to write, or a request to stop ends the run.
///
/// # Errors
/// See above; [`Kind::Busy`] when another process is at the shard; [`Kind::Usage`] for a number beyond the last.
pub fn run(
    plan: &Plan,
    number: u64,
    how: &Running,
    watch: &mut dyn FnMut(Progress<'_>) -> Result<()>,
) -> Result<ShardReport> {
    if number >= plan.shards() {
        return Err(Error::new(Kind::Usage, "--shard")
            .found(number)
            .expected(format_args!("0 to {}", plan.shards().saturating_sub(1))));
    }
    let folder = plan.shard_folder(number, Access::Write)?;
    fs::create_dir_all(&folder).map_err(|e| Error::io(folder.display(), e))?;
    let _lock = how.lock.then(|| Lock::take(&lock::place(&folder))).transpose()?;
    clean(&folder)?;
    let tasks = plan.tasks(number, &plan.scene_splits())?;
    let mut verified = |index: usize, id: &str| {
        watch(Progress { index, of: tasks.len(), id, readouts: 0, total: None, verifying: true })
    };
    if let Some(report) = whole(plan, number, &tasks, how, &mut verified)? {
        return Ok(report);
    }
    trees::prepare(&folder, &InnerPath::from("sequences/any"))?;
    let mut options = plan.options.clone();
    options.output.clone_from(&folder);
    options.threads = how.threads;
    let journal = Journal::of(&folder, Access::Write)?;
    let known = known(&journal, &folder, how, options.access(), &mut verified)?;
    let mut shard = Shard { options, journal, report: ShardReport::default(), watch };
    let mut lines = Vec::with_capacity(tasks.len());
    for (index, task) in tasks.iter().enumerate() {
        let line = match known.get(&task.entry.id) {
            Some(line) => line.clone(),
            None => {
                let line = shard.settle(task, index, tasks.len())?;
                shard.journal.add(&line)?;
                line
            }
        };
        lines.push(line);
    }
    let access = shard.options.access();
    let packed = if plan.pack {
        let path = plan.shard_pack(number, Access::Write)?;
        let watch = &mut *shard.watch;
        let at = |id| Progress { index: 0, of: tasks.len(), id, readouts: 0, total: None, verifying: true };
        Some(pack::write(&path, &folder, &lines, access, &mut || watch(at("pack")))?)
    } else {
        None
    };
    if plan.pack {
        // Their files go; the pack has a time of its own.
        lines.iter_mut().for_each(|line| line.times_ns.clear());
    }
    journal::write_manifest(&folder, &Head::of(number, &lines, packed), &lines)?;
    if plan.pack {
        trees::remove(&folder, &"sequences".into())?;
    }
    shard.journal.remove()?;
    let mut report = shard.report;
    report.set_aside = set_aside(&lines);
    report.kept = lines.len() - report.made - report.set_aside.len();
    Ok(report)
}

fn set_aside(lines: &[Line]) -> Vec<(String, String)> {
    let failed = lines.iter().filter(|l| l.entry.status == Status::Failed);
    failed.map(|l| (name(&l.entry), l.entry.reason.clone().unwrap_or_default())).collect()
}

/// What people know a sequence by.
fn name(entry: &Entry) -> String {
    entry.input.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| entry.id.to_string())
}

/// Removes what a killed run left: hidden folders and files in the making.
fn clean(folder: &Path) -> Result<()> {
    trees::remove_partials(folder, |_| true)?;
    trees::remove_partials_in(folder, &"sequences".into())?;
    // The pack is made beside the folder, where others are at work too.
    let (Some(beside), Some(name)) = (folder.parent(), folder.file_name()) else { return Ok(()) };
    let own = format!(".{}.tar.", name.to_string_lossy());
    trees::remove_partials(beside, |name| name.starts_with(&own))
}

/// Hears of each sequence that is verified, by its number and name, and may stop the work.
type Verifying<'a> = &'a mut dyn FnMut(usize, &str) -> Result<()>;

/// The report of a shard that is done and unharmed; what is damaged loses its manifest.
fn whole(
    plan: &Plan,
    number: u64,
    tasks: &[Task],
    how: &Running,
    watch: Verifying<'_>,
) -> Result<Option<ShardReport>> {
    let folder = plan.shard_folder(number, Access::Write)?;
    let access = plan.options.access();
    let read = journal::read_manifest(&folder, plan.sequences_of(number), access)?;
    let Some((head, lines)) = read else { return Ok(None) };
    let retry = how.retry && head.failed > 0;
    let is_planned = lines.iter().zip(tasks).all(|(line, task)| line.entry.id == task.entry.id);
    let sound = is_planned
        && match &head.pack {
            Some(packed) => {
                let path = plan.shard_pack(number, access)?;
                packed.holds(&path, how.verify, &mut || watch(0, "pack"))?
            }
            None => all_sound(&lines, &folder, how, access, watch)?,
        };
    if sound && !retry {
        if head.pack.is_some() {
            trees::remove(&folder, &"sequences".into())?;
        }
        Journal::of(&folder, Access::Write)?.remove()?;
        let set_aside = set_aside(&lines);
        let kept = lines.len() - set_aside.len();
        return Ok(Some(ShardReport { kept, set_aside, ..ShardReport::default() }));
    }
    // Packed sequences are there no more; a line without files would not hold.
    Journal::of(&folder, Access::Write)?.begin(&lines)?;
    journal::withdraw_manifest(&folder)?;
    Ok(None)
}

fn all_sound(
    lines: &[Line],
    folder: &Path,
    how: &Running,
    access: Access,
    watch: Verifying<'_>,
) -> Result<bool> {
    for (index, line) in lines.iter().enumerate() {
        let id = line.entry.id.as_str();
        if !is_sound(line, folder, how, access, &mut || watch(index, id))? {
            return Ok(false);
        }
    }
    Ok(true)
}

fn is_sound(
    line: &Line,
    folder: &Path,
    how: &Running,
    access: Access,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<bool> {
    stop()?;
    if line.entry.status == Status::Failed {
        return Ok(true);
    }
    let place = sequence_path(&line.entry.id).below(folder, access)?;
    if !how.verify {
        return line.holds(&place, access);
    }
    let digest = line.entry.digest.as_deref().unwrap_or_default();
    Ok(if_intact(Record::verify_below(&place, digest, access, stop))?.is_some())
}

/// The settled sequences that hold, with which the journal begins anew.
fn known(
    journal: &Journal,
    folder: &Path,
    how: &Running,
    access: Access,
    watch: Verifying<'_>,
) -> Result<BTreeMap<PlainName, Line>> {
    let mut lines = Vec::new();
    for (index, line) in journal.read()?.into_iter().enumerate() {
        let id = line.entry.id.as_str();
        let holds = match line.entry.status {
            Status::Failed => !how.retry,
            _ => is_sound(&line, folder, how, access, &mut || watch(index, id))?,
        };
        if holds {
            lines.push(line);
        }
    }
    journal.begin(&lines)?;
    Ok(lines.into_iter().map(|line| (line.entry.id.clone(), line)).collect())
}

struct Shard<'a> {
    options: DatasetOptions,
    journal: Journal,
    report: ShardReport,
    watch: &'a mut dyn FnMut(Progress<'_>) -> Result<()>,
}

impl Shard<'_> {
    /// Makes a sequence, or sets it aside.
    fn settle(&mut self, task: &Task, index: usize, of: usize) -> Result<Line> {
        let start = Instant::now();
        let mut attempt = 1;
        let reason = loop {
            match self.make(task, index, of) {
                Ok(entry) => {
                    self.report.made += 1;
                    let folder = sequence_path(&entry.id).below(&self.options.output, Access::Read)?;
                    return Line::done(entry, start.elapsed().as_secs_f64(), &folder);
                }
                Err(e) if self.ends(&e) => return Err(e),
                Err(_) if attempt < ATTEMPTS => attempt += 1,
                Err(e) => break e.to_string(),
            }
        };
        let mut entry = task.entry.clone();
        (entry.status, entry.reason, entry.bytes) = (Status::Failed, Some(reason), None);
        // An earlier attempt of another run may have left its folder.
        trees::remove(&self.options.output, &sequence_path(&entry.id))?;
        Ok(Line { entry, seconds: start.elapsed().as_secs_f64(), times_ns: Vec::new() })
    }

    /// Whether an error would strike the next sequence too.
    fn ends(&self, e: &Error) -> bool {
        let own = e.subject().starts_with(&*self.options.output.to_string_lossy());
        match e.kind() {
            Kind::Space | Kind::Interrupted | Kind::Exists | Kind::Requeue => true,
            Kind::Io => own,
            _ => false,
        }
    }

    fn make(&mut self, task: &Task, index: usize, of: usize) -> Result<Entry> {
        let mut entry = task.entry.clone();
        self.unchanged(task)?;
        let (watch, id) = (&mut *self.watch, task.entry.id.as_str());
        let mut tell = |readouts, total| watch(Progress { index, of, id, readouts, total, verifying: false });
        if let (Work::Inputs(inputs), Some(name)) = (&self.options.work, &entry.input) {
            let path = located(inputs, Path::new(name))?;
            entry.input_digest = Some(stamp::digest(&path, &mut || tell(0, None))?);
        }
        let (record, digest, readouts) = sequence::make(&self.options, &entry, &mut tell)?;
        let notes = record.about["notes"].as_array().into_iter().flatten();
        self.report.notes.extend(notes.filter_map(|n| n.as_str().map(str::to_owned)));
        (entry.status, entry.bytes) = (Status::Done, Some(record.bytes()));
        (entry.digest, entry.readouts) = (Some(digest), Some(readouts));
        Ok(entry)
    }

    /// Refuses an input that is not as it was when the plan was made.
    fn unchanged(&self, task: &Task) -> Result<()> {
        let (Work::Inputs(inputs), Some(name), Some(stamp)) =
            (&self.options.work, &task.entry.input, task.stamp)
        else {
            return Ok(());
        };
        let path = located(inputs, Path::new(name))?;
        let found = stamp::of(&path)?;
        if found == stamp {
            return Ok(());
        }
        Err(Error::new(Kind::Input, path.display())
            .found(format_args!("{} bytes, changed at {} ns", found.bytes, found.time_ns))
            .expected(format_args!("{} bytes, changed at {} ns, as planned", stamp.bytes, stamp.time_ns))
            .remedy("restore it (cp -p keeps the time), or plan anew in another folder"))
    }
}
