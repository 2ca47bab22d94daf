//! The moving chart with all that stays drawn once: a frame needs only the pixels of what moves.

use super::chart_scene::{GROUND, Scene, Spokes, mix};
use crate::spikes::Geometry;

/// A pixel that sees nothing that moves but the star.
#[derive(Clone, Debug)]
struct OfStar {
    at: usize,
    under: f32,
    spokes: Spokes,
}

/// A pixel that sees nothing that moves but one row of bars.
#[derive(Clone, Debug)]
struct OfBars {
    at: usize,
    col: usize,
    under: f32,
    inside: f32,
}

/// What does not change from frame to frame.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    width: usize,
    still: Vec<u16>,
    star: Vec<OfStar>,
    bars: [Vec<OfBars>; 2],
    /// Pixels that see several moving patterns, as on the smallest charts.
    several: Vec<usize>,
}

impl Drawn {
    pub(super) fn new(geometry: Geometry, levels: &[f32]) -> Self {
        let (width, height) = (geometry.width(), geometry.height());
        let scene = Scene::new(geometry, 0.0);
        let mut drawn = Self {
            width,
            still: Vec::with_capacity(width * height),
            star: Vec::new(),
            bars: [Vec::new(), Vec::new()],
            several: Vec::new(),
        };
        for at in 0..width * scene.wedge_top {
            drawn.sort(at, &scene);
        }
        for _ in scene.wedge_top..height {
            drawn.still.extend((0..width).map(|col| code(levels[col * levels.len() / width])));
        }
        drawn
    }

    /// Which patterns a pixel sees.
    fn sort(&mut self, at: usize, scene: &Scene) {
        let ([x, y], col) = (self.centre(at), at % self.width);
        let spokes = scene.star.spokes(x, y);
        let inside = [0, 1].map(|i| scene.bars[i].inside(x, y));
        let under = scene.square.over(GROUND, x, y);
        self.still.push(code(under));
        match (spokes, inside) {
            (None, [0.0, 0.0]) => {}
            (Some(spokes), [0.0, 0.0]) if under == GROUND => self.star.push(OfStar { at, under, spokes }),
            (None, [inside, 0.0]) => self.bars[0].push(OfBars { at, col, under, inside }),
            (None, [0.0, inside]) => self.bars[1].push(OfBars { at, col, under, inside }),
            _ => self.several.push(at),
        }
    }

    fn centre(&self, at: usize) -> [f32; 2] {
        [(at % self.width) as f32 + 0.5, (at / self.width) as f32 + 0.5]
    }

    /// 16-bit samples of the chart as `scene` stands.
    pub(super) fn at(&self, scene: &Scene) -> Vec<u16> {
        let mut samples = self.still.clone();
        for p in &self.star {
            samples[p.at] = code(mix(p.under, scene.star.light(&p.spokes), p.spokes.inside));
        }
        for (bars, pixels) in scene.bars.iter().zip(&self.bars) {
            let lights: Vec<f32> = (0..self.width).map(|col| bars.light(col as f32 + 0.5)).collect();
            for p in pixels {
                samples[p.at] = code(mix(p.under, lights[p.col], p.inside));
            }
        }
        for at in &self.several {
            let [x, y] = self.centre(*at);
            samples[*at] = code(scene.light(x, y));
        }
        samples
    }
}

fn code(light: f32) -> u16 {
    (light * 65535.0 + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_equals_the_patterns_one_pixel_at_a_time() {
        for [width, height] in [[16, 16], [17, 40], [64, 17], [400, 250]] {
            let geometry = Geometry::new(width, height).unwrap();
            let drawn = Drawn::new(geometry, &[0.0, 0.5, 1.0]);
            for seconds in [0.0, 0.013, 0.2, 1.7] {
                let scene = Scene::new(geometry, seconds);
                let samples = drawn.at(&scene);
                for (at, sample) in samples.iter().enumerate().take(width as usize * scene.wedge_top) {
                    let [x, y] = drawn.centre(at);
                    assert_eq!(*sample, code(scene.light(x, y)), "{width}x{height}, {seconds} s, pixel {at}");
                }
            }
        }
    }
}
