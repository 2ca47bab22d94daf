//! Tests what methods of strangers can read, change and leave behind.

use std::process::Output;
#[cfg(target_os = "linux")]
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::benchmark::short_suite;
use crate::program_support::{TestFolder, npy_f32};

/// Returns a folder with a generated suite of `sequences` scenes without a curve, and the folder `state`.
fn generated(sequences: u32) -> TestFolder {
    let place = TestFolder::new();
    let text = short_suite(sequences);
    place.write("tiny.toml", text.split("[[curves]]").next().unwrap());
    place.run_ok("benchmark generate tiny.toml -o data");
    std::fs::create_dir(place.path("state")).unwrap();
    place
}

/// Runs a method. Its files for temporary use are in the folder `tmp`.
fn run(place: &TestFolder, line: &str, method: [&str; 2]) -> Output {
    std::fs::create_dir_all(place.path("tmp")).unwrap();
    let mut command = place.command(&format!("benchmark run data {line}"));
    let output = command.args(method).env("TMPDIR", place.path("tmp")).output().unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Runs a shell script as a command.
fn run_script(place: &TestFolder, line: &str, script: &str) -> Output {
    place.write("method.sh", script);
    run(place, line, ["--command", "sh method.sh {stream} {output}"])
}

#[cfg(target_os = "linux")]
fn is_sandboxed(output: &Output) -> bool {
    String::from_utf8_lossy(&output.stderr).contains("sandbox active")
}

/// Returns the PSNR and the fault of each sequence.
fn scores(place: &TestFolder, run: &str) -> Vec<(f64, Option<String>)> {
    let file = place.json(&format!("{run}/score.json"));
    let score = |s: &Value| (s["scores"]["psnr"].as_f64().unwrap(), s["fault"].as_str().map(str::to_owned));
    file["sequences"].as_array().unwrap().iter().map(score).collect()
}

/// Returns the command lines of the processes whose current folder is `place`, or a folder in it.
#[cfg(target_os = "linux")]
fn processes_in(place: &TestFolder) -> Vec<String> {
    let folder = place.path("").canonicalize().unwrap();
    let is_inside = |process: &std::path::Path| {
        std::fs::read_link(process.join("cwd")).is_ok_and(|current| current.starts_with(&folder))
    };
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    entries
        .map(|entry| entry.path())
        .filter(|process| is_inside(process))
        .map(|process| {
            String::from_utf8_lossy(&std::fs::read(process.join("cmdline")).unwrap_or_default()).into()
        })
        .collect()
}

#[test]
fn a_method_receives_the_stream_and_its_size_and_nothing_else() {
    let place = generated(1);
    let script = "ls -A \"$(dirname \"$1\")\" > state/files; cp \"$1\" \"${1%.dat}.json\" state; echo \"$@\" > state/paths";
    run_script(&place, "-o run --allow-write state", script);
    let text = |name: &str| String::from_utf8(place.read(name)).unwrap();
    assert_eq!(text("state/files"), "stream.dat\nstream.json\n");
    assert_eq!(
        place.read("state/stream.dat"),
        place.read("data/groups/test/sequences/scene-0000/stream.dat")
    );
    let keys: Vec<_> = place.json("state/stream.json").as_object().unwrap().keys().cloned().collect();
    let expected = ["file", "height", "layout", "mosaic", "readout_hz", "readouts", "width"];
    assert_eq!(keys, expected);
    let inspected = place.run_ok("inspect state/stream.dat --json").events();
    assert_eq!((&inspected[0]["width"], &inspected[0]["height"]), (&48.into(), &32.into()));
    for word in ["data", "test", "scene", "run"] {
        let outside = text("state/paths").replace(&place.path("").display().to_string(), "");
        assert!(!outside.contains(word), "{word}: {outside}");
    }
    assert_eq!(std::fs::read_dir(place.path("tmp")).unwrap().count(), 0);
}

/// Commands that reach for the reference, and for other files of the suite and the run. `$R` is the reference.
#[cfg(target_os = "linux")]
const REACHES: &[(&str, &str)] = &[
    ("copy", "cat \"$R\" > \"$2\""),
    ("link", "ln -s \"$R\" \"$2\""),
    ("hard link", "ln \"$R\" \"$2\""),
    ("folder link", "d=\"$(dirname \"$2\")\"; rm -r \"$d\"; ln -s \"$(dirname \"$R\")\" \"$d\"; exit 0"),
    ("late copy", "cp state/half.npy \"$2\"; setsid sh -c \"sleep 0.3; cat '$R' > '$2'\" & exit 0"),
    ("change", "cp state/half.npy \"$R\" && cat \"$R\" > \"$2\""),
    ("removal", "rm -rf data run; cp state/half.npy \"$2\""),
    ("other run", "cp state/half.npy \"$2\"; echo x > run/results/test/scene-0000.json"),
];

#[cfg(target_os = "linux")]
#[test]
fn a_sandboxed_method_cannot_reach_the_suite_and_the_run() {
    let place = generated(2);
    let half = npy_f32([1, 32, 48], &[0.5; 32 * 48]);
    place.write("state/half.npy", half);
    let script = |reach: &str| {
        format!(
            "R='{}'\n{reach}\n",
            place.path("data/groups/test/sequences/scene-0000/images/000004.npy").display()
        )
    };
    // Without a sandbox, the copy has the largest PSNR. The test below therefore can fail.
    run_script(&place, "-o open --no-sandbox", &script(REACHES[0].1));
    assert_eq!(scores(&place, "open")[0].0, 144.5);
    assert_eq!(place.json("open/run.json")["sandbox"], "off");
    for (name, reach) in REACHES {
        let output = run_script(&place, "-o run", &script(reach));
        if !is_sandboxed(&output) {
            return;
        }
        for (psnr, _) in scores(&place, "run") {
            assert!(psnr < 60.0, "{name}: {psnr}");
        }
        place.run_ok("benchmark verify data");
        place.run_ok("benchmark verify run/score.json --suite data");
        assert_eq!(place.json("run/score.json")["sandbox"], "active");
        std::fs::remove_dir_all(place.path("run")).unwrap();
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_method_reads_only_the_folders_that_are_allowed() {
    let place = generated(1);
    std::fs::create_dir(place.path("method")).unwrap();
    place.write("private.txt", "private");
    place.write("method/method.sh", "cat private.txt; cat method/method.sh > state/read; exit 3");
    let line = "-o run --allow-read method --allow-write state";
    let output = run(&place, line, ["--command", "sh method/method.sh {stream} {output}"]);
    assert!(!is_sandboxed(&output) || scores(&place, "run")[0].1.as_ref().unwrap().contains("private.txt"));
    assert_eq!(place.read("state/read"), place.read("method/method.sh"));
    let method = ["--command", "sh method.sh {stream} {output}"];
    for (line, code, words) in [
        ("-o no --allow-write data", 2, ["data", "suite"]),
        ("-o no --allow-read missing", 5, ["missing", "no such file"]),
        ("-o no --allow-read state --no-sandbox", 2, ["--allow-read", "--no-sandbox"]),
    ] {
        let refused = place.command(&format!("benchmark run data {line}")).args(method).output().unwrap();
        let stderr = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(words.iter().all(|word| stderr.contains(word)), "{line}: {stderr}");
        assert_eq!(refused.status.code(), Some(code), "{line}: {stderr}");
        assert!(!place.path("no").exists(), "{line}");
    }
    place.run_refused(
        "benchmark run data -o no --baseline tfp --allow-read state",
        2,
        &["tfp", "a command or a server"],
    );
    place.run_refused("benchmark verify data --no-sandbox", 2, &["--run"]);
}

#[cfg(target_os = "linux")]
#[test]
fn all_processes_of_a_method_end_with_its_sequence() {
    let place = generated(1);
    let good = "cp state/half.npy \"$2\"\n";
    place.write("state/half.npy", npy_f32([1, 32, 48], &[0.5; 32 * 48]));
    for (name, script) in [
        ("group", format!("sleep 60 &\n{good}")),
        ("session", format!("setsid sh -c 'sleep 60 & sleep 60' &\n{good}")),
        ("detached", format!("(setsid sh -c '(setsid sleep 60 &)' &)\n{good}")),
        ("failure", "setsid sleep 60 & exit 3".to_owned()),
        ("time limit", "setsid sleep 60 & sleep 60".to_owned()),
    ] {
        let start = Instant::now();
        run_script(&place, &format!("-o {} --time-limit 1", name.replace(' ', "-")), &script);
        assert!(start.elapsed() < Duration::from_secs(50), "{name}: the program waited for a process");
        assert_eq!(processes_in(&place), [""; 0], "{name}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_ends_all_processes_of_a_method() {
    let place = generated(1);
    place.write("method.sh", "setsid sleep 60 & touch state/started; sleep 60");
    let mut command = place.command("benchmark run data -o run --allow-write state --command");
    let mut program = command.arg("sh method.sh {stream} {output}").spawn().unwrap();
    let start = Instant::now();
    while !place.path("state/started").exists() && start.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(2));
    }
    std::process::Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap();
    assert_eq!(program.wait().unwrap().code(), Some(130));
    assert_eq!(processes_in(&place), [""; 0]);
}

/// Servers that break the protocol or write hostile outputs. The expected text is part of each fault; an empty text means
/// a valid output with half of the light everywhere. `$out` is the output, and `good` writes it.
const SERVERS: &[(&str, &str, [&str; 2])] = &[
    ("ready never", "sleep 60", ["time limit", "time limit"]),
    ("ends at once", "exit 3", ["the server ended", "the server ended"]),
    ("ok before ready", "echo ok; echo ready; each good", ["instead of `ready`", "instead of `ready`"]),
    ("answers never", "echo ready; sleep 60", ["time limit", "time limit"]),
    ("answers before the question", "echo ready; echo ok; echo ok; each good", ["", ""]),
    ("answers twice", "twice() { good; echo ok; }; echo ready; each twice", ["", ""]),
    ("answers endlessly", "echo ready; while :; do echo ok; done", ["", ""]),
    ("endless line", "echo ready; while :; do printf xxxxxxxxxxxxxxxx; done", ["", ""]),
    (
        "half an answer",
        "half() { good; printf o; sleep 60; }; echo ready; each half",
        ["time limit", "time limit"],
    ),
    (
        "one byte at a time",
        "slow() { good; printf o; sleep 0.1; printf k; sleep 0.1; }; echo ready; each slow",
        ["time limit", "time limit"],
    ),
    ("ends early", "echo ready; read -r line; exit 0", ["the server ended", "the server ended"]),
    ("closes its output", "echo ready; exec >&-; sleep 60", ["the server ended", "the server ended"]),
    ("closes its input", "echo ready; exec <&-; sleep 60", ["", ""]),
    (
        "binary answer",
        "echo ready; noise() { printf '\\377\\000\\376\\n'; }; each noise",
        ["answered", "answered"],
    ),
    ("empty answer", "echo ready; each echo", ["answered", "answered"]),
    (
        "floods standard error",
        "flood() { cat data.bin data.bin >&2; good; }; echo ready; each flood",
        ["", ""],
    ),
    ("ignores signals and the end", "trap '' TERM INT HUP PIPE; echo ready; each good; sleep 60", ["", ""]),
    ("forks", "fork() { setsid sleep 60 & sleep 60 & good; }; echo ready; each fork", ["", ""]),
    ("NaN", "nan() { cp nan.npy \"$out\"; }; echo ready; each nan", ["NaN", "NaN"]),
    ("type f2", "half() { cp f2.npy \"$out\"; }; echo ready; each half", ["type f16", "type f16"]),
    (
        "negative length",
        "short() { cp negative.npy \"$out\"; }; echo ready; each short",
        ["output of the method"; 2],
    ),
    ("huge length", "huge() { cp huge.npy \"$out\"; }; echo ready; each huge", ["output of the method"; 2]),
    (
        "large output",
        "big() { cat data.bin data.bin > \"$out\"; }; echo ready; each big",
        ["more than", "more than"],
    ),
    ("link", "link() { ln -s /dev/zero \"$out\"; }; echo ready; each link", ["a link", "a link"]),
    ("pipe", "pipe() { mkfifo \"$out\"; }; echo ready; each pipe", ["a link, folder, pipe", "pipe"]),
    ("folder", "folder() { mkdir \"$out\"; }; echo ready; each folder", ["folder", "folder"]),
    (
        "output with another name",
        "other() { cp half.npy \"$out.npy\"; }; echo ready; each other",
        ["no output", "no output"],
    ),
];

/// Returns the script of a server.
fn server_script(body: &str) -> String {
    format!(
        "good() {{ cp half.npy \"$out\"; }}\n\
         each() {{ while read -r line; do out=${{line#*\\\"output\\\":\\\"}}; out=${{out%%\\\"*}}; \"$@\"; echo ok; done; }}\n\
         {body}\n"
    )
}

#[test]
fn a_hostile_server_costs_only_its_own_scores() {
    let place = generated(2);
    let good = npy_f32([1, 32, 48], &[0.5; 32 * 48]);
    let text = |from: &str, to: &str| {
        let header = String::from_utf8_lossy(&good[10..128]).replace(from, to);
        let header = format!("{:<117}\n", header.trim_end());
        [&good[..10], header.as_bytes(), &good[128..]].concat()
    };
    place.write("nan.npy", npy_f32([1, 32, 48], &[f32::NAN; 32 * 48]));
    place.write("f2.npy", text("<f4", "<f2"));
    place.write("negative.npy", text("(1, 32, 48)", "(1, -32, 48)"));
    place.write("huge.npy", text("(1, 32, 48)", "(4294967296, 4294967296)"));
    place.write("data.bin", vec![b'x'; 1 << 20]);
    place.write("half.npy", &good);
    for (number, (_, body, _)) in SERVERS.iter().enumerate() {
        place.write(&format!("server{number}.sh"), server_script(body));
    }
    place.write("honest.sh", server_script("echo ready; each good"));
    run(&place, "-o half", ["--server", "sh honest.sh"]);
    let half = scores(&place, "half");
    assert!(half.iter().all(|(_, fault)| fault.is_none()), "{half:?}");
    let place = &place;
    // Servers that exceed a time limit do not delay the others.
    std::thread::scope(|scope| {
        for number in 0..SERVERS.len() {
            scope.spawn(move || {
                let line = format!("-o run{number} --time-limit 0.1");
                run(place, &line, ["--server", &format!("sh server{number}.sh")]);
            });
        }
    });
    for (number, (name, _, expected)) in SERVERS.iter().enumerate() {
        for (index, (psnr, fault)) in scores(place, &format!("run{number}")).into_iter().enumerate() {
            match (fault, expected[index]) {
                // A slow machine can exceed the time limit, and an early answer can be found late.
                (Some(fault), "") => assert!(!fault.contains('\n'), "{name}: {fault}"),
                (None, "") => assert_eq!(psnr, half[index].0, "{name}"),
                (Some(fault), words) => {
                    assert!(fault.contains(words) || fault.contains("time limit"), "{name}: {fault}");
                }
                (None, words) => panic!("{name}: no fault with `{words}`"),
            }
        }
    }
    place.run_ok("benchmark verify data");
    #[cfg(target_os = "linux")]
    assert_eq!(processes_in(place), [""; 0]);
    assert_eq!(std::fs::read_dir(place.path("tmp")).unwrap().count(), 0);
}
