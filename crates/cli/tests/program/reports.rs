//! Tests that all HTML reports have the same structure.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use crate::program_support::TestFolder;

/// Returns a folder with a tiny recording set and with a stream whose name contains markup.
fn place_with_recordings() -> TestFolder {
    let place = TestFolder::new();
    place.run_ok("record --width 16 --height 12 --readouts 1100 -o set");
    place.picture("gray.png", 64, 48, 120);
    place.run_ok("simulate gray.png --width 64 --height 48 --readouts 200 -o flat");
    std::fs::copy(place.path("flat.dat"), place.path(HOSTILE)).unwrap();
    place
}

const HOSTILE: &str = "<img>onerror=alert(1).dat";

/// The commands that write a report, and the name of the page.
const REPORTS: [(&str, &str); 7] = [
    ("measure flat.dat --report measure.html", "measure.html"),
    ("calibrate set/recordings.toml -o calibrated", "calibrated/report.html"),
    ("compare set/recordings.toml ideal physical --max-readouts 100 -o gray", "gray/comparison.html"),
    ("compare flat.dat ideal physical -o still", "still/comparison.html"),
    (
        "diagnose set/recordings.toml --holdout second/recordings.toml --camera physical -o diagnosed",
        "diagnosed/report.html",
    ),
    ("evaluate drives --report scores.html", "scores.html"),
    ("dataset stats drives --report drives.html", "drives.html"),
];

