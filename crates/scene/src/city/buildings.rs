//! Adds buildings on the lots along the main road and the side streets, with facades, relief and roofs. A second row of
//! buildings is behind the row at the main road.

use glam::{Vec2, Vec3};

use super::district::District;
use super::facade::{Facade, Wall};
use super::ground::{SIDE_REACH_M, SIDE_SIDEWALK_WIDTH_M, SideFrame};
use super::static_city::{CURB_HEIGHT_M, City, uv_rect};
use crate::random::Draws;
use crate::shapes::material::Material;
use crate::shapes::mesh::Mesh;

/// The four corners of a building on the ground.
///
/// Corners 0 and 1 are the left and right ends of the front, as seen from the street. Corner 2 is behind corner 1, and
/// corner 3 is behind corner 0.
type Plot = [Vec3; 4];

pub(super) fn build(city: &mut City, seed: u64, start_s: f64, end_s: f64) {
    let draws = Draws::new(seed, "buildings");
    let mut heights = Vec::new();
    for (index, (a, b)) in blocks(city, start_s, end_s).into_iter().enumerate() {
        for side in [-1.0, 1.0] {
            let block = draws.item(index as u64 * 2 + u64::from(side > 0.0));
            add_front_row(city, block, side, (a, b), &mut heights);
            add_second_row(city, block.item(1 << 20), side, (a, b));
        }
    }
    for i in 0..city.road.junctions.len() {
        for side in [-1.0, 1.0] {
            add_side_rows(city, draws.item(1 << 30 | (i as u64 * 2 + u64::from(side > 0.0))), i, side);
        }
    }
    let mean = heights.iter().sum::<f32>() / heights.len().max(1) as f32;
    city.street_canyon = (mean, (city.road.half_width_m() + city.road.sidewalk_m + 1.0) as f32);
}

/// Returns the ranges of arc length between junctions and outside the tunnel.
fn blocks(city: &City, start_s: f64, end_s: f64) -> Vec<(f64, f64)> {
    let mut cuts = vec![start_s];
    for j in &city.road.junctions {
        cuts.push(j.s - j.half_width_m - SIDE_SIDEWALK_WIDTH_M);
        cuts.push(j.s + j.half_width_m + SIDE_SIDEWALK_WIDTH_M);
    }
    cuts.push(end_s);
    let mut blocks: Vec<(f64, f64)> = cuts.chunks_exact(2).map(|c| (c[0], c[1])).collect();
    if let Some((a, b)) = city.tunnel {
        blocks = blocks
            .into_iter()
            .flat_map(|(x, y)| [(x, y.min(a - 24.0)), (x.max(b + 6.0), y)])
            .filter(|(x, y)| y - x > 10.0)
            .collect();
    }
    blocks
}

/// Typical widths, heights and setbacks of lots, and the probability of a gap.
struct LotSizes {
    width: (f64, f64),
    height: (f32, f32),
    setback: (f64, f64),
    gap: f64,
}

fn lots(district: District) -> LotSizes {
    match district {
        District::OldTown => {
            LotSizes { width: (9.0, 20.0), height: (10.0, 21.0), setback: (0.0, 0.4), gap: 0.07 }
        }
        District::Downtown => {
            LotSizes { width: (16.0, 32.0), height: (14.0, 48.0), setback: (0.0, 2.5), gap: 0.08 }
        }
        District::Suburb => {
            LotSizes { width: (12.0, 19.0), height: (5.5, 9.0), setback: (4.0, 8.0), gap: 0.15 }
        }
    }
}

fn add_front_row(city: &mut City, block: Draws, side: f64, (a, b): (f64, f64), heights: &mut Vec<f32>) {
    let lots = lots(city.district);
    let edge = city.road.half_width_m() + city.road.sidewalk_m;
    let (mut s, mut i) = (a, 0u64);
    while b - s > 5.0 {
        let draws = block.item(i);
        i += 1;
        let mut width = draws.range(0, lots.width.0, lots.width.1);
        if b - s - width < lots.width.0 * 0.6 {
            width = b - s;
        }
        let (s0, s1) = (s, s + width);
        s = s1;
        let depth = draws.range(2, 11.0, 15.0);
        if draws.chance(1, lots.gap) {
            add_lawn(city, side, (s0, s1), (edge, edge + depth + 8.0));
            continue;
        }
        let setback = draws.range(3, lots.setback.0, lots.setback.1);
        let margin = if city.district == District::Suburb { 2.0 } else { 0.0 };
        if setback > 1.0 {
            add_lawn(city, side, (s0, s1), (edge, edge + setback + 6.0));
        }
        let near = edge + setback;
        let plot = plot_on_road(city, side, (s0 + margin, s1 - margin), (near, near + depth));
        let height = draws.range_f32(4, lots.height.0, lots.height.1);
        heights.push(add_house(city, draws, plot, height, true));
    }
}

