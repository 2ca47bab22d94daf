//! Compares reconstructions from counts, from spans and from intervals. Scores how well their images match the light.
//!
//! `cargo run --release -p spikelane-studies --bin study-pictures -- [PAGE]` prints the tables, or writes them between
//! the markers of PAGE. Recordings of real cameras are read from the folder in the environment variable
//! `SPIKELANE_REAL_DATA`. If the variable is not set, the tables of real recordings do not change.

mod detail_scores;
mod real_scenes;
mod score;
mod simulated_scenes;

fn main() {
    let page = std::env::args().nth(1);
    let page = page.as_deref();
    put(page, "simulated", &score::table(&simulated_scenes::rows()));
    let folder = std::env::var_os("SPIKELANE_REAL_DATA");
    let Some(folder) = folder.as_deref().map(std::path::Path::new) else {
        eprintln!(
            "skipped: the real recordings and the table of detail, because SPIKELANE_REAL_DATA is not set"
        );
        return;
    };
    put(page, "real", &score::table(&real_scenes::rows(folder)));
    put(page, "detail", &detail_scores::table(folder));
}

fn put(page: Option<&str>, name: &str, table: &str) {
    let Some(page) = page else {
        println!("{table}");
        return;
    };
    let (start, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let text = std::fs::read_to_string(page).unwrap_or_else(|e| panic!("{page}: {e}"));
    let (before, rest) = text.split_once(&start).expect("the page has marks for its tables");
    let (_, after) = rest.split_once(&end).expect("the tables have an end");
    std::fs::write(page, format!("{before}{start}{table}{end}{after}")).unwrap();
}
