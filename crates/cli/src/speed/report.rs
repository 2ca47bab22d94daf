//! Prints the results of the benchmarks as tables, as JSON, and as a page of the documentation.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use serde::Serialize;
use serde_json::{Value, json};
use spikelane::unstable::Count;
use spikelane::{Error, Result};

use super::processes::ProcessResult;
use super::scenes::{RenderStage, RenderTime, STAGE_LIGHTINGS};

/// Marker line in the page. When the page is written again, the text after this line is preserved.
const HANDWRITTEN_MARKER: &str = "<!-- kept: what follows is written by hand -->";

/// Marker lines before and after the table of scene errors in a page.
pub(crate) const SCENE_ERROR_MARKERS: (&str, &str) =
    ("<!-- scene error: begin -->\n", "<!-- scene error: end -->\n");

/// The work of rows that measure a kernel alone.
pub(crate) const KERNEL_WORK: &str = "kernel";

/// Size and readout rate of each camera, and the 10^9 pixel-readouts per second that the camera produces.
const CAMERA_PIXEL_RATES: [(&str, f64); 3] =
    [("400x250 at 20 kHz", 2.0), ("400x250 at 40 kHz", 4.0), ("1000x1000 at 20 kHz", 20.0)];

/// Result of one benchmark.
pub(crate) struct SpeedRow {
    pub work: &'static str,
    pub backend: &'static str,
    pub noise_set: &'static str,
    pub light: &'static str,
    pub threads: usize,
    /// Speed in 10^9 pixel-readouts per second.
    pub speed: f64,
}

impl SpeedRow {
    pub(crate) fn new(
        what: &'static str,
        backend: &'static str,
        noise: &'static str,
        light: &'static str,
        threads: usize,
        speed: f64,
    ) -> Self {
        Self { work: what, backend, noise_set: noise, light, threads, speed: speed / 1e9 }
    }

    fn is_kernel(&self) -> bool {
        self.work == KERNEL_WORK
    }
}

/// One result with a name and a unit.
#[derive(Serialize)]
pub(crate) struct BenchmarkFigure {
    pub name: String,
    pub value: f64,
    pub unit: &'static str,
}

/// The machine and the build on which the benchmarks ran.
#[derive(Default, Serialize)]
pub(crate) struct Machine {
    date: String,
    cpu: String,
    threads: usize,
    compiler: String,
    commit: String,
    portable_lanes: &'static str,
}

impl Machine {
    pub(crate) fn current() -> Self {
        let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| cpu_model(&text));
        Self {
            date: spikelane_measure::report::today(),
            cpu: cpu.unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            compiler: command_output(Command::new("rustc").arg("--version")),
            commit: source_commit(),
            portable_lanes: if cfg!(target_feature = "avx2") {
                "built for this CPU"
            } else {
                "default build"
            },
        }
    }
}

fn cpu_model(cpuinfo: &str) -> Option<String> {
    let field = |name: &str| {
        let line = cpuinfo.lines().find(|l| l.starts_with(name))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    let number = |name: &str| field(name).unwrap_or_default();
    Some(format!("{} (family {}, model {})", field("model name")?, number("cpu family"), number("model\t")))
}

/// Returns the commit of the source code of this program, or `unknown` if the folder in which it was built is gone.
///
/// Git must not run in the current folder, because the settings of a repository can name programs that Git starts.
pub(crate) fn source_commit() -> String {
    let folder = env!("CARGO_MANIFEST_DIR");
    // Without optional locks, Git does not write to the repository.
    let git = |arguments: &[&str]| {
        command_output(Command::new("git").args(["--no-optional-locks", "-C", folder]).args(arguments))
    };
    let commit = git(&["describe", "--always"]);
    let changes = git(&["status", "--porcelain", "--untracked-files=no"]);
    let is_dirty = [&commit, &changes].iter().all(|text| *text != UNKNOWN);
    if is_dirty { commit + "-dirty" } else { commit }
}

/// The text of a command that fails or prints nothing.
const UNKNOWN: &str = "unknown";

fn command_output(command: &mut Command) -> String {
    let output = command.output().ok().filter(|o| o.status.success());
    let text = output.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned());
    text.filter(|t| !t.is_empty()).unwrap_or_else(|| UNKNOWN.to_owned())
}