fn plot_on_road(city: &City, side: f64, (s0, s1): (f64, f64), (d0, d1): (f64, f64)) -> Plot {
    let at = |s: f64, d: f64| city.road.place(s, side * d, 0.0);
    // A plot on the right side of the road has d < 0. For a viewer on the street, the left end of this plot has the
    // larger s. The left end of a plot on the left side of the road has the smaller s.
    let (left, right) = if side < 0.0 { (s1, s0) } else { (s0, s1) };
    [at(left, d0), at(right, d0), at(right, d1), at(left, d1)]
}

fn add_lawn(city: &mut City, side: f64, (s0, s1): (f64, f64), (d0, d1): (f64, f64)) {
    city.mesh.begin_surface(Material::Grass);
    let z = CURB_HEIGHT_M - 0.02;
    let p = [(s0, d0), (s1, d0), (s1, d1), (s0, d1)].map(|(s, d)| city.road.place(s, side * d, z));
    city.mesh.add_quad(p, p.map(|p| Vec2::new(p.x, p.y)), Vec3::Z);
    city.mesh.end_chunk();
}

/// Adds taller boxes behind the front row. The boxes form a skyline.
fn add_second_row(city: &mut City, block: Draws, side: f64, (a, b): (f64, f64)) {
    let lots = lots(city.district);
    let edge = city.road.half_width_m() + city.road.sidewalk_m + 26.0;
    let (mut s, mut i) = (a + 3.0, 0u64);
    while s + 12.0 < b {
        let draws = block.item(i);
        i += 1;
        let width = draws.range(0, 14.0, 24.0).min(b - s);
        if draws.chance(1, 0.75) {
            let d = edge + draws.range(2, 0.0, 8.0);
            let plot = plot_on_road(city, side, (s, s + width), (d, d + 14.0));
            let height = draws.range_f32(3, lots.height.0, lots.height.1) * draws.range_f32(4, 1.0, 1.7);
            add_house(city, draws, plot, height, false);
        }
        s += width + draws.range(5, 2.0, 8.0);
    }
}

/// Adds rows of buildings on both sides of a side street, and one building at the far end of the side street.
fn add_side_rows(city: &mut City, draws: Draws, index: usize, side: f64) {
    let frame = SideFrame::new(&city.road, index, side);
    let half = city.road.junctions[index].half_width_m + SIDE_SIDEWALK_WIDTH_M;
    let lots = lots(city.district);
    let first = city.road.half_width_m() + city.road.sidewalk_m + lots.setback.1 + 17.0;
    for mirror in [-1.0, 1.0] {
        let row = draws.item(u64::from(mirror > 0.0));
        let (mut d, mut i) = (first, 0u64);
        while d + 8.0 < SIDE_REACH_M {
            let lot = row.item(i);
            i += 1;
            let width = lot.range(0, 9.0, 16.0).min(SIDE_REACH_M - d);
            let w = half + lot.range(1, 0.0, 1.0);
            let along = if side * mirror > 0.0 { (d + width, d) } else { (d, d + width) };
            let at = |d: f64, w: f64| frame.place(d, mirror * w, 0.0);
            let plot = [at(along.0, w), at(along.1, w), at(along.1, w + 12.0), at(along.0, w + 12.0)];
            add_house(city, lot, plot, lot.range_f32(2, lots.height.0, lots.height.1), false);
            d += width;
        }
    }
    let end = [-14.0, 14.0].map(|w| w * -side);
    let at = |d: f64, w: f64| frame.place(d, w, 0.0);
    let plot = [
        at(SIDE_REACH_M, end[0]),
        at(SIDE_REACH_M, end[1]),
        at(SIDE_REACH_M + 12.0, end[1]),
        at(SIDE_REACH_M + 12.0, end[0]),
    ];
    add_house(city, draws.item(9), plot, draws.range_f32(0, lots.height.0, lots.height.1), false);
}

