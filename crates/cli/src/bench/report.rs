//! The results as a table, as JSON, and as a page of the documentation.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};
use spikelane::{Error, Kind, Result};

use super::processes::Process;
use super::scenes::{Drawn, STAGED, Stage};

/// What follows this line in a page is kept when the page is written again.
const MARKER: &str = "<!-- kept: what follows is written by hand -->";

/// Around the table of scene errors in a page.
pub(crate) const SCENE_ERROR: (&str, &str) = ("<!-- scene error: begin -->\n", "<!-- scene error: end -->\n");

/// Pixel-readouts per second that a camera of this size and rate produces.
const CAMERAS: [(&str, f64); 3] =
    [("400x250 at 20 kHz", 2.0), ("400x250 at 40 kHz", 4.0), ("1000x1000 at 20 kHz", 20.0)];

/// One measured case.
pub(crate) struct Row {
    pub what: &'static str,
    pub backend: &'static str,
    pub noise: &'static str,
    pub light: &'static str,
    pub threads: usize,
    /// 10^9 pixel-readouts per second.
    pub speed: f64,
}

impl Row {
    pub(crate) fn new(
        what: &'static str,
        backend: &'static str,
        noise: &'static str,
        light: &'static str,
        threads: usize,
        speed: f64,
    ) -> Self {
        Self { what, backend, noise, light, threads, speed: speed / 1e9 }
    }
}

/// One number with its unit.
pub(crate) struct Fact {
    pub name: String,
    pub value: f64,
    pub unit: &'static str,
}

/// Where and with what it was measured.
#[derive(Default)]
pub(crate) struct Machine {
    date: String,
    cpu: String,
    threads: usize,
    compiler: String,
    commit: String,
    lanes: &'static str,
}

impl Machine {
    pub(crate) fn here() -> Self {
        let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| model(&text));
        Self {
            date: spikelane_measure::report::today(),
            cpu: cpu.unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            compiler: said(Command::new("rustc").arg("--version")),
            commit: said(Command::new("git").args(["describe", "--always", "--dirty"])),
            lanes: if cfg!(target_feature = "avx2") { "built for this CPU" } else { "default build" },
        }
    }
}

fn model(cpuinfo: &str) -> Option<String> {
    let field = |name: &str| {
        let line = cpuinfo.lines().find(|l| l.starts_with(name))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    let number = |name: &str| field(name).unwrap_or_default();
    Some(format!("{} (family {}, model {})", field("model name")?, number("cpu family"), number("model\t")))
}

fn said(command: &mut Command) -> String {
    let output = command.output().ok().filter(|o| o.status.success());
    let text = output.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned());
    text.filter(|t| !t.is_empty()).unwrap_or_else(|| "unknown".to_owned())
}

/// Everything that was measured.
#[derive(Default)]
pub(crate) struct Report {
    pub machine: Machine,
    pub rows: Vec<Row>,
    pub facts: Vec<Fact>,
    pub scenes: Vec<Drawn>,
    pub stages: Vec<Stage>,
    pub processes: Vec<Process>,
}

impl Report {
    fn scalar(&self) -> f64 {
        self.rows.iter().find(|r| r.backend == "scalar").map_or(f64::NAN, |r| r.speed)
    }

    /// The tables, as Markdown, which reads well in a terminal too.
    pub(crate) fn text(&self) -> String {
        let m = &self.machine;
        let mut text = format!(
            "Measured on {}: {}, {} threads; {}; commit {}; portable lanes: {}.\n\n",
            m.date, m.cpu, m.threads, m.compiler, m.commit, m.lanes
        );
        text += "| work | backend | noise | light | threads | Gpixel-readouts/s | x plain loop | ";
        text += "real time 400x250@20k | @40k | 1000x1000@20k |\n|---|---|---|---|--:|--:|--:|--:|--:|--:|\n";
        for r in &self.rows {
            let times = r.speed / self.scalar();
            let _ = write!(text, "| {} | {} | {} | {} | {} ", r.what, r.backend, r.noise, r.light, r.threads);
            let _ = write!(text, "| {:.3} | {times:.1} ", r.speed);
            for (_, needed) in CAMERAS {
                let _ = write!(text, "| {:.2} ", r.speed / needed);
            }
            text += "|\n";
        }
        text += "\n| also measured | value | unit |\n|---|--:|---|\n";
        for f in &self.facts {
            let _ = writeln!(text, "| {} | {:.3} | {} |", f.name, f.value, f.unit);
        }
        text += "\n| driving scene, 400x250 | threads | ms | 30 x 500 of them, hours |\n|---|--:|--:|--:|\n";
        for d in &self.scenes {
            let threads = if d.threads == 0 { "not measured here".to_owned() } else { d.threads.to_string() };
            let _ =
                writeln!(text, "| {} | {threads} | {:.1} | {:.2} |", d.what, d.ms, d.ms * 15_000.0 / 3.6e6);
        }
        text + &self.stages_text() + &self.processes_text()
    }

