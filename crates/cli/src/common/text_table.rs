//! Tables for the terminal.

/// Longest cell of the first column, in characters. Longer names are cut.
const MAX_NAME_CHARS: usize = 20;

/// Mark behind the best value of a column.
const BEST: char = '*';

/// Returns `text`, with the mark [`BEST`] if `is_best`.
pub(crate) fn marked(mut text: String, is_best: bool) -> String {
    if is_best {
        text.push(BEST);
    }
    text
}

/// Returns the smallest of `values`, or infinity if there is none.
pub(crate) fn smallest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}

/// Returns a table whose first column is aligned left and whose other columns are aligned right. A cell that ends in
/// [`BEST`] has its mark beside the column, so that the digits stay aligned.
pub(crate) fn text_table(header: &[&str], rows: &[Vec<String>]) -> String {
    let name = |text: &str| match text.chars().count() > MAX_NAME_CHARS {
        true => text.chars().take(MAX_NAME_CHARS - 3).collect::<String>() + "...",
        false => text.to_owned(),
    };
    let columns = header.len();
    let width = |i: usize| {
        let cells =
            rows.iter().filter_map(|row| row.get(i)).map(|c| c.trim_end_matches(BEST).chars().count());
        let widest = cells.max().unwrap_or(0).max(header[i].chars().count());
        if i == 0 { widest.min(MAX_NAME_CHARS) } else { widest }
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let mut text = String::new();
        for (i, cell) in cells.enumerate() {
            let (number, mark) = match cell.strip_suffix(BEST) {
                Some(number) => (number, BEST),
                None => (cell, ' '),
            };
            text += &match i {
                0 => format!("{:<1$}", name(cell), widths[0]),
                _ => format!(" {number:>0$}{mark}", widths.get(i).copied().unwrap_or(0)),
            };
        }
        text.trim_end().to_owned() + "\n"
    };
    let mut text = line(&mut header.iter().copied());
    rows.iter().for_each(|row| text += &line(&mut row.iter().map(String::as_str)));
    text
}

/// Returns one character per value, whose height grows with the value. The highest character represents `max`.
pub(crate) fn sparkline(values: &[f64], max: f64) -> String {
    const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let level = |v: &f64| match v.is_finite() && max > 0.0 {
        true => LEVELS[((v / max).clamp(0.0, 1.0) * 7.0).round() as usize],
        false => ' ',
    };
    values.iter().map(level).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mark_of_the_best_value_moves_no_digit() {
        let rows = [["a", "1.25*"], ["bb", "10.5"]].map(|row| row.map(str::to_owned).to_vec());
        assert_eq!(text_table(&["n", "value"], &rows), "n  value\na   1.25*\nbb  10.5\n");
    }

    #[test]
    fn a_long_name_is_cut() {
        let rows = [vec!["x".repeat(40), "1".to_owned()]];
        assert!(text_table(&["n", "v"], &rows).lines().all(|l| l.len() < 30));
    }

    #[test]
    fn the_highest_value_has_the_highest_character() {
        assert_eq!(sparkline(&[0.0, 1.0, 2.0, f64::NAN], 2.0), "▁▅█ ");
    }
}
