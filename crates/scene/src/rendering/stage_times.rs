//! Durations of the stages of a render, for benchmarks.

use super::band::Band;
use super::fragment::{FacetCache, Fragment};
use super::frame::SceneInstant;
use super::raster::{NO_TRIANGLE, SamplePattern, project, visible_chunks};
use super::render::{SurfaceGroup, collect, shade_band, sun_share};
use super::rendered_frame::SamplesPerPixel;
use super::texture;
use super::tiles::BAND_ROWS;
use super::visibility::{center_labels, compute_visibility};
use crate::world::Scene;

/// Names of the stages, and their durations in the unit of the clock.
pub(crate) type StageTimes = [(&'static str, f64); 8];

impl Scene {
    /// Measures the duration of each stage of a render with `timer`. `t` must be inside the drive.
    ///
    /// The first entry of the result is the duration of the whole render. The last entry is the duration of shading,
    /// without the computation of visible sun fractions and textures.
    pub fn stage_times(&self, t: f64, timer: &mut dyn FnMut(&mut dyn FnMut()) -> f64) -> StageTimes {
        let (frame, tiles) = (&SceneInstant::new(self, t), &self.tiles());
        let pattern = &SamplePattern::new(4);
        let shadows = self.light.sun_illuminance.max_element() > 0.0;
        let visibility = compute_visibility(frame, pattern, (tiles, None), (true, shadows), 1);
        let (width, height) = (visibility.labels.width, visibility.labels.height);
        let mut take = |run: &mut dyn FnMut()| timer(run);
        let total = take(&mut || drop(self.render_tiles(t, SamplesPerPixel::Four, tiles, 1)));
        let placed = take(&mut || drop(SceneInstant::new(self, t)));
        let raster = take(&mut || {
            let chunks = visible_chunks(frame, tiles);
            let batches: Vec<_> = chunks.into_iter().map(|(p, c)| project(frame, p, c, tiles)).collect();
            for b in 0..visibility.bands.len() {
                drop(Band::fill(&batches, pattern, tiles.band_runs(b), width, b * BAND_ROWS));
            }
        });
        let mut labels = |shadows: bool| {
            take(&mut || {
                for (b, band) in visibility.bands.iter().enumerate() {
                    drop(center_labels(frame, band, pattern, (b, tiles), shadows));
                }
            })
        };
        let (bare, lit) = (labels(false), labels(shadows));
        let groups = groups(frame, &visibility.bands, pattern, height);
        let shares = take(&mut || {
            let mut latest = FacetCache::default();
            for (group, at) in &groups {
                let facet = latest.get(frame, group.id);
                std::hint::black_box(sun_share(frame, &visibility, pattern, (group, facet), *at));
            }
        });
        let fragments: Vec<Fragment> = {
            let mut latest = FacetCache::default();
            let at = |g: &SurfaceGroup| {
                (g.position_sum.0 / g.triangle_samples, g.position_sum.1 / g.triangle_samples)
            };
            groups.iter().map(|(g, _)| latest.get(frame, g.id).fragment_at(frame, at(g).0, at(g).1)).collect()
        };
        let textures = take(&mut || {
            for f in &fragments {
                std::hint::black_box(texture::appearance(f.material, &f.spot, &self.city, &self.light));
            }
        });
        let shading = take(&mut || {
            for b in 0..visibility.bands.len() {
                drop(shade_band(frame, &visibility, pattern, (b, tiles)));
            }
        });
        [
            ("key frame with its labels", total),
            ("placing vehicles", placed),
            ("rasterizer", raster),
            ("labels of centers", bare),
            ("rays to the sun from centers", (lit - bare).max(0.0)),
            ("sun of a pixel's samples", shares),
            ("textures", textures),
            (
                "surface points, lamps with their rays, sky, reflections",
                (shading - shares - textures).max(0.0),
            ),
        ]
    }
}

/// Returns the surfaces of all pixels, each with its pixel coordinates.
fn groups(
    frame: &SceneInstant,
    bands: &[Band],
    pattern: &SamplePattern,
    height: usize,
) -> Vec<(SurfaceGroup, (usize, usize))> {
    let (mut all, mut some) = (Vec::new(), Vec::new());
    for y in 0..height {
        for x in 0..frame.camera.intrinsics.width as usize {
            some.clear();
            collect(frame, &bands[y / BAND_ROWS], pattern, (y % BAND_ROWS, x, y), &mut some);
            all.extend(some.iter().filter(|g| g.id != NO_TRIANGLE).map(|g| (*g, (x, y))));
        }
    }
    all
}
