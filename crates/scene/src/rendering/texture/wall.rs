//! Textures of facades with windows and shops, of roofs, and of the lining of the tunnel.

use glam::{Vec2, Vec3};

use super::noise::{fade, grain, pulses, share_inside, smoothstep, unit};
use super::surface_sample::{Appearance, SurfaceSample};
use crate::city::facade::{Facade, Wall};
use crate::lighting::Light;

/// Returns the appearance of a facade. The first texture coordinate is the distance from the left corner of the facade,
/// and the second is the height.
pub(super) fn facade(spot: &SurfaceSample, style: &Facade, light: &Light) -> Appearance {
    let wall = wall_look(spot, style);
    let v = spot.uv.y;
    if v < style.ground_m
        && let Some(sign) = style.shop
    {
        return shop(spot, style, sign, wall, light);
    }
    windows(spot, style, wall, light)
}

fn wall_look(spot: &SurfaceSample, style: &Facade) -> Appearance {
    let (p, f) = (spot.uv, spot.footprint);
    let foot = f.max_element();
    // Rain causes streaks on the wall, and dirt collects at the foot of the wall.
    let streak = grain(p * Vec2::new(1.0, 0.12), 0.45, f.x, style.seed);
    let stain = grain(p, 2.7, foot, style.seed ^ 1);
    let dirt = smoothstep(1.2, 0.0, p.y);
    let mut a = 1.0 + 0.08 * streak + 0.10 * stain - 0.22 * dirt;
    match style.wall {
        Wall::Brick => {
            let course = (p.y / 0.075).floor();
            let shift = 0.12 * (course as i32).rem_euclid(2) as f32;
            let mortar = pulses(p.y, 0.075, 0.0, 0.011, f.y).max(pulses(p.x + shift, 0.24, 0.0, 0.011, f.x));
            let brick = unit(((p.x + shift) / 0.24).floor() as i32, course as i32, style.seed) - 0.5;
            a *= 1.0 + 0.35 * brick * fade(0.15, foot);
            return Appearance::matte((style.albedo * a).lerp(Vec3::new(0.42, 0.40, 0.37), 0.6 * mortar));
        }
        Wall::Plaster => a *= 1.0 + 0.05 * grain(p, 0.12, foot, 7),
        Wall::Panels => {
            let joint = pulses(p.y - style.ground_m, style.story_m, 0.0, 0.03, f.y).max(pulses(
                p.x,
                style.bay_m,
                0.0,
                0.025,
                f.x,
            ));
            a *= (1.0 - 0.45 * joint) * (1.0 + 0.07 * grain(p, 0.2, foot, 8));
        }
        Wall::GlassCurtain => return Appearance::glossy(style.albedo * 0.35 * a, 0.10, 0.35),
    }
    Appearance::matte(style.albedo * a.max(0.1))
}

/// Adds the windows of all stories to a wall.
fn windows(spot: &SurfaceSample, style: &Facade, wall: Appearance, light: &Light) -> Appearance {
    let (u, f) = (spot.uv.x, spot.footprint);
    let v = spot.uv.y - if style.shop.is_some() { style.ground_m } else { 0.0 };
    let top = style.height_m - 0.45 - if style.shop.is_some() { style.ground_m } else { 0.0 };
    let (bay, story) = (style.bay_m, style.story_m);
    let (w, h) = (style.window.0 * bay, style.window.1 * story);
    let (left, sill) = (0.5 * (bay - w), 0.30 * (story - h) + 0.35 * (story - h));
    let on = share_inside(v, 0.0, top, f.y);
    let reach = |grow: f32| {
        pulses(u, bay, left - grow, left + w + grow, f.x)
            * pulses(v, story, sill - grow, sill + h + grow, f.y)
            * on
    };
    let frame_m = if style.wall == Wall::GlassCurtain { 0.03 } else { 0.07 };
    let (outer, inner) = (reach(0.0), reach(-frame_m));
    let mut look = wall;
    if style.wall != Wall::GlassCurtain {
        // A light window sill is below the window. A frame around the window has another brightness than the wall.
        let ledge =
            pulses(u, bay, left - 0.1, left + w + 0.1, f.x) * pulses(v, story, sill - 0.09, sill, f.y) * on;
        look = look.mix(Appearance::matte(Vec3::splat(0.48)), ledge);
        let surround = (reach(0.12) - outer).max(0.0);
        look.albedo *= 1.0 + if style.wall == Wall::Plaster { 0.25 } else { -0.08 } * surround;
    }
    if outer <= 0.0 {
        return look;
    }
    look = look.mix(Appearance::glossy(style.frame, 0.04, 0.5), outer);
    let mullion = if w > 0.9 { pulses(u, bay, 0.5 * bay - 0.03, 0.5 * bay + 0.03, f.x) } else { 0.0 };
    let transom = if h > 1.3 { pulses(v, story, sill + 0.68 * h, sill + 0.68 * h + 0.05, f.y) } else { 0.0 };
    let glass = inner * (1.0 - mullion.max(transom));
    let local = Vec2::new(u / bay, v / story);
    look.mix(pane(spot, style, local, (sill / story, (sill + h) / story), light), glass)
}