/// Adds one building and returns its height. If `detailed` is true, the front has relief.
fn add_house(city: &mut City, draws: Draws, plot: Plot, height: f32, detailed: bool) -> f32 {
    let front_m = plot[0].distance(plot[1]);
    let style = Facade::from_draws(draws.item(77), city.district, height, front_m);
    let index = city.facades.len() as u16;
    city.facades.push(style);
    let mesh = &mut city.mesh;
    let center = (plot[0] + plot[1] + plot[2] + plot[3]) * 0.25;
    let up = Vec3::Z * style.height_m;
    for i in 0..4 {
        mesh.begin_surface(Material::Facade(index));
        let (p, q) = (plot[i], plot[(i + 1) % 4]);
        let outward = 0.5 * (p + q) - center;
        add_wall(mesh, p, q, up, outward);
    }
    let pitched = city.district != District::Downtown && draws.chance(50, 0.65);
    if pitched {
        add_gable_roof(mesh, draws, plot, style.height_m);
    } else {
        add_flat_roof(mesh, draws, plot, style.height_m);
    }
    if detailed {
        add_relief(mesh, draws, plot, &style, center);
    }
    mesh.end_chunk();
    style.height_m
}

/// Adds a wall that consists of several rows of quads, so that sky visibility can vary with height.
fn add_wall(mesh: &mut Mesh, p: Vec3, q: Vec3, up: Vec3, outward: Vec3) {
    let width = p.distance(q);
    let cuts = [0.0, 0.12, 0.45, 1.0];
    let height = up.z;
    for w in cuts.windows(2) {
        let uv =
            [(0.0, w[0]), (width, w[0]), (width, w[1]), (0.0, w[1])].map(|(u, v)| Vec2::new(u, v * height));
        mesh.add_quad([p + up * w[0], q + up * w[0], q + up * w[1], p + up * w[1]], uv, outward);
    }
}

fn add_gable_roof(mesh: &mut Mesh, draws: Draws, plot: Plot, height: f32) {
    mesh.begin_surface(Material::Roof(draws.range_f32(51, 0.0, 1.0)));
    let rise = Vec3::Z * draws.range_f32(52, 2.4, 4.2);
    let at = |p: Vec3| p + Vec3::Z * height;
    let (front, back) = ((plot[0] + plot[1]) * 0.5, (plot[2] + plot[3]) * 0.5);
    let over = (front - back).normalize_or_zero() * 0.45;
    let drop = -Vec3::Z * 0.25;
    let ridge = [at((plot[0] + plot[3]) * 0.5) + rise, at((plot[1] + plot[2]) * 0.5) + rise];
    let width = plot[0].distance(plot[1]);
    let slope = (0.25 * plot[0].distance(plot[3]).powi(2) + rise.z * rise.z).sqrt();
    for (a, b, over, r) in
        [(plot[0], plot[1], over, [ridge[0], ridge[1]]), (plot[2], plot[3], -over, [ridge[1], ridge[0]])]
    {
        mesh.add_quad(
            [at(a) + over + drop, at(b) + over + drop, r[1], r[0]],
            uv_rect(width, slope),
            over + Vec3::Z,
        );
    }
    mesh.begin_surface(Material::Plain(Vec3::splat(0.35)));
    for (a, b, r) in [(plot[3], plot[0], ridge[0]), (plot[1], plot[2], ridge[1])] {
        let n = (b - a).cross(Vec3::Z).normalize_or_zero();
        let corners = [at(a), at(b), r].map(|p| mesh.add_vertex(p, n, Vec2::ZERO));
        mesh.add_triangle(corners);
    }
    let chimney = ridge[0] + (ridge[1] - ridge[0]) * draws.range_f32(53, 0.15, 0.85);
    mesh.begin_surface(Material::Plain(Vec3::new(0.28, 0.16, 0.12)));
    mesh.add_box(chimney + Vec3::Z * 0.2, [Vec3::X * 0.35, Vec3::Y * 0.35, Vec3::Z * 0.8]);
}

