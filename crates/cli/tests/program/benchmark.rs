//! Tests the command `benchmark`.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::program_support::{TestFolder, npy_f32};

/// A suite of seven small scenes and a curve with two values.
const SUITE: &str = r#"
format_version = 1
name = "tiny"
version = "0.1.0"
description = "Small images for tests"
scene_version = SCENES
release = "0.1.0"
task = "reconstruction"
metrics = ["psnr/1", "ssim/1", "detail_slope/1", "high_pass_noise/1"]
dataset.scenes = { images_per_scene = 9, label_every = 0, samples = 4, vehicles = 0 }
dataset.images = { every = 4, format = "f32" }
[dataset.camera]
preset = "physical"
sensor = { width = 48, height = 32, thresholds_at_full_scale = 0.6 }
[[splits]]
name = "test"
seed = 5
sequences = 7
[[splits]]
name = "train"
seed = 6
sequences = 1
[[curves]]
name = "light"
quantity = "light"
values = [0.1, 1.0]
sequences = 1
"#;

fn suite_text() -> String {
    SUITE.replace("SCENES", &spikelane_scene::SCENE_VERSION.to_string())
}

/// Returns a suite with `sequences` scenes.
pub(crate) fn short_suite(sequences: u32) -> String {
    suite_text().replace("sequences = 7", &format!("sequences = {sequences}"))
}

/// Returns a folder with a generated suite, and the digest of the suite.
fn generated(text: &str) -> (TestFolder, String) {
    let place = TestFolder::new();
    place.write("tiny.toml", text);
    let ran = place.run_ok("benchmark generate tiny.toml -o data --json");
    let digest = ran.events().last().unwrap()["digest"].as_str().unwrap().to_owned();
    (place, digest)
}

/// Returns the scores of a sequence from a score file.
fn sequence<'a>(file: &'a Value, group: &str, id: &str) -> &'a Value {
    let all = file["sequences"].as_array().unwrap();
    all.iter().find(|s| s["group"] == group && s["id"] == id).unwrap()
}