/// Results of all benchmarks.
#[derive(Default)]
pub(crate) struct SpeedReport {
    pub machine: Machine,
    pub rows: Vec<SpeedRow>,
    pub figures: Vec<BenchmarkFigure>,
    pub scenes: Vec<RenderTime>,
    pub stages: Vec<RenderStage>,
    pub processes: Vec<ProcessResult>,
}

impl SpeedReport {
    fn scalar_speed(&self) -> f64 {
        self.rows.iter().find(|r| r.backend == "scalar").map_or(f64::NAN, |r| r.speed)
    }

    /// Returns the tables as Markdown. This text is also readable in a terminal.
    pub(crate) fn markdown(&self) -> String {
        self.page_tables() + &self.stages_markdown()
    }

    /// Returns the tables of the page.
    fn page_tables(&self) -> String {
        let m = &self.machine;
        let mut text = format!(
            "Measured on {}: {}, {}; {}; commit {}; portable lanes: {}.\n\n",
            m.date,
            m.cpu,
            Count(m.threads, "thread"),
            m.compiler,
            m.commit,
            m.portable_lanes,
        );
        let needed = CAMERA_PIXEL_RATES.map(|(camera, rate)| format!("{rate} ({camera})")).join(", ");
        let _ = writeln!(text, "Speeds are in 10^9 pixel-readouts per second. Cameras produce {needed}.\n");
        text += &self.kernels_markdown();
        text += "\n| other work | backend | noise | light | threads | speed |\n|---|---|---|---|--:|--:|\n";
        for r in self.rows.iter().filter(|r| !r.is_kernel()) {
            let _ = write!(text, "| {} | {} | {} | {} ", r.work, r.backend, r.noise_set, r.light);
            let _ = writeln!(text, "| {} | {:.3} |", r.threads, r.speed);
        }
        text += "\n| also measured | value | unit |\n|---|--:|---|\n";
        for f in &self.figures {
            let _ = writeln!(text, "| {} | {:.3} | {} |", f.name, f.value, f.unit);
        }
        text += "\n| driving scene, 400x250 | threads | ms |\n|---|--:|--:|\n";
        for d in &self.scenes {
            let threads = if d.threads == 0 { "not measured here".to_owned() } else { d.threads.to_string() };
            let _ = writeln!(text, "| {} | {threads} | {:.1} |", d.name, d.ms);
        }
        text + &self.processes_markdown()
    }

    /// Returns the speeds of the kernels: one row per noise and light, one column per backend.
    fn kernels_markdown(&self) -> String {
        let kernels = || self.rows.iter().filter(|r| r.is_kernel());
        let (mut seen, mut shown) = (BTreeSet::new(), BTreeSet::new());
        let backends: Vec<&str> = kernels().map(|r| r.backend).filter(|b| seen.insert(*b)).collect();
        let mut text = format!("| kernel: noise | light | {} |\n", backends.join(" | "));
        let _ = writeln!(text, "|---|---|{}", "--:|".repeat(backends.len()));
        for row in kernels().filter(|r| shown.insert((r.noise_set, r.light))) {
            let _ = write!(text, "| {} | {} |", row.noise_set, row.light);
            for backend in &backends {
                let same =
                    |r: &&SpeedRow| (r.backend, r.noise_set, r.light) == (*backend, row.noise_set, row.light);
                let speed = kernels().find(same).map_or_else(String::new, |r| format!("{:.3}", r.speed));
                let _ = write!(text, " {speed} |");
            }
            text.push('\n');
        }
        text
    }

