//! The moving chart with all that stays drawn once: a frame needs only the pixels of what moves.

use super::chart_scene::{Disc, GROUND, Scene, Spokes, mix};
use crate::spikes::Geometry;

/// Neighbours in a row, which are stored next to each other.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// The first pixel.
    at: usize,
    /// Where the values of the first pixel lie.
    from: usize,
    len: usize,
}

/// Pixels in runs, so that what is computed for one goes for many in a vector.
#[derive(Clone, Debug, Default)]
struct Runs(Vec<Run>);

impl Runs {
    fn push(&mut self, at: usize, from: usize, width: usize) {
        match self.0.last_mut() {
            Some(run) if run.at + run.len == at && !at.is_multiple_of(width) => run.len += 1,
            _ => self.0.push(Run { at, from, len: 1 }),
        }
    }
}

/// Pixels that see nothing that moves but the star.
#[derive(Clone, Debug, Default)]
struct OfStar {
    runs: Runs,
    under: Vec<f32>,
    inside: Vec<f32>,
    cos: Vec<f32>,
    sin: Vec<f32>,
    reach: Vec<f32>,
}

impl OfStar {
    fn push(&mut self, at: usize, width: usize, under: f32, spokes: Spokes) {
        self.runs.push(at, self.under.len(), width);
        self.under.push(under);
        self.inside.push(spokes.inside);
        self.cos.push(spokes.angle[0]);
        self.sin.push(spokes.angle[1]);
        self.reach.push(spokes.reach);
    }

    fn draw(&self, star: &Disc, samples: &mut [u16]) {
        for &Run { at, from, len } in &self.runs.0 {
            let samples = &mut samples[at..][..len];
            let [under, inside, cos, sin, reach] =
                [&self.under, &self.inside, &self.cos, &self.sin, &self.reach].map(|all| &all[from..][..len]);
            for i in 0..len {
                let spokes = Spokes { inside: inside[i], angle: [cos[i], sin[i]], reach: reach[i] };
                samples[i] = code(mix(under[i], star.light(&spokes), spokes.inside));
            }
        }
    }
}

/// Pixels that see nothing that moves but one row of bars.
#[derive(Clone, Debug, Default)]
struct OfBars {
    runs: Runs,
    under: Vec<f32>,
    inside: Vec<f32>,
}

impl OfBars {
    fn push(&mut self, at: usize, width: usize, under: f32, inside: f32) {
        self.runs.push(at, self.under.len(), width);
        self.under.push(under);
        self.inside.push(inside);
    }

    /// `lights` are those of the bars in each column.
    fn draw(&self, lights: &[f32], samples: &mut [u16]) {
        for &Run { at, from, len } in &self.runs.0 {
            let samples = &mut samples[at..][..len];
            let [under, inside] = [&self.under, &self.inside].map(|all| &all[from..][..len]);
            let lights = &lights[at % lights.len()..][..len];
            for i in 0..len {
                samples[i] = code(mix(under[i], lights[i], inside[i]));
            }
        }
    }
}

/// What does not change from frame to frame.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    width: usize,
    still: Vec<u16>,
    star: OfStar,
    bars: [OfBars; 2],
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
            star: OfStar::default(),
            bars: <[OfBars; 2]>::default(),
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
        let [x, y] = self.centre(at);
        let spokes = scene.star.spokes(x, y);
        let inside = [0, 1].map(|i| scene.bars[i].inside(x, y));
        let under = scene.square.over(GROUND, x, y);
        self.still.push(code(under));
        match (spokes, inside) {
            (None, [0.0, 0.0]) => {}
            (Some(spokes), [0.0, 0.0]) if under == GROUND => self.star.push(at, self.width, under, spokes),
            (None, [inside, 0.0]) => self.bars[0].push(at, self.width, under, inside),
            (None, [0.0, inside]) => self.bars[1].push(at, self.width, under, inside),
            _ => self.several.push(at),
        }
    }

    fn centre(&self, at: usize) -> [f32; 2] {
        [(at % self.width) as f32 + 0.5, (at / self.width) as f32 + 0.5]
    }

    /// 16-bit samples of the chart as `scene` stands.
    pub(super) fn at(&self, scene: &Scene) -> Vec<u16> {
        let mut samples = self.still.clone();
        self.star.draw(&scene.star, &mut samples);
        for (bars, pixels) in scene.bars.iter().zip(&self.bars) {
            let lights: Vec<f32> = (0..self.width).map(|col| bars.light(col as f32 + 0.5)).collect();
            pixels.draw(&lights, &mut samples);
        }
        for at in &self.several {
            let [x, y] = self.centre(*at);
            samples[*at] = code(scene.light(x, y));
        }
        samples
    }
}

/// Light of 0 to 1 as the nearest code, halves up. The conversion of the language asks each value whether it is a
/// number, one at a time; here the sum with 2^23 has the whole number in its lower bits.
fn code(light: f32) -> u16 {
    const WHOLE: f32 = 8_388_608.0;
    let value = light * 65535.0 + 0.5;
    let nearest = (value + WHOLE) - WHOLE;
    let floor = if nearest > value { nearest - 1.0 } else { nearest };
    (floor + WHOLE).to_bits() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_language() {
        let near = |k: u32| [k as f32 / 131_070.0, (k as f32 / 131_070.0).next_up(), k as f32 / 7e5];
        for light in (0..=131_070).flat_map(near).filter(|light| *light <= 1.0) {
            assert_eq!(code(light), (light * 65535.0 + 0.5) as u16, "{light}");
        }
    }

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