fn add_flat_roof(mesh: &mut Mesh, draws: Draws, plot: Plot, height: f32) {
    mesh.begin_surface(Material::Roof(0.5));
    let top = plot.map(|p| p + Vec3::Z * (height - 0.3));
    mesh.add_quad(top, top.map(|p| Vec2::new(p.x, p.y)), Vec3::Z);
    mesh.begin_surface(Material::Plain(Vec3::splat(draws.range_f32(54, 0.25, 0.5))));
    let (x, y) = (plot[1] - plot[0], plot[3] - plot[0]);
    for i in 0..2u64 {
        let at = plot[0] + x * draws.range_f32(55 + i, 0.2, 0.8) + y * draws.range_f32(60 + i, 0.3, 0.8);
        let z = Vec3::Z * draws.range_f32(65 + i, 0.5, 1.5);
        mesh.add_box(
            at + Vec3::Z * height + z * 0.6,
            [x.normalize_or_zero() * 1.6, y.normalize_or_zero() * 1.2, z],
        );
    }
}

/// Adds a cornice, a string course, and balconies or an awning to the front.
fn add_relief(mesh: &mut Mesh, draws: Draws, plot: Plot, style: &Facade, center: Vec3) {
    let along = (plot[1] - plot[0]) * 0.5;
    let out = {
        let n = along.cross(Vec3::Z).normalize_or_zero();
        if n.dot(plot[0] - center) < 0.0 { -n } else { n }
    };
    let middle = (plot[0] + plot[1]) * 0.5;
    if style.wall != Wall::GlassCurtain {
        mesh.begin_surface(Material::Plain(style.albedo * 0.9 + 0.06));
        let z = Vec3::Z * (style.height_m - 0.35);
        mesh.add_box(middle + z + out * 0.15, [along, out * 0.2, Vec3::Z * 0.22]);
        if draws.chance(70, 0.5) {
            let z = Vec3::Z * (style.ground_m - 0.1);
            mesh.add_box(middle + z + out * 0.06, [along, out * 0.1, Vec3::Z * 0.12]);
        }
    }
    let bays = (along.length() * 2.0 / style.bay_m).round() as u32;
    let stories = ((style.height_m - 0.5 - style.ground_m) / style.story_m).round() as u32;
    let step = along.normalize_or_zero() * style.bay_m;
    if style.wall == Wall::Plaster && bays >= 3 && draws.chance(71, 0.55) {
        for floor in 0..stories {
            for bay in (1..bays - 1).step_by(2) {
                let at = plot[0]
                    + step * (bay as f32 + 0.5)
                    + Vec3::Z * (style.ground_m + floor as f32 * style.story_m + 0.1);
                add_balcony(mesh, at, step * 0.42, out);
            }
        }
    }
    if let Some(color) = style.shop.filter(|_| draws.chance(72, 0.5)) {
        mesh.begin_surface(Material::Awning(color));
        let (z0, z1) = (Vec3::Z * (style.ground_m - 1.35), Vec3::Z * (style.ground_m - 0.85));
        let reach = out * 1.3;
        let (a, b) = (middle - along * 0.85, middle + along * 0.85);
        mesh.add_quad(
            [a + reach + z0, b + reach + z0, b + z1, a + z1],
            uv_rect(along.length() * 1.7, 1.4),
            out + Vec3::Z,
        );
    }
}

fn add_balcony(mesh: &mut Mesh, at: Vec3, half: Vec3, out: Vec3) {
    mesh.begin_surface(Material::Plain(Vec3::splat(0.42)));
    mesh.add_box(at + out * 0.5, [half, out * 0.5, Vec3::Z * 0.08]);
    mesh.begin_surface(Material::Plain(Vec3::splat(0.10)));
    let rail = at + Vec3::Z * 1.0;
    mesh.add_box(rail + out * 0.98, [half, out * 0.02, Vec3::Z * 0.03]);
    for i in -3..=3 {
        let x = half * (i as f32 / 3.0);
        mesh.add_box(at + Vec3::Z * 0.5 + out * 0.98 + x, [half * 0.025, out * 0.02, Vec3::Z * 0.45]);
    }
}
