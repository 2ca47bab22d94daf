//! The tables of scored pictures.

use super::picture::Picture;
use super::scores::Scores;

const HEADER: &str = "image          PSNR, dB    SSIM patches, % weak texture, % differences, %  SNR, dB\n";
const DETAIL_HEADER: &str = "against the truth aligned, dB  detail   noise, %   outliers\n";
const COLOR_HEADER: &str =
    "image       demosaicing  CPSNR, dB    PSNR, dB: R       G       B    SSIM: R       G       B\n";

/// Returns the tables of the pictures. A star marks the best of several scores.
pub(super) fn tables(pictures: &[Picture]) -> String {
    if pictures.iter().any(|picture| picture.demosaicing.is_some()) {
        return COLOR_HEADER.to_owned() + &pictures.iter().filter_map(color_row).collect::<String>();
    }
    let star = |scores: &Scores, key| {
        let known = pictures.iter().filter_map(|p| p.score(key)).map(|score| score.value);
        let is_best = known.clone().count() > 1 && scores.get(key).map(|s| s.value) == known.reduce(f64::max);
        if is_best { '*' } else { ' ' }
    };
    let row = |picture: &Picture| match &picture.scores {
        Ok(s) => format!(
            "{:<14} {:>8}{}{:>7}{}{:>9} {:>15} {:>14} {:>8}\n",
            picture.label(),
            s.text("psnr_db", 2),
            star(s, "psnr_db"),
            s.text("ssim", 4),
            star(s, "ssim"),
            s.text("patch_noise", 3),
            s.text("weak_texture_noise", 3),
            s.text("difference_noise", 3),
            s.text("snr_db", 2),
        ),
        Err(reason) => {
            let place = if picture.counts.is_some() { " in any picture" } else { "" };
            format!("{:<14} not measurable{place}: {reason}\n", picture.name)
        }
    };
    let detail_row = |picture: &Picture| {
        let s = picture.scores.as_ref().ok().filter(|s| s.get("detail_slope").is_some())?;
        Some(format!(
            "{:<17}{:>12}{}{:>7} {:>10} {:>10}\n",
            picture.label(),
            s.text("aligned_psnr_db", 2),
            star(s, "aligned_psnr_db"),
            s.text("detail_slope", 3),
            s.text("high_pass_noise", 3),
            s.text("outliers", 0),
        ))
    };
    let detail: String = pictures.iter().filter_map(detail_row).collect();
    let detail_header = if detail.is_empty() { "" } else { DETAIL_HEADER };
    format!("{HEADER}{}{detail_header}{detail}", pictures.iter().map(row).collect::<String>())
}

fn color_row(picture: &Picture) -> Option<String> {
    let s = picture.scores.as_ref().ok()?;
    let [r, g, b] = ["psnr_db_red", "psnr_db_green", "psnr_db_blue"].map(|key| s.text(key, 2));
    let [x, y, z] = ["ssim_red", "ssim_green", "ssim_blue"].map(|key| s.text(key, 4));
    let (name, method, all) = (&picture.name, picture.demosaicing?.name(), s.text("cpsnr_db", 2));
    Some(format!("{name:<11} {method:<11} {all:>10} {r:>14} {g:>7} {b:>7} {x:>10} {y:>7} {z:>7}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_of_several_pictures_has_a_star() {
        let all = [0.5, 0.7].map(|ssim| {
            let mut scores = Scores::default();
            scores.insert("ssim", ssim);
            Picture::new("a", Ok(scores))
        });
        let rows: Vec<String> = tables(&all).lines().map(str::to_owned).collect();
        assert!(rows[2].contains("0.7000*") && !rows[1].contains('*'), "{rows:?}");
        assert!(!tables(&all[..1]).contains('*'));
    }
}
