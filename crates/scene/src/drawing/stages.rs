//! What each stage of a render takes, for those who measure.

use super::band::Band;
use super::fragment::{Fragment, Latest};
use super::frame::Frame;
use super::picture::SamplesPerPixel;
use super::raster::{NOTHING, Pattern, project, visible_chunks};
use super::render::{Group, collect, shade_band, sun_share};
use super::see::{centres, rows_of, see};
use super::texture;
use super::tiles::BAND_ROWS;
use crate::world::Scene;

/// Stages and how long each took, in the unit of the clock.
pub(crate) type Stages = [(&'static str, f64); 8];

impl Scene {
    /// Runs each stage of a render at `t`, which lies within the drive, under a clock; the first entry is
    /// the whole, the last what no other one holds.
    pub fn stages(&self, t: f64, clock: &mut dyn FnMut(&mut dyn FnMut()) -> f64) -> Stages {
        let (frame, tiles) = (&Frame::new(self, t), &self.tiles());
        let pattern = &Pattern::new(4);
        let shadows = self.light.sun.max_element() > 0.0;
        let seen = see(frame, pattern, tiles, shadows, 1);
        let (width, height) = (seen.labels.width, seen.labels.height);
        let runs = [(0, width)];
        let mut take = |run: &mut dyn FnMut()| clock(run);
        let whole = take(&mut || drop(self.rendered(t, SamplesPerPixel::Four, tiles, 1)));
        let placed = take(&mut || drop(Frame::new(self, t)));
        let raster = take(&mut || {
            let chunks = visible_chunks(frame, tiles);
            let batches: Vec<_> = chunks.into_iter().map(|(p, c)| project(frame, p, c, tiles)).collect();
            for b in 0..seen.bands.len() {
                let rows = rows_of(b, height);
                drop(Band::fill(&batches, pattern, &runs, width, b * BAND_ROWS, rows));
            }
        });
        let mut labels = |shadows: bool| {
            take(&mut || {
                for (b, band) in seen.bands.iter().enumerate() {
                    drop(centres(frame, band, pattern, (b, tiles), shadows));
                }
            })
        };
        let (bare, lit) = (labels(false), labels(shadows));
        let groups = groups(frame, &seen.bands, pattern, height);
        let shares = take(&mut || {
            let mut latest = Latest::default();
            for (group, at) in &groups {
                let facet = latest.get(frame, group.id);
                std::hint::black_box(sun_share(frame, &seen, pattern, (group, facet), *at));
            }
        });
        let fragments: Vec<Fragment> = {
            let mut latest = Latest::default();
            let at = |g: &Group| (g.at.0 / g.own, g.at.1 / g.own);
            groups.iter().map(|(g, _)| latest.get(frame, g.id).at(frame, at(g).0, at(g).1)).collect()
        };
        let textures = take(&mut || {
            for f in &fragments {
                std::hint::black_box(texture::look(f.material, &f.spot, &self.city, &self.light));
            }
        });
        let shading = take(&mut || {
            for b in 0..seen.bands.len() {
                drop(shade_band(frame, &seen, pattern, (b, tiles)));
            }
        });
        [
            ("key frame with its labels", whole),
            ("placing vehicles", placed),
            ("rasteriser", raster),
            ("labels of centres", bare),
            ("rays to the sun from centres", (lit - bare).max(0.0)),
            ("sun of a pixel's samples", shares),
            ("textures", textures),
            (
                "surface points, lamps with their rays, sky, reflections",
                (shading - shares - textures).max(0.0),
            ),
        ]
    }
}

/// All surfaces of all pixels, with the pixels.
fn groups(frame: &Frame, bands: &[Band], pattern: &Pattern, height: usize) -> Vec<(Group, (usize, usize))> {
    let (mut all, mut some) = (Vec::new(), Vec::new());
    for y in 0..height {
        for x in 0..frame.camera.intrinsics.width as usize {
            some.clear();
            collect(frame, &bands[y / BAND_ROWS], pattern, (y % BAND_ROWS, x, y), &mut some);
            all.extend(some.iter().filter(|g| g.id != NOTHING).map(|g| (*g, (x, y))));
        }
    }
    all
}