    fn stages_markdown(&self) -> String {
        let lights = STAGE_LIGHTINGS.map(|l| format!("{}, ms | ", l.name())).concat();
        let mut text = format!("\n| stage of a key frame, one thread | {lights}\n|---|--:|--:|--:|\n");
        for s in &self.stages {
            let cells = s.ms.map(|ms| format!("{ms:.1} | ")).concat();
            let _ = writeln!(text, "| {} | {}", s.name, cells.trim_end());
        }
        text
    }

    fn processes_markdown(&self) -> String {
        if self.processes.is_empty() {
            return String::new();
        }
        let has_baseline = self.processes.iter().any(|p| p.baseline.is_some());
        let seconds = |s: Option<f64>| s.map_or_else(|| "unknown".to_owned(), |s| format!("{s:.2}"));
        let mut text =
            "\n| whole process, 400x250 | processor time, s | wall, s | real time | GB/s |".to_owned();
        text += if has_baseline {
            " other build: processor time, s | wall, s | speedup of this build |\n"
        } else {
            "\n"
        };
        text += if has_baseline { "|---|--:|--:|--:|--:|--:|--:|--:|\n" } else { "|---|--:|--:|--:|--:|\n" };
        for p in &self.processes {
            let (processor, wall) = (seconds(p.run_time.processor_s), p.run_time.wall_s);
            let _ = write!(text, "| {} | {processor} | {wall:.2} | {:.3} ", p.name, p.real_time_factor());
            let _ = write!(text, "| {:.3} |", p.gigabytes_per_second());
            if let Some(b) = p.baseline {
                let _ =
                    write!(text, " {} | {:.2} | {:.2} |", seconds(b.processor_s), b.wall_s, b.wall_s / wall);
            } else if has_baseline {
                text += " failed | | |";
            }
            text.push('\n');
        }
        text
    }

    pub(crate) fn json(&self) -> Value {
        let row = |r: &SpeedRow| {
            let real = |(name, needed): (&str, f64)| (name.to_owned(), json!(r.speed / needed));
            let real: serde_json::Map<_, _> = CAMERA_PIXEL_RATES.map(real).into_iter().collect();
            json!({"work": r.work, "backend": r.backend, "noise": r.noise_set, "light": r.light,
                "threads": r.threads, "gpixel_readouts_per_s": r.speed,
                "speedup_over_scalar": r.speed / self.scalar_speed(), "real_time_factors": real,
            })
        };
        let mut all = json!(self.machine);
        all["speeds"] = self.rows.iter().map(row).collect();
        all["figures"] = json!(self.figures);
        all["scenes"] = json!(self.scenes);
        all["stages"] = self.stages.iter().map(RenderStage::json).collect();
        all["processes"] = self.processes.iter().map(ProcessResult::json).collect();
        all
    }

    /// Writes the page. The existing text after the marker line is preserved.
    pub(crate) fn write_page(&self, path: &Path) -> Result<()> {
        let old = std::fs::read_to_string(path).unwrap_or_default();
        let handwritten = old.split_once(HANDWRITTEN_MARKER).map_or("\n", |(_, handwritten)| handwritten);
        let page = format!(
            "# Performance\n\nWritten by `spikelane speed --markdown docs/why/performance.md`.\n\n{}\n{HANDWRITTEN_MARKER}{handwritten}",
            self.page_tables()
        );
        std::fs::write(path, page).map_err(|e| Error::io(path.display(), e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_have_one_row_per_noise_and_light_and_one_column_per_backend() {
        let row = |work, backend, light, speed| SpeedRow::new(work, backend, "ideal", light, 1, speed);
        let rows = vec![
            row("plain loop", "scalar", "held", 1e9),
            row(KERNEL_WORK, "portable", "held", 2e9),
            row(KERNEL_WORK, "portable", "new frame", 3e9),
            row(KERNEL_WORK, "avx2", "held", 4e9),
        ];
        let report = SpeedReport { rows, ..SpeedReport::default() };
        let expected = "| kernel: noise | light | portable | avx2 |\n|---|---|--:|--:|\n\
                        | ideal | held | 2.000 | 4.000 |\n| ideal | new frame | 3.000 |  |\n";
        assert_eq!(report.kernels_markdown(), expected);
    }
}