    fn stages_text(&self) -> String {
        let lights = STAGED.map(|l| format!("{}, ms | ", l.name())).concat();
        let mut text = format!("\n| stage of a key frame, one thread | {lights}\n|---|--:|--:|--:|\n");
        for s in &self.stages {
            let cells = s.ms.map(|ms| format!("{ms:.1} | ")).concat();
            let _ = writeln!(text, "| {} | {}", s.what, cells.trim_end());
        }
        text
    }

    fn processes_text(&self) -> String {
        if self.processes.is_empty() {
            return String::new();
        }
        let beside = self.processes.iter().any(|p| p.beside.is_some());
        let seconds = |s: Option<f64>| s.map_or_else(|| "not known here".to_owned(), |s| format!("{s:.2}"));
        let mut text =
            "\n| whole process, 400x250 | processor time, s | wall, s | real time | GB/s |".to_owned();
        text += if beside { " other build: processor time, s | wall, s | this one faster |\n" } else { "\n" };
        text += if beside { "|---|--:|--:|--:|--:|--:|--:|--:|\n" } else { "|---|--:|--:|--:|--:|\n" };
        for p in &self.processes {
            let (processor, wall) = (seconds(p.took.processor_s), p.took.wall_s);
            let _ = write!(text, "| {} | {processor} | {wall:.2} | {:.3} ", p.what, p.of_real_time());
            let _ = write!(text, "| {:.3} |", p.gb_s());
            if let Some(b) = p.beside {
                let _ =
                    write!(text, " {} | {:.2} | {:.2} |", seconds(b.processor_s), b.wall_s, b.wall_s / wall);
            } else if beside {
                text += " failed | | |";
            }
            text.push('\n');
        }
        text
    }

    pub(crate) fn json(&self) -> Value {
        let row = |r: &Row| {
            let real = |(name, needed): (&str, f64)| (name.to_owned(), json!(r.speed / needed));
            let real: serde_json::Map<_, _> = CAMERAS.map(real).into_iter().collect();
            json!({"work": r.what, "backend": r.backend, "noise": r.noise, "light": r.light,
                "threads": r.threads, "gpixel_readouts_per_s": r.speed,
                "times_scalar": r.speed / self.scalar(), "real_time": real})
        };
        let fact = |f: &Fact| json!({"name": f.name, "value": f.value, "unit": f.unit});
        let m = &self.machine;
        json!({"date": m.date, "cpu": m.cpu, "threads": m.threads, "compiler": m.compiler,
            "commit": m.commit, "portable": m.lanes,
            "speeds": self.rows.iter().map(row).collect::<Vec<_>>(),
            "facts": self.facts.iter().map(fact).collect::<Vec<_>>(),
            "scenes": self.scenes.iter().map(Drawn::json).collect::<Vec<_>>(),
            "stages": self.stages.iter().map(Stage::json).collect::<Vec<_>>(),
            "processes": self.processes.iter().map(Process::json).collect::<Vec<_>>()})
    }

    /// Writes the page, keeping what was written by hand behind the marker.
    pub(crate) fn write_page(&self, path: &Path) -> Result<()> {
        let old = std::fs::read_to_string(path).unwrap_or_default();
        let kept = old.split_once(MARKER).map_or("\n", |(_, kept)| kept);
        let page = format!(
            "# Performance\n\nWritten by `spikelane bench --markdown docs/why/performance.md`.\n\n{}\n{MARKER}{kept}",
            self.text()
        );
        std::fs::write(path, page).map_err(|e| Error::io(path.display(), e))
    }
}

/// Puts `text` between two markers of a page that has them.
pub(crate) fn put_between(path: &Path, (begin, end): (&str, &str), text: &str) -> Result<()> {
    let old = std::fs::read_to_string(path).map_err(|e| Error::io(path.display(), e))?;
    let parts = old.split_once(begin).and_then(|(before, rest)| Some((before, rest.split_once(end)?.1)));
    let Some((before, after)) = parts else {
        return Err(Error::new(Kind::Input, path.display())
            .found("no place for the table")
            .expected(format_args!("the lines {} and {}", begin.trim_end(), end.trim_end())));
    };
    std::fs::write(path, format!("{before}{begin}{text}{end}{after}"))
        .map_err(|e| Error::io(path.display(), e))
}