/// Runs all reports once and returns the name and the text of each page.
fn pages() -> &'static [(&'static str, String)] {
    static PAGES: OnceLock<Vec<(&'static str, String)>> = OnceLock::new();
    PAGES.get_or_init(|| {
        let place = place_with_recordings();
        place.run_ok("record --width 16 --height 12 --readouts 1100 --seed 2 -o second");
        place.run_ok(
            "dataset -o drives --sequences 1 --images-per-scene 3 --width 32 --height 20 --label-every 1 --test-share 0",
        );
        let page = |(command, page): (&str, &'static str)| {
            place.run_ok(command);
            (page, String::from_utf8(place.read(page)).unwrap())
        };
        REPORTS.into_iter().map(page).collect()
    })
}

/// Returns the faults of all pages.
fn faulty_pages(faults: impl Fn(&str) -> Option<String>) -> Vec<String> {
    pages().iter().filter_map(|(page, html)| Some(format!("{page}: {}", faults(html)?))).collect()
}

/// Returns the text of a page between its tags.
fn text_of(html: &str) -> String {
    let body = html.split("<body>").nth(1).unwrap_or_default();
    let body = body.split("<script>").next().unwrap_or_default();
    body.split('<').map(|part| part.split_once('>').map_or(part, |p| p.1)).collect::<Vec<_>>().join("\n")
}

/// Returns a fault if an error has not two significant digits, or if a value has other decimals than its error.
fn rounding_fault(text: &str) -> Option<String> {
    let decimals = |number: &str| number.split_once('.').map_or(0, |(_, d)| d.len());
    let is_number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let all: Vec<&str> = text.split(" ± ").collect();
    all.windows(2).find_map(|pair| {
        let value: String =
            pair[0].chars().rev().take_while(|c| is_number(*c)).collect::<Vec<_>>().iter().rev().collect();
        let error: String = pair[1].chars().take_while(|c| is_number(*c)).collect();
        // The name of a column can contain the sign without numbers.
        if value.is_empty() && error.is_empty() {
            return None;
        }
        let digits = error.replace('.', "").trim_start_matches('0').to_owned();
        // An integer such as 2300 has two significant digits and zeros.
        let significant =
            if error.contains('.') { digits.len() } else { digits.trim_end_matches('0').len().max(2) };
        let is_rounded = error == "0"
            || (significant == 2 && decimals(&value) == decimals(&error))
            || (digits.len() == 2 && !error.contains('.'));
        (!is_rounded || value.is_empty()).then(|| format!("{value} ± {error}"))
    })
}

#[test]
fn every_report_begins_with_its_verdict_and_ends_with_its_origin() {
    let faults = |html: &str| {
        let parts = [
            "<h1>",
            "class=\"verdict ",
            "class=\"keys\"",
            "<table",
            "<h2>Origin",
            "Command: <code>spikelane ",
            "<footer>",
        ];
        let places: Vec<Option<usize>> = parts.iter().map(|part| html.find(part)).collect();
        let is_ordered = places.iter().all(Option::is_some) && places.is_sorted();
        (!is_ordered).then(|| format!("{parts:?} at {places:?}"))
    };
    assert_eq!(faulty_pages(faults), Vec::<String>::new());
}

#[test]
fn every_report_rounds_values_to_two_digits_of_their_errors() {
    assert_eq!(rounding_fault("a 0.0996 ± 0.0004 b"), Some("0.0996 ± 0.0004".to_owned()));
    assert_eq!(rounding_fault("a 0.09960 ± 0.00040 b 123500 ± 2300, 7 ± 12"), None);
    assert_eq!(faulty_pages(|html| rounding_fault(&text_of(html))), Vec::<String>::new());
}

#[test]
fn every_table_of_a_report_can_be_copied_as_csv() {
    let faults = |html: &str| {
        let [tables, buttons] = ["<table", "class=\"csv\""].map(|part| html.matches(part).count());
        (tables == 0 || tables != buttons).then(|| format!("{tables} tables, {buttons} buttons"))
    };
    assert_eq!(faulty_pages(faults), Vec::<String>::new());
}

#[test]
fn no_report_loads_another_file() {
    let faults = |html: &str| {
        let sources = ["http", "src=\"", "href=\"", "url(", "@import"];
        let local = html.replace("src=\"data:", "").replace("href=\"data:", "");
        sources.iter().find(|s| local.contains(**s)).map(|s| (*s).to_owned())
    };
    assert_eq!(faulty_pages(faults), Vec::<String>::new());
}

#[test]
fn the_name_of_a_recording_is_text_in_its_report() {
    let place = place_with_recordings();
    place.run_ok(&format!("measure {HOSTILE} --width 64 --height 48 --report m.html"));
    let html = String::from_utf8(place.read("m.html")).unwrap();
    assert!(html.contains("&lt;img&gt;onerror") && !html.contains("<img>"));
}

#[test]
fn a_report_has_its_numbers_as_json_beside_it() {
    let place = place_with_recordings();
    place.run_ok("measure flat.dat --report m.html");
    let printed = place.run_ok("measure flat.dat --json").events().last().unwrap().clone();
    assert_eq!(place.json("m.json")["statistics"], printed["statistics"]);
    place.run_refused("measure flat.dat --report m.json", 2, &["--report"]);
}

#[test]
fn a_preview_with_another_ending_than_png_is_refused() {
    let place = place_with_recordings();
    place.run_refused("inspect flat.dat --png preview.jpg", 2, &["preview.jpg", ".png"]);
    assert!(!place.path("preview.jpg").exists());
}

/// Returns the words in code style of the first table after `heading`, which are keys.
fn documented_keys(page: &str, heading: &str) -> BTreeSet<String> {
    let section = page.split(&format!("\n{heading}:\n\n")).nth(1).expect(heading);
    let table = section.split("\n\n").next().unwrap_or_default();
    table.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn add_keys(value: &serde_json::Value, keys: &mut BTreeSet<String>) {
    if let Some(object) = value.as_object() {
        keys.extend(object.keys().cloned());
        object.values().for_each(|v| add_keys(v, keys));
    }
    value.as_array().into_iter().flatten().for_each(|v| add_keys(v, keys));
}

#[test]
fn the_reference_lists_the_keys_of_every_comparison() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/reports.md");
    let page = std::fs::read_to_string(path).unwrap();
    let place = place_with_recordings();
    place.run_ok("simulate --builtin-light chart --width 256 --height 160 --readouts 600 -o chart");
    // The files of cameras without color filters and without a description lack the optional keys.
    let cases = [
        ("`compare` with a recording set", "set/recordings.toml", "", &["channels", "recorded_camera"][..]),
        ("`compare` with one recording", "flat.dat", "", &[]),
        ("`compare --realism`", "chart.dat", "--realism --window 16,40 --recordings-per-camera 2", &[]),
    ];
    for (i, (heading, input, flags, optional)) in cases.into_iter().enumerate() {
        place.run_ok(&format!("compare {input} ideal physical {flags} -o compared{i}"));
        let mut keys = BTreeSet::new();
        add_keys(&place.json(&format!("compared{i}/comparison.json")), &mut keys);
        let documented = documented_keys(&page, heading);
        let missing: Vec<_> = keys.difference(&documented).collect();
        let absent: Vec<_> =
            documented.difference(&keys).filter(|key| !optional.contains(&key.as_str())).collect();
        assert!(missing.is_empty() && absent.is_empty(), "{heading}: {missing:?} {absent:?}");
    }
}