/// Returns the appearance of a window pane in front of a room. Each window has its own blind and lamp. `cell` contains
/// the texture coordinates in units of bays and stories.
fn pane(
    spot: &SurfaceSample,
    style: &Facade,
    cell: Vec2,
    (low, high): (f32, f32),
    light: &Light,
) -> Appearance {
    let (cx, cy) = (cell.x.floor() as i32, cell.y.floor() as i32);
    let seed = style.seed;
    // At a large distance, a sample covers many rooms and has their mean appearance.
    let one = fade(style.bay_m, spot.footprint.max_element());
    let draw = |k: u32| unit(cx, cy, seed ^ (k * 7919));
    let lit = if draw(1) < style.lit_share { 1.0 } else { 0.03 };
    let lit = style.lit_share + (lit - style.lit_share) * one;
    let height = (cell.y - cell.y.floor() - low) / (high - low);
    let blind_end = 1.0 - draw(2) * draw(2);
    let blind = if draw(3) < 0.45 { smoothstep(blind_end - 0.02, blind_end + 0.02, height) } else { 0.0 };
    let blind = 0.16 + (blind - 0.16) * one;
    // The window is recessed, so the lintel shades the upper edge of the pane.
    let shade = 1.0 - 0.35 * smoothstep(0.86, 1.0, height) * one;
    let room = Vec3::splat(0.035 + 0.03 * draw(4) * one);
    let albedo = room.lerp(Vec3::new(0.42, 0.40, 0.36), 0.8 * blind) * shade;
    let warm = Vec3::new(1.25, 0.95, 0.55).lerp(Vec3::new(0.95, 1.0, 1.05), 2.0 * (draw(5) - 0.5).max(0.0));
    let gradient = 0.6 + 0.6 * height.clamp(0.0, 1.0) * one;
    // The light of rooms differs by a factor of 16: the logarithm is uniform, and the mean is 0.9.
    let strength = 0.9 + (0.166 * libm::exp2f(4.0 * draw(6)) - 0.9) * one;
    let emission = warm * (light.window_cd_m2 * lit * strength * gradient * (1.0 - 0.55 * blind));
    Appearance {
        emission,
        ..Appearance::glossy(albedo, if style.wall == Wall::GlassCurtain { 0.12 } else { 0.07 }, 0.04)
    }
}

/// Adds shop windows between piers, and a sign board above the windows.
fn shop(spot: &SurfaceSample, style: &Facade, sign: Vec3, wall: Appearance, light: &Light) -> Appearance {
    let (u, v, f) = (spot.uv.x, spot.uv.y, spot.footprint);
    let bay = style.bay_m * if style.bay_m < 3.0 { 2.0 } else { 1.0 };
    let foot = f.max_element();
    let board = share_inside(v, style.ground_m - 0.85, style.ground_m - 0.2, f.y);
    let pane_on = pulses(u, bay, 0.25, bay - 0.25, f.x) * share_inside(v, 0.45, style.ground_m - 1.0, f.y);
    let door = pulses(u, bay * 3.0, bay * 1.35, bay * 1.35 + 1.0, f.x) * share_inside(v, 0.05, 2.2, f.y);
    // The letters are irregular strokes in the middle of the sign board.
    let letter = (u / 0.22).floor() as i32;
    let ink = fade(0.2, foot)
        * f32::from(u8::from(unit(letter, 0, style.seed) < 0.7))
        * pulses(u, 0.22, 0.04, 0.04 + 0.14 * unit(letter, 1, style.seed), f.x)
        * share_inside(
            v,
            style.ground_m - 0.68,
            style.ground_m - 0.68 + 0.2 + 0.14 * unit(letter, 2, style.seed),
            f.y,
        )
        * pulses(u, bay * 2.0, 0.6, bay * 2.0 - 0.8, f.x);
    let contrast = if sign.element_sum() > 0.9 { Vec3::splat(0.06) } else { Vec3::splat(0.7) };
    let lit_board = Vec3::splat(0.25 * light.window_cd_m2);
    let mut board_look = Appearance::glossy(sign.lerp(contrast, ink), 0.04, 0.4);
    board_look.emission = lit_board * board_look.albedo * 2.0;
    let (shelf, hue) = goods(spot, style.seed);
    let mut window = Appearance::glossy(hue * shelf, 0.07, 0.04);
    window.emission = hue * Vec3::new(1.1, 1.0, 0.8) * (light.window_cd_m2 * (0.08 + 2.2 * shelf));
    let mut door_look = Appearance::glossy(Vec3::splat(0.05), 0.07, 0.05);
    door_look.emission = window.emission * 0.6;
    wall.mix(board_look, board).mix(window, pane_on).mix(door_look, door)
}

