//! Tests that the tables of `docs/reference/effects.md` match the definitions of the effects.

use std::fmt::Write as _;

use spikelane::effects;

const BEGIN: &str = "<!-- generated: begin -->\n";
const END: &str = "<!-- generated: end -->";

fn table() -> String {
    let mut text = String::from("| effect | what happens | source |\n|---|---|---|\n");
    for d in effects::ALL {
        writeln!(text, "| `{}` | {} | {} |", d.name, d.summary, d.source).unwrap();
    }
    text += "\n| effect | parameter | range | neutral | typical | meaning |\n|---|---|---|---|---|---|\n";
    for d in effects::ALL {
        for p in d.params {
            let range = p.range();
            let (neutral, typical) = (p.format(p.neutral), p.format(p.typical));
            writeln!(text, "| `{}` | `{}` | {range} | {neutral} | {typical} | {} |", d.name, p.key, p.help)
                .unwrap();
        }
    }
    text
}

fn page() -> (std::path::PathBuf, String) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/effects.md");
    let text = std::fs::read_to_string(&path).unwrap();
    (path, text)
}

#[test]
fn the_page_of_effects_is_current() {
    let (_, text) = page();
    let (_, rest) = text.split_once(BEGIN).expect("the mark of the generated part");
    let (committed, _) = rest.split_once(END).expect("the end of the generated part");
    assert!(committed == table(), "run: cargo test --test docs_effects -- --ignored");
}

#[test]
#[ignore = "writes docs/reference/effects.md"]
fn write_the_page_of_effects() {
    let (path, text) = page();
    let (head, rest) = text.split_once(BEGIN).unwrap();
    let (_, tail) = rest.split_once(END).unwrap();
    std::fs::write(path, format!("{head}{BEGIN}{}{END}{tail}", table())).unwrap();
}