#[test]
fn every_builtin_suite_is_listed_and_described() {
    let place = TestFolder::new();
    let events = place.run_ok("benchmark list --json").events();
    let names: Vec<_> = events.iter().map(|event| event["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"quick") && names.contains(&"stress"), "{names:?}");
    for name in names {
        let ran = place.run_ok(&format!("benchmark list {name}"));
        assert!(ran.stdout.contains("metrics ") && ran.stdout.contains("\ntest "), "{}", ran.stdout);
    }
    place.run_refused("benchmark list qick", 2, &["qick", "did you mean quick?"]);
}

#[cfg(unix)]
#[test]
fn each_fault_costs_only_the_score_of_its_sequence() {
    let (place, _) = generated(&suite_text());
    place.run_ok("benchmark run data --baseline tfp -o tfp");
    place.run_ok("benchmark run data --baseline span-blur -o good");
    place.write("nan.npy", npy_f32([1, 32, 48], &[f32::NAN; 32 * 48]));
    place.write("small.npy", npy_f32([1, 8, 8], &[0.5; 64]));
    // The output of scene-0000 and of the curve is the output of another method. All other outputs are faulty.
    std::fs::create_dir(place.path("state")).unwrap();
    place.write(
        "method.sh",
        "echo >> state/calls\n\
         case $(wc -l < state/calls | tr -d ' ') in\n\
         1) cp good/outputs/test/scene-0000.npy \"$2\";;\n\
         2) echo 'no weights' >&2; exit 3;;\n\
         3) sleep 60;;\n\
         4) head -c 200 good/outputs/test/scene-0003.npy > \"$2\";;\n\
         5) cp nan.npy \"$2\";;\n\
         6) cp small.npy \"$2\";;\n\
         7) ;;\n\
         8) cp good/outputs/light-0.1/scene-0000.npy \"$2\";;\n\
         9) cp good/outputs/light-1/scene-0000.npy \"$2\";;\n\
         esac\n",
    );
    let mut command =
        place.command("benchmark run data -o faulty --time-limit 2 --allow-write state --command");
    let start = Instant::now();
    let output = command.arg("sh method.sh {stream} {output}").output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    assert!(start.elapsed() < Duration::from_secs(50), "the process was not stopped");
    let [faulty, tfp, good] = ["faulty", "tfp", "good"].map(|run| place.json(&format!("{run}/score.json")));
    for (group, id) in [("test", "scene-0000"), ("light-0.1", "scene-0000"), ("light-1", "scene-0000")] {
        let [a, b] = [&faulty, &good].map(|file| &sequence(file, group, id)["scores"]);
        assert_eq!(a, b, "{group}/{id}");
        assert_ne!(a, &sequence(&tfp, group, id)["scores"], "{group}/{id}");
        assert!(sequence(&faulty, group, id)["fault"].is_null());
    }
    for (number, word) in [
        (1, "no weights"),
        (2, "time limit"),
        (3, "truncated"),
        (4, "NaN"),
        (5, "(1, 8, 8)"),
        (6, "no output"),
    ] {
        let id = format!("scene-{number:04}");
        let one = sequence(&faulty, "test", &id);
        let fault = one["fault"].as_str().unwrap();
        assert!(fault.contains(word), "{id}: {fault}");
        assert_eq!(one["scores"], sequence(&tfp, "test", &id)["scores"], "{id}");
        let lines: Vec<_> =
            stderr.lines().filter(|l| l.starts_with("trivial answer") && l.contains(&id)).collect();
        assert_eq!(lines.len(), 1, "{stderr}");
    }
    assert_eq!(faulty["summaries"][0]["faults"], 6);
}

#[cfg(unix)]
#[test]
fn a_server_answers_requests_and_is_started_again_after_a_crash() {
    let (place, _) = generated(&short_suite(4));
    place.run_ok("benchmark run data --baseline span -o good");
    // The server ends at scene-0001 and refuses scene-0002. Its first request is scene-0000, and after its second start
    // scene-0002.
    std::fs::create_dir(place.path("state")).unwrap();
    place.write(
        "server.sh",
        "echo start >> state/starts\necho ready\nwhile read -r line; do\n\
         echo >> state/requests\n\
         output=$(echo \"$line\" | sed 's/.*\"output\":\"\\([^\"]*\\)\".*/\\1/')\n\
         case $(wc -l < state/requests | tr -d ' ') in\n\
         2) exit 1;;\n\
         3) echo 'too dark';;\n\
         4) cp good/outputs/test/scene-0003.npy \"$output\"; echo ok;;\n\
         *) cp good/outputs/test/scene-0000.npy \"$output\"; echo ok;;\n\
         esac\ndone\n",
    );
    let line = "benchmark run data -o served --allow-write state --server";
    let output = place.command(line).arg("sh server.sh").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let [served, good] = ["served", "good"].map(|run| place.json(&format!("{run}/score.json")));
    assert_eq!(
        sequence(&served, "test", "scene-0003")["scores"],
        sequence(&good, "test", "scene-0003")["scores"]
    );
    for (id, word) in [("scene-0001", "the server ended"), ("scene-0002", "too dark")] {
        let fault = sequence(&served, "test", id)["fault"].as_str().unwrap();
        assert!(fault.contains(word), "{fault}");
    }
    assert_eq!(place.read("state/starts"), b"start\nstart\n");
}

#[test]
fn a_command_without_its_placeholders_is_refused() {
    let (place, _) = generated(&short_suite(1));
    place.run_refused("benchmark run data -o a --command true", 2, &["{stream}", "{output}"]);
    place.run_refused("benchmark run data -o a --server cat{stream}", 2, &["placeholder"]);
    place.run_refused("benchmark run data -o a --baseline median", 2, &["median", "tfi-blur"]);
    place.run_refused("benchmark run data -o a", 2, &["--command"]);
    let output = place
        .command("benchmark run data -o a --command")
        .arg("no-such-program {stream} {output}")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(8));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no-such-program"));
}

/// Waits until a file exists. The limit only ends a test that fails.
fn wait_for(path: &Path) {
    let start = Instant::now();
    while !path.exists() && start.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_killed_generation_resumes_to_the_same_digest() {
    let (place, digest) = generated(&short_suite(3));
    let mut child = place.command("benchmark generate tiny.toml -o killed").spawn().unwrap();
    wait_for(&place.path("killed/groups/test/sequences/scene-0000/record.json"));
    child.kill().unwrap();
    child.wait().unwrap();
    let ran = place.run_ok("benchmark generate tiny.toml -o killed --resume");
    assert!(ran.stdout.contains(&digest), "{}", ran.stdout);
    place.run_refused("benchmark generate tiny.toml -o killed", 7, &["--resume"]);
    // Another suite does not continue this one.
    place.write("other.toml", short_suite(2));
    place.run_refused("benchmark generate other.toml -o killed --resume", 3, &["another text"]);
}

#[cfg(unix)]
#[test]
fn a_killed_run_resumes_after_its_last_sequence() {
    let (place, _) = generated(&short_suite(3));
    place.run_ok("benchmark run data --baseline tfi -o good");
    std::fs::create_dir(place.path("state")).unwrap();
    place.write(
        "slow.sh",
        "sleep 0.2\necho >> state/ran\n\
         case $(ls slow/results/*/*.json 2>/dev/null | wc -l | tr -d ' ') in\n\
         [012]) name=test/scene-000$(ls slow/results/test 2>/dev/null | wc -l | tr -d ' ');;\n\
         3) name=light-0.1/scene-0000;;\n\
         *) name=light-1/scene-0000;;\n\
         esac\ncp good/outputs/$name.npy \"$2\"\n",
    );
    let command = |line: &str| {
        let mut command = place.command(line);
        // A killed program leaves its private folder.
        command.args(["--allow-write", "state", "--command", "sh slow.sh {stream} {output}"]);
        command.env("TMPDIR", place.path(""));
        command
    };
    let mut child = command("benchmark run data -o slow").spawn().unwrap();
    wait_for(&place.path("slow/results/test/scene-0000.json"));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(command("benchmark run data -o slow --resume").status().unwrap().success());
    let [slow, good] = ["slow", "good"].map(|run| place.json(&format!("{run}/score.json")));
    assert_eq!(slow["summaries"], good["summaries"]);
    // Five sequences, and at most one that the signal interrupted.
    let runs = place.read("state/ran").len();
    assert!((5..=6).contains(&runs), "{runs}");
    place.run_refused("benchmark run data -o slow --resume --baseline tfp", 3, &["slow.sh", "same method"]);
}

#[test]
fn the_digest_does_not_depend_on_the_backend_or_the_threads() {
    let text = short_suite(1);
    let (_, digest) = generated(&text);
    let mut compared = 0;
    for backend in ["reference", "portable", "sse4.1", "avx2", "avx512"] {
        let place = TestFolder::new();
        place.write("tiny.toml", &text);
        let mut command = place.command("benchmark generate tiny.toml -o data --threads 1");
        let output = command.env("SPIKELANE_BACKEND", backend).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        if !output.status.success() && stderr.contains(backend) && backend.starts_with("avx") {
            // This machine lacks the instructions.
            continue;
        }
        assert!(output.status.success(), "{backend}: {stderr}");
        assert!(String::from_utf8_lossy(&output.stdout).contains(&digest), "{backend}");
        compared += 1;
    }
    assert!(compared >= 2);
}

#[test]
fn a_claim_is_verified_with_every_backend() {
    let (place, _) = generated(&short_suite(2));
    place.run_ok("benchmark run data --baseline span-blur -o claim");
    for backend in ["reference", "portable"] {
        let generate = format!("benchmark generate tiny.toml -o {backend} --threads 1");
        let verify = format!("benchmark verify claim/score.json --suite {backend} --run again-{backend}");
        for (line, result) in [(generate, "digest"), (verify, "the method gives the same scores")] {
            let output = place.command(&line).env("SPIKELANE_BACKEND", backend).output().unwrap();
            assert!(output.status.success(), "{backend}: {}", String::from_utf8_lossy(&output.stderr));
            assert!(String::from_utf8_lossy(&output.stdout).contains(result), "{backend}: {line}");
        }
    }
}

#[test]
fn other_data_than_the_published_data_is_named() {
    let text = short_suite(1).replace("name = \"tiny\"", "name = \"quick\"");
    let place = TestFolder::new();
    place.write("tiny.toml", text);
    for line in [
        "benchmark generate tiny.toml -o data",
        "benchmark run data --baseline tfp -o tfp",
        "benchmark verify tfp/score.json --suite data",
    ] {
        let stderr = place.run_ok(line).stderr;
        assert!(stderr.contains("not the data of the suite quick 0.1.0 as published"), "{line}: {stderr}");
    }
}

#[test]
fn a_report_replaces_the_tables_between_the_markers_of_a_page() {
    let (place, _) = generated(&short_suite(2));
    for baseline in ["tfp", "span"] {
        place.run_ok(&format!("benchmark run data --baseline {baseline} -o {baseline}"));
    }
    let report =
        "benchmark report tfp/score.json span/score.json --label counted --label spans -o report --force";
    place.write(
        "page.md",
        "before\n<!-- benchmark tiny: begin -->\nold\n<!-- benchmark tiny: end -->\nafter\n",
    );
    place.run_ok(&format!("{report} --markdown page.md"));
    let page = String::from_utf8(place.read("page.md")).unwrap();
    let psnr =
        place.json("span/score.json")["summaries"][0]["metrics"]["psnr"]["pooled"]["value"].as_f64().unwrap();
    for part in ["before\n", "\nafter\n", "| counted | spans |", "curve `light`", &format!("| {psnr:.2} (")] {
        assert!(page.contains(part), "{part}: {page}");
    }
    assert!(!page.contains("old"), "{page}");
    place.write("plain.md", "no markers\n");
    place.run_refused(&format!("{report} --markdown plain.md"), 4, &["no marker lines"]);
    place.run_refused(
        "benchmark report tfp/score.json -o other --label a --label b",
        2,
        &["--label", "2 names"],
    );
}

#[test]
fn text_of_a_score_file_becomes_no_markup_of_a_page() {
    let (place, _) = generated(&short_suite(1));
    place.run_ok("benchmark run data --baseline tfp -o run");
    let hostile = "a\n<!-- benchmark tiny: end -->\n# b `c` | <script>d</script>";
    let mut score = place.json("run/score.json");
    score["digest"] = hostile.into();
    place.write("run/digest.json", score.to_string());
    place.run_refused("benchmark report run/digest.json -o digest", 3, &["the digest"]);
    score["digest"] = place.json("run/score.json")["digest"].clone();
    score["version"] = hostile.into();
    for key in ["spikelane", "system", "processor"] {
        score["environment"][key] = hostile.into();
    }
    for summary in score["summaries"].as_array_mut().unwrap() {
        if summary["point"].is_object() {
            summary["point"]["curve"] = "`<script>".into();
            summary["point"]["value"] = hostile.into();
        }
    }
    place.write("run/score.json", score.to_string());
    let page = "<!-- benchmark tiny: begin -->\nold\n<!-- benchmark tiny: end -->\nafter\n";
    place.write("page.md", page);
    let report = "benchmark report run/score.json -o report --force --markdown page.md";
    place.run_ok(report);
    let written = String::from_utf8(place.read("page.md")).unwrap();
    // Only the two markers of the page are comments.
    assert_eq!(written.matches('<').count(), 2, "{written}");
    assert!(!written.contains("\n#") && !written.contains(" `c`"), "{written}");
    // No text ends a cell, so all rows of a table have the same number of cells.
    let cells = |line: &str| line.replace("\\|", "").matches('|').count();
    for table in written.split("\n\n") {
        let rows: Vec<usize> = table.lines().filter(|l| l.starts_with('|')).map(cells).collect();
        assert!(rows.iter().all(|count| *count == rows[0]), "{table}");
    }
    // The page can be written again.
    place.run_ok(report);
    assert!(place.read("page.md").ends_with(b"<!-- benchmark tiny: end -->\nafter\n"));
    score["environment"]["date"] = "2026\n# b".into();
    place.write("run/score.json", score.to_string());
    place.run_refused(report, 3, &["2026\\n# b", "a date such as"]);
}

#[test]
fn a_published_digest_is_compared() {
    let text = short_suite(1);
    let (place, digest) = generated(&text);
    place.write("right.toml", text.replace("release =", &format!("digest = \"{digest}\"\nrelease =")));
    place.run_ok("benchmark generate right.toml -o right");
    let wrong = format!("blake3:{}", "0".repeat(64));
    place.write("wrong.toml", text.replace("release =", &format!("digest = \"{wrong}\"\nrelease =")));
    let ran = place.run("benchmark generate wrong.toml -o wrong");
    assert_eq!(ran.code, 9, "{}", ran.stderr);
    assert!(ran.stderr.contains(&digest) && ran.stderr.contains(&wrong), "{}", ran.stderr);
}

#[test]
fn altered_and_truncated_streams_are_named_by_verify_and_run() {
    let (place, _) = generated(&short_suite(2));
    place.run_ok("benchmark verify data");
    let name = "data/groups/test/sequences/scene-0001/stream.dat";
    let stream = place.read(name);
    let mut altered = stream.clone();
    altered[100] ^= 1;
    for bytes in [&altered[..], &stream[..stream.len() - 1]] {
        std::fs::write(place.path(name), bytes).unwrap();
        for line in ["benchmark verify data", "benchmark run data --baseline tfp -o run --resume"] {
            let ran = place.run(line);
            assert_eq!(ran.code, 9, "{line}: {}", ran.stderr);
            assert!(ran.stderr.contains("scene-0001/stream.dat"), "{line}: {}", ran.stderr);
        }
    }
    place.run_ok("benchmark generate tiny.toml -o data --resume");
    place.run_ok("benchmark verify data");
}

#[test]
fn verify_computes_every_score_again() {
    let (place, _) = generated(&short_suite(2));
    place.run_ok("benchmark run data --baseline tfi-blur -o run");
    place.run_ok("benchmark verify run/score.json --suite data");
    let ran = place.run_ok("benchmark verify run/score.json --suite data --run again");
    assert!(ran.stderr.contains("recorded baseline: tfi-blur"), "{}", ran.stderr);
    let file = place.json("run/score.json");
    // A change of the last digit is found.
    let score = file["sequences"][1]["scores"]["psnr"].as_f64().unwrap();
    let mut changed = file.clone();
    changed["sequences"][1]["scores"]["psnr"] = f64::from_bits(score.to_bits() + 1).into();
    place.write("run/changed.json", changed.to_string());
    place.run_refused("benchmark verify run/changed.json --suite data", 9, &["scene-0001", "psnr"]);
    // A score file cannot read outside its folder.
    let mut hostile = file.clone();
    hostile["sequences"][0]["id"] = "../../secret".into();
    place.write("run/hostile.json", hostile.to_string());
    place.run_refused("benchmark verify run/hostile.json --suite data", 3, &["secret"]);
    place.write("run/outputs/test/scene-0000.npy", b"");
    place.run_refused("benchmark verify run/score.json --suite data", 9, &["scene-0000"]);
}

#[test]
fn verify_computes_the_cost_again_and_names_what_it_cannot_verify() {
    let (place, _) = generated(&short_suite(2));
    place.run_ok("benchmark run data --baseline tfp -o run");
    let ran = place.run_ok("benchmark verify run/score.json --suite data");
    let listed = ["not verified: measured seconds", "computer", "date", "names", "verified: scores"];
    assert!(listed.iter().all(|word| ran.stdout.contains(word)), "{}", ran.stdout);
    let file = place.json("run/score.json");
    let verify = "benchmark verify run/changed.json --suite data";
    for (pointer, value, code, word) in [
        ("/cost/outputs_per_second", 1e9, 9, "cost"),
        ("/time_limit_s", 0.001, 9, "time_limit_s"),
        ("/sequences/0/result/seconds", 1e-9, 9, "scene-0000 result seconds"),
        ("/cost/outputs_per_second", -1.0, 3, "impossible cost"),
        ("/cost/latency_seconds/0", 1e9, 3, "impossible cost"),
        ("/sequences/0/result/seconds", 0.0, 3, "a time of 0 s"),
    ] {
        let mut changed = file.clone();
        *changed.pointer_mut(pointer).unwrap() = value.into();
        place.write("run/changed.json", changed.to_string());
        place.run_refused(verify, code, &[word]);
    }
    place.run_refused("benchmark report run/changed.json -o report", 3, &["a time of 0 s"]);
    for seconds in ["-1", "0", "1e400"] {
        place.write("run/results/test/scene-0000.json", format!("{{\"seconds\": {seconds}}}"));
        place.run_refused("benchmark verify run/score.json --suite data", 3, &["scene-0000.json"]);
    }
}

#[test]
fn outputs_of_another_program_are_scored() {
    let (place, _) = generated(&short_suite(2));
    place.run_ok("benchmark run data --baseline tfp -o run");
    std::fs::create_dir(place.path("mine")).unwrap();
    std::fs::rename(place.path("run/outputs"), place.path("mine/outputs")).unwrap();
    place.run_ok("benchmark score data mine --name ours");
    let file = place.json("mine/score.json");
    assert_eq!((&file["method"]["outputs"], &file["cost"]), (&"ours".into(), &Value::Null));
    assert_eq!(file["summaries"], place.json("run/score.json")["summaries"]);
    place.run_ok("benchmark verify mine/score.json --suite data");
    place.run_refused("benchmark score data mine", 7, &["score.json"]);
}

#[test]
fn a_report_compares_methods_of_one_suite_and_refuses_another() {
    let (place, _) = generated(&short_suite(3));
    for baseline in ["tfp", "span-blur"] {
        place.run_ok(&format!("benchmark run data --baseline {baseline} -o {baseline}"));
    }
    place.run_ok("benchmark report tfp/score.json span-blur/score.json -o report --suite data");
    let html = String::from_utf8(place.read("report.html")).unwrap();
    for part in ["Differences to", "along light", "<svg", "Worst outputs", "data:image/png"] {
        assert!(html.contains(part), "{part}");
    }
    let report = place.json("report.json");
    assert_eq!(report["methods"].as_array().unwrap().len(), 2);
    // The mean of the differences is the difference of the means, up to the rounding of sums of numbers below 100.
    let mean = |i: usize| {
        report["methods"][i]["summaries"][0]["metrics"]["psnr"]["sequence_mean"]["value"].as_f64().unwrap()
    };
    let difference = report["differences"][0]["mean"]["value"].as_f64().unwrap();
    assert!((difference - (mean(1) - mean(0))).abs() < 1e-12, "{report}");
    let mut other = place.json("tfp/score.json");
    let wrong = format!("blake3:{}", "0".repeat(64));
    other["digest"] = wrong.as_str().into();
    place.write("other.json", other.to_string());
    place.run_refused(
        "benchmark report tfp/score.json other.json -o mixed",
        3,
        &[&wrong, "same generated suite"],
    );
}

#[test]
fn a_sealed_suite_opens_only_with_its_secret() {
    let place = TestFolder::new();
    place.write("tiny.toml", short_suite(1));
    place.write("seeds.txt", "11\n12\n");
    place.write("camera.toml", "preset = \"ideal\"\nsensor = { width = 48, height = 32 }\n");
    place.run_ok("benchmark seal tiny.toml --seeds-from seeds.txt --camera camera.toml -o round");
    place.run_ok("benchmark seal tiny.toml --count 2 -o other");
    let public = String::from_utf8(place.read("round.sealed.json")).unwrap();
    assert!(!public.contains("11") || !place.json("round.sealed.json")["seeds"].is_array());
    let reveal =
        |secret: &str| format!("benchmark reveal round.sealed.json {secret} --suite tiny.toml -o data");
    place.run_refused(&reveal("other.secret.json"), 9, &["other.secret.json", "commitment"]);
    place.run_ok(&reveal("round.secret.json"));
    place.run_ok("benchmark run data --baseline tfp -o run");
    let file = place.json("run/score.json");
    assert_eq!(file["sealed"], place.json("round.sealed.json")["commitment"]);
    // Two seeds with one scene each, and two values of the curve.
    assert_eq!(
        (file["sequences"].as_array().unwrap().len(), &file["summaries"][0]["sequences"]),
        (4, &2.into())
    );
    // A changed seed does not match the commitment.
    let secret = String::from_utf8(place.read("round.secret.json")).unwrap();
    place.write("round.secret.json", secret.replace("12", "13"));
    place.run_refused(
        "benchmark reveal round.sealed.json round.secret.json --suite tiny.toml -o again",
        9,
        &["commitment"],
    );
}

#[cfg(unix)]
#[test]
fn only_the_owner_may_read_the_secret_of_a_sealed_suite() {
    use std::os::unix::fs::PermissionsExt as _;
    let place = TestFolder::new();
    place.write("tiny.toml", short_suite(1));
    for umask in ["000", "022", "077"] {
        let mut shell = std::process::Command::new("sh");
        let line = format!("umask {umask}; exec \"$0\" benchmark seal tiny.toml -o {umask}");
        shell.args(["-c", &line, env!("CARGO_BIN_EXE_spikelane")]).current_dir(place.path("."));
        assert!(shell.output().unwrap().status.success());
        let secret = place.path(&format!("{umask}.secret.json"));
        assert_eq!(secret.metadata().unwrap().permissions().mode() & 0o7777, 0o600, "umask {umask}");
    }
}

/// Returns a suite of a task with labels.
fn label_suite(task: &str, metrics: &str) -> String {
    let text = short_suite(3)
        .replace("task = \"reconstruction\"", &format!("task = \"{task}\""))
        .replace(
            "images_per_scene = 9, label_every = 0, samples = 4, vehicles = 0",
            "images_per_scene = 9, label_every = 4, samples = 4, vehicles = 40",
        )
        .replace(
            "metrics = [\"psnr/1\", \"ssim/1\", \"detail_slope/1\", \"high_pass_noise/1\"]",
            &format!("metrics = [{metrics}]"),
        );
    text.replace("width = 48, height = 32", "width = 96, height = 64")
}

/// Generates a suite, writes one output for each scored sequence, and returns the scores of these outputs and of the
/// baseline.
fn score_outputs(
    suite: &str,
    output: &dyn Fn(&Path) -> Vec<u8>,
    extension: &str,
    baseline: &str,
) -> [Value; 2] {
    let (place, _) = generated(suite);
    for group in ["test", "light-0.1", "light-1"] {
        std::fs::create_dir_all(place.path(&format!("mine/outputs/{group}"))).unwrap();
        let sequences = place.path(&format!("data/groups/{group}/sequences"));
        for entry in std::fs::read_dir(&sequences).unwrap() {
            let folder = entry.unwrap().path();
            let id = folder.file_name().unwrap().to_string_lossy().into_owned();
            place.write(&format!("mine/outputs/{group}/{id}.{extension}"), output(&folder));
        }
    }
    place.run_ok("benchmark score data mine");
    place.run_ok("benchmark verify mine/score.json --suite data");
    place.run_ok(&format!("benchmark run data --baseline {baseline} -o baseline"));
    place.run_ok("benchmark report mine/score.json baseline/score.json -o report --suite data");
    ["mine", "baseline"].map(|run| place.json(&format!("{run}/score.json")))
}

/// Returns the pooled score of all scored splits.
fn pooled(file: &Value, metric: &str) -> f64 {
    assert_eq!(file["summaries"][0]["faults"], 0, "{file}");
    file["summaries"][0]["metrics"][metric]["pooled"]["value"].as_f64().unwrap()
}

#[test]
fn the_true_flow_has_no_error() {
    let flow = |folder: &Path| {
        let bytes = std::fs::read(folder.join("labels/000004.forward.flo")).unwrap();
        let values: Vec<f32> =
            bytes[12..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        npy_f32([64, 96, 2], &values)
    };
    let [mine, trivial] =
        score_outputs(&label_suite("flow", "\"flow_epe/1\", \"flow_outliers/1\""), &flow, "npy", "trivial");
    assert_eq!(pooled(&mine, "flow_epe"), 0.0);
    assert!(pooled(&trivial, "flow_epe") > 0.0);
}

/// Returns a suite of a color camera.
fn color_suite() -> String {
    short_suite(2)
        .replace("task = \"reconstruction\"", "task = \"color\"")
        .replace(
            "metrics = [\"psnr/1\", \"ssim/1\", \"detail_slope/1\", \"high_pass_noise/1\"]",
            "metrics = [\"cpsnr/1\", \"psnr_red/1\", \"ssim_color/1\", \"ciede2000/1\"]",
        )
        .replace("height = 32, ", "height = 32, mosaic = { pattern = \"GBRG\" }, ")
}

#[test]
fn the_true_color_image_has_no_error() {
    // The outputs are the references without the values above white, which the metrics clip.
    let image = |folder: &Path| std::fs::read(folder.join("images/000004.npy")).unwrap();
    let [mine, baseline] = score_outputs(&color_suite(), &image, "npy", "span-menon");
    assert_eq!((pooled(&mine, "cpsnr"), pooled(&mine, "ciede2000")), (144.5, 0.0));
    assert!((pooled(&mine, "ssim_color") - 1.0).abs() < 1e-9);
    assert!(pooled(&baseline, "cpsnr") < 60.0 && pooled(&baseline, "ciede2000") > 0.1);
}

#[test]
fn a_method_for_a_color_camera_receives_its_mosaic() {
    let (place, _) = generated(&color_suite());
    std::fs::create_dir(place.path("state")).unwrap();
    place.write("mosaic.sh", "echo $1 >> state/mosaics; exit 1\n");
    let ran = place
        .command("benchmark run data -o run --allow-write state")
        .args(["--command", "sh mosaic.sh {mosaic} {stream} {output}"])
        .output()
        .unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let text = String::from_utf8(place.read("state/mosaics")).unwrap();
    assert_eq!(text.lines().collect::<Vec<_>>(), ["GBRG"; 4]);
    // A faulty output has the scores of the trivial answer.
    place.run_ok("benchmark run data --baseline tfp-bilinear -o trivial");
    let [run, trivial] = ["run", "trivial"].map(|run| place.json(&format!("{run}/score.json")));
    assert_eq!(
        sequence(&run, "test", "scene-0000")["scores"],
        sequence(&trivial, "test", "scene-0000")["scores"]
    );
}

#[test]
fn a_suite_of_color_images_needs_a_color_camera() {
    let place = TestFolder::new();
    place.write("gray.toml", color_suite().replace("mosaic = { pattern = \"GBRG\" }, ", ""));
    place.run_refused("benchmark generate gray.toml -o data", 3, &["no mosaic", "color camera"]);
    let mosaic = "height = 32, mosaic = { pattern = \"GBRG\" }, ";
    place.write("other.toml", short_suite(1).replace("height = 32, ", mosaic));
    place.run_refused(
        "benchmark generate other.toml -o data",
        3,
        &["mosaic GBRG", "gray camera", "task color"],
    );
}

#[test]
fn the_true_depth_has_no_error() {
    let depth = |folder: &Path| {
        let bytes = std::fs::read(folder.join("labels/000004.depth.npy")).unwrap();
        let values: Vec<f32> = bytes[bytes.len() - 4 * 96 * 64..]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
            .map(|depth| if depth.is_finite() { depth } else { 1.0 })
            .collect();
        npy_f32([1, 64, 96], &values)
    };
    let [mine, trivial] = score_outputs(
        &label_suite("depth", "\"depth_abs_rel/1\", \"depth_delta_1/1\""),
        &depth,
        "npy",
        "trivial",
    );
    assert_eq!((pooled(&mine, "depth_abs_rel"), pooled(&mine, "depth_delta_1")), (0.0, 1.0));
    assert!(pooled(&trivial, "depth_abs_rel") > 0.0);
}

/// Returns the visible boxes of a labeled readout as objects with the keys of an output.
fn true_boxes(frame: &Value) -> Vec<Value> {
    let boxes = frame["boxes"].as_array().unwrap();
    let visible = boxes.iter().filter(|b| b["visible_pixels"].as_u64().unwrap() >= 16);
    visible
        .map(|b| {
            let edge = |i: usize| b["visible_box"][i].as_f64().unwrap();
            let bounds = [edge(0), edge(1), edge(2) - edge(0), edge(3) - edge(1)];
            serde_json::json!({ "class": b["class"], "score": 0.5, "track": b["track_id"], "box": bounds })
        })
        .collect()
}

fn labels(folder: &Path) -> Vec<Value> {
    let text = std::fs::read(folder.join("labels/labels.json")).unwrap();
    serde_json::from_slice::<Value>(&text).unwrap()["frames"].as_array().unwrap().clone()
}

fn without(mut object: Value, keys: &[&str]) -> Value {
    keys.iter().for_each(|key| drop(object.as_object_mut().unwrap().remove(*key)));
    object
}

#[test]
fn the_true_boxes_have_the_highest_precision() {
    let boxes = |folder: &Path| {
        let frame = labels(folder).into_iter().find(|frame| frame["readout"] == 4).unwrap();
        let found: Vec<_> = true_boxes(&frame).into_iter().map(|b| without(b, &["track"])).collect();
        serde_json::to_vec(&found).unwrap()
    };
    let [mine, trivial] =
        score_outputs(&label_suite("detection", "\"ap/1\", \"ar_100/1\""), &boxes, "json", "trivial");
    // COCO interpolates the precision at 101 recall points with one rounding each.
    assert!((pooled(&mine, "ap") - 1.0).abs() < 1e-9);
    assert_eq!(pooled(&trivial, "ap"), 0.0);
}

#[test]
fn the_true_tracks_have_the_highest_accuracy() {
    let tracks = |folder: &Path| {
        let entry = |frame: &Value| {
            let boxes: Vec<_> =
                true_boxes(frame).into_iter().map(|b| without(b, &["class", "score"])).collect();
            serde_json::json!({ "readout": frame["readout"], "boxes": boxes })
        };
        serde_json::to_vec(&labels(folder).iter().map(entry).collect::<Vec<_>>()).unwrap()
    };
    let [mine, trivial] =
        score_outputs(&label_suite("tracking", "\"hota/1\", \"loc_a/1\""), &tracks, "json", "trivial");
    assert!((pooled(&mine, "hota") - 1.0).abs() < 1e-9);
    assert_eq!(pooled(&trivial, "hota"), 0.0);
}

/// Runs the baseline TFP on a suite of three scenes, and returns its outputs as float images.
fn tfp_outputs() -> (TestFolder, Vec<(String, Vec<f32>)>) {
    let (place, _) = generated(&short_suite(3));
    place.run_ok("benchmark run data --baseline tfp -o tfp");
    let mut outputs = Vec::new();
    for group in ["test", "light-0.1", "light-1"] {
        for entry in std::fs::read_dir(place.path(&format!("tfp/outputs/{group}"))).unwrap() {
            let bytes = std::fs::read(entry.as_ref().unwrap().path()).unwrap();
            let values = bytes[bytes.len() - 4 * 48 * 32..].chunks_exact(4);
            let values = values.map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
            outputs.push((format!("{group}/{}", entry.unwrap().file_name().to_string_lossy()), values));
        }
    }
    (place, outputs)
}

/// Writes the outputs, with every value changed by `convert`, as the outputs of the run `mine`.
fn write_outputs(
    place: &TestFolder,
    folder: &str,
    outputs: &[(String, Vec<f32>)],
    convert: &dyn Fn(f32) -> f32,
) {
    for (name, values) in outputs {
        let path = place.path(&format!("{folder}/{name}"));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let values: Vec<f32> = values.iter().map(|v| convert(*v)).collect();
        let bytes = npy_f32([1, 32, 48], &values);
        std::fs::write(path, bytes).unwrap();
    }
}

#[test]
fn outputs_in_other_units_are_a_warning() {
    let (place, outputs) = tfp_outputs();
    let srgb = |v: f32| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    write_outputs(&place, "linear/outputs", &outputs, &|v| v);
    write_outputs(&place, "codes/outputs", &outputs, &|v| 255.0 * v);
    write_outputs(&place, "srgb/outputs", &outputs, &|v| srgb(v.clamp(0.0, 1.0)));
    for (run, word) in [
        ("linear", None),
        ("codes", Some("expected light with full scale at 1.0")),
        ("srgb", Some("as sRGB codes")),
    ] {
        let ran = place.run_ok(&format!("benchmark score data {run}"));
        assert_eq!(ran.stderr.contains("warning"), word.is_some(), "{run}: {}", ran.stderr);
        assert!(word.is_none_or(|word| ran.stderr.contains(word)), "{run}: {}", ran.stderr);
        // The notes are not a part of the scores.
        place.run_ok(&format!("benchmark verify {run}/score.json --suite data"));
    }
}

#[test]
fn outputs_of_unknown_sequences_are_named() {
    let (place, outputs) = tfp_outputs();
    write_outputs(&place, "mine/outputs", &outputs, &|v| v);
    std::fs::create_dir(place.path("mine/outputs/Test")).unwrap();
    place.write("mine/outputs/test/other.npy", b"");
    let ran = place.run_ok("benchmark score data mine");
    assert!(ran.stderr.contains("2 entries") && ran.stderr.contains("other.npy"), "{}", ran.stderr);
    assert!(ran.stderr.contains("outputs/Test"), "{}", ran.stderr);
}

#[test]
fn outputs_in_a_wrong_folder_are_an_error() {
    let (place, outputs) = tfp_outputs();
    write_outputs(&place, "mine", &outputs, &|v| v);
    place.run_refused("benchmark score data mine", 4, &["outputs/test/scene-0000.npy", "light-0.1"]);
}