/// Returns the brightness and the color of the goods on shelves behind a shop window.
fn goods(spot: &SurfaceSample, seed: u32) -> (f32, Vec3) {
    let (p, foot) = (spot.uv, spot.footprint.max_element());
    let size = Vec2::new(0.42, 0.6);
    let cell = (p / size).floor();
    let draw = |k: u32| unit(cell.x as i32, cell.y as i32, seed ^ (k * 104_729));
    let at = p - cell * size;
    let (left, top) = (0.04 + 0.16 * draw(1), 0.2 + 0.36 * draw(2));
    let right = (left + 0.12 + 0.16 * draw(3)).min(0.40);
    let item =
        share_inside(at.x, left, right, spot.footprint.x) * share_inside(at.y, 0.05, top, spot.footprint.y);
    let one = fade(0.4, foot);
    // The probability of an item is 0.75 below a height of 1.2 m. It decreases to 0 at a height of 2.4 m.
    let present = if draw(4) < 0.75 * smoothstep(2.4, 1.2, p.y) { 1.0 } else { 0.0 };
    let item = 0.25 + (item * present - 0.25) * one;
    let color = Vec3::new(0.55 + 0.6 * draw(5), 0.55 + 0.5 * draw(6), 0.5 + 0.6 * draw(7));
    let color = Vec3::splat(0.85).lerp(color, item * one);
    let board = pulses(p.y, size.y, 0.0, 0.05, spot.footprint.y);
    (0.05 + 0.13 * item + 0.04 * board, color)
}

/// Returns the appearance of rows of roof tiles. `tint` selects a color between red and slate.
pub(super) fn roof(spot: &SurfaceSample, tint: f32) -> Appearance {
    let (p, f) = (spot.uv, spot.footprint);
    let foot = f.max_element();
    let course = pulses(p.y, 0.32, 0.0, 0.06, f.y);
    let tile = unit((p.x / 0.25).floor() as i32, (p.y / 0.32).floor() as i32, 3) - 0.5;
    let color = Vec3::new(0.30, 0.11, 0.065).lerp(Vec3::new(0.13, 0.135, 0.145), tint);
    let a = (1.0 - 0.45 * course) * (1.0 + 0.3 * tile * fade(0.25, foot) + 0.15 * grain(p, 1.8, foot, 4));
    Appearance::matte(color * a)
}

/// Returns the appearance of the tunnel lining. The lower part is light tiles, the upper part is sooty concrete, and a
/// dark band shows cable trays.
pub(super) fn tunnel(spot: &SurfaceSample) -> Appearance {
    let (p, f) = (spot.uv, spot.footprint);
    let foot = f.max_element();
    let concrete = Vec3::splat(0.22)
        * (1.0 + 0.15 * grain(p, 0.5, foot, 1) + 0.15 * grain(p * Vec2::new(0.2, 1.0), 2.0, foot, 2));
    let tile = 0.55
        * (1.0 - 0.3 * pulses(p.x, 0.6, 0.0, 0.015, f.x).max(pulses(p.y, 0.3, 0.0, 0.015, f.y)))
        * (1.0 + 0.1 * grain(p, 1.5, foot, 3) - 0.25 * smoothstep(0.8, 0.0, p.y));
    let tiled = share_inside(p.y, 0.2, 2.6, f.y);
    let tray = share_inside(p.y, 3.1, 3.35, f.y);
    let seam = pulses(p.x, 12.0, 0.0, 0.10, f.x);
    let look = Appearance::matte(concrete * (1.0 - 0.5 * seam))
        .mix(Appearance::glossy(Vec3::new(1.0, 0.98, 0.9) * tile, 0.05, 0.35), tiled);
    look.mix(Appearance::matte(Vec3::splat(0.06)), tray)
}
