//! The style of the walls of one building. The style is drawn once per building and evaluated for every pixel.

use glam::Vec3;

use super::district::District;
use crate::random::Draws;

/// Material of the wall between the windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wall {
    Brick,
    Plaster,
    Panels,
    GlassCurtain,
}

/// The style of a building. All lengths are in meters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facade {
    pub wall: Wall,
    pub albedo: Vec3,
    pub frame: Vec3,
    pub story_m: f32,
    pub bay_m: f32,
    pub ground_m: f32,
    /// Width of the window as a fraction of the bay width, and height of the window as a fraction of the story height.
    pub window: (f32, f32),
    /// Color of the shop signs. `None` if the ground floor has no shops.
    pub shop: Option<Vec3>,
    /// Fraction of windows that are lit in the evening.
    pub lit_share: f32,
    pub seed: u32,
    pub height_m: f32,
}

/// Wall albedos. The ranges of measured values are 0.2 to 0.3 for brick, 0.4 to 0.7 for plaster and 0.3 to 0.4 for
/// concrete.
const BRICKS: [[f32; 3]; 4] =
    [[0.30, 0.13, 0.09], [0.36, 0.20, 0.13], [0.24, 0.12, 0.10], [0.40, 0.30, 0.20]];
const PLASTERS: [[f32; 3]; 7] = [
    [0.62, 0.56, 0.45],
    [0.66, 0.62, 0.56],
    [0.58, 0.44, 0.30],
    [0.50, 0.52, 0.50],
    [0.60, 0.48, 0.42],
    [0.45, 0.50, 0.56],
    [0.64, 0.57, 0.36],
];
const PANELS: [[f32; 3]; 4] =
    [[0.38, 0.37, 0.35], [0.46, 0.44, 0.40], [0.30, 0.31, 0.33], [0.52, 0.50, 0.47]];
const SHOP_SIGNS: [[f32; 3]; 6] = [
    [0.50, 0.06, 0.05],
    [0.05, 0.16, 0.40],
    [0.06, 0.30, 0.12],
    [0.60, 0.45, 0.05],
    [0.08, 0.08, 0.09],
    [0.55, 0.53, 0.50],
];

impl Facade {
    /// Returns a style that suits `district`, for a building whose height is about `height_m`.
    ///
    /// The height is rounded to whole stories. The bay width is chosen so that the front has a whole number of bays.
    pub(crate) fn from_draws(draws: Draws, district: District, height_m: f32, front_m: f32) -> Self {
        let wall = match (district, draws.index_below(0, 10)) {
            (District::OldTown, 0..4) | (District::Suburb, 0..5) => Wall::Brick,
            (District::OldTown | District::Suburb, _) | (District::Downtown, 0..2) => Wall::Plaster,
            (District::Downtown, 2..6) => Wall::Panels,
            (District::Downtown, _) => Wall::GlassCurtain,
        };
        let palette: &[[f32; 3]] = match wall {
            Wall::Brick => &BRICKS,
            Wall::Plaster => &PLASTERS,
            Wall::Panels | Wall::GlassCurtain => &PANELS,
        };
        let story_m = draws.range_f32(1, 2.9, 3.6);
        let shop = district != District::Suburb && draws.chance(2, 0.6);
        let ground_m = if shop { draws.range_f32(3, 3.8, 4.6) } else { story_m };
        let stories = ((height_m - ground_m) / story_m).round().max(1.0);
        let bays = (front_m / draws.range_f32(4, 2.2, 3.8)).round().max(1.0);
        let window = if wall == Wall::GlassCurtain {
            (0.94, 0.80)
        } else {
            (draws.range_f32(5, 0.36, 0.58), draws.range_f32(6, 0.46, 0.62))
        };
        Self {
            wall,
            albedo: Vec3::from(palette[draws.index_below(7, palette.len())]) * draws.range_f32(8, 0.8, 1.1),
            frame: Vec3::splat(if draws.chance(9, 0.65) { 0.65 } else { 0.10 }),
            story_m,
            bay_m: front_m / bays,
            ground_m,
            window,
            shop: shop.then(|| SHOP_SIGNS[draws.index_below(10, SHOP_SIGNS.len())].into()),
            lit_share: draws.range_f32(11, 0.25, 0.6),
            seed: draws.bits(12) as u32,
            height_m: ground_m + stories * story_m + 0.5,
        }
    }
}
