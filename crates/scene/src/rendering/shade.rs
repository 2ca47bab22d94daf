//! Computes the luminance of a surface point in the direction of the camera, in cd/m2.

use glam::{Vec2, Vec3};

use super::fragment::{Fragment, SurfacePoint};
use super::frame::SceneInstant;
use super::texture;
use super::texture::{Appearance, noise};
use crate::lighting::LAMP_RANGE_M;
use crate::shapes::lamp_shadows::POST_RADIUS_M;
use crate::shapes::material::Material;

const PI: f32 = std::f32::consts::PI;

/// Returns whether a point is in direct light of the sun or moon.
pub(crate) fn sees_sun(frame: &SceneInstant, p: &SurfacePoint) -> bool {
    let sun = frame.scene.light.sun_direction;
    if !p.is_leaf && p.facet.dot(sun) <= 0.0 {
        return false;
    }
    // The ray of a leaf starts outside the leaf cluster, because otherwise the cluster would block its own rays.
    let origin = p.world + if p.is_leaf { sun * 0.35 } else { p.facet * 0.03 };
    if frame.scene.sun_shadows().is_blocked(origin, 400.0) {
        return false;
    }
    // The grid is queried at the place on the ground where the shadow of this point would be. The list of this place
    // contains all vehicles that may shadow the point.
    let ground = origin.truncate() - sun.truncate() * (origin.z / sun.z.max(0.05));
    !frame.is_blocked_by(frame.shadow_grid.items_at(ground), origin, sun, 200.0)
}

/// Light at a surface point. It consists of the diffuse illuminance and the luminance of the highlights.
struct IncomingLight {
    diffuse_lux: Vec3,
    highlight: Vec3,
}

/// Returns the luminance of a fragment. `sun` is the fraction of the sun that is visible from the fragment.
pub(crate) fn shade(frame: &SceneInstant, f: &Fragment, sun: f32) -> Vec3 {
    let scene = frame.scene;
    let light = &scene.light;
    let look = texture::appearance(f.material, &f.spot, &scene.city, light);
    let tunnel = tunnel_share(frame, f);
    let mut arriving = IncomingLight { diffuse_lux: add_ambient(frame, f, tunnel), highlight: Vec3::ZERO };
    if sun > 0.0 {
        let cosine = f.normal.dot(light.sun_direction);
        let through = look.transmission * 0.6 * (-cosine).max(0.0);
        arriving.diffuse_lux += light.sun_illuminance * (sun * (cosine.max(0.0) + through));
        if cosine > 0.0 {
            arriving.highlight +=
                light.sun_illuminance * (sun * highlight_luminance(f, &look, light.sun_direction));
        }
    }
    if light.lamp_cd > 0.0 {
        add_lamps(frame, f, &look, &mut arriving);
    }
    if light.headlight_cd > 0.0 {
        add_beams(frame, f, &look, &mut arriving);
    }
    let cosine = (-f.normal.dot(f.view_direction)).clamp(0.0, 1.0);
    let fresnel = look.gloss + (1.0 - look.gloss) * (1.0 - look.roughness) * fifth_power(1.0 - cosine);
    let clear = (1.0 - look.roughness) * (1.0 - look.roughness);
    let mut out = look.albedo * arriving.diffuse_lux * (1.0 / PI) + arriving.highlight + look.emission;
    if fresnel * clear > 0.002 {
        let direction = f.view_direction - f.normal * (2.0 * f.view_direction.dot(f.normal));
        out = out * (1.0 - fresnel * clear)
            + reflected_environment(frame, f, direction, tunnel, look.roughness) * (fresnel * clear);
    }
    // The air in front of the tunnel scatters daylight, and the air inside does not.
    let outside = f.distance.min(frame.entrance_m);
    add_haze(frame, out, f.view_direction, f.distance + (outside - f.distance) * tunnel)
}

/// Returns the luminance of the sky in direction `direction`, including clouds and the disk of the sun.
pub(crate) fn sky_luminance(frame: &SceneInstant, direction: Vec3) -> Vec3 {
    let light = &frame.scene.light;
    let mut sky = light.sky_luminance(direction);
    if light.cloud_cover > 0.0 && direction.z > 0.01 {
        let p = Vec2::new(direction.x, direction.y) / (direction.z + 0.12) * 1.3
            + Vec2::new(frame.eye.x, frame.eye.y) * 2e-4;
        let n = noise::value(p, 1)
            + 0.5 * noise::value(p * 2.1, 2)
            + 0.25 * noise::value(p * 4.3, 3)
            + 0.12 * noise::value(p * 8.9, 4);
        let cover = noise::smoothstep(0.75 - 1.1 * light.cloud_cover, 1.35 - 0.9 * light.cloud_cover, n);
        let cover = cover * noise::smoothstep(0.01, 0.14, direction.z);
        let bright = light.sky_lux() * (0.42 / PI)
            + light.sun_illuminance * (0.10 * (1.0 + 0.5 * direction.dot(light.sun_direction)));
        let closed = light.sky_luminance(direction) * (0.9 + 0.12 * n);
        sky = if light.cloud_cover >= 1.0 { closed } else { sky.lerp(bright, 0.85 * cover) };
    }
    // The drawn disk is 100 times less bright than the real disk. Otherwise a single sample would be far brighter than
    // its surroundings.
    let disc = noise::smoothstep(0.99985, 0.99998, direction.dot(light.sun_direction));
    sky + light.sun_illuminance * (12.0 * disc)
}

/// Adds daylight that is scattered toward the camera along the line of sight. The part of the line of sight inside the
/// tunnel adds no light.
fn add_haze(frame: &SceneInstant, out: Vec3, direction: Vec3, distance: f32) -> Vec3 {
    let light = &frame.scene.light;
    let air = (distance - frame.tunnel_view_m).max(0.0);
    let clear = libm::expf(-air / light.haze_length_m);
    let flat = Vec3::new(direction.x, direction.y, direction.z.max(0.0) * 0.3 + 0.03).normalize_or_zero();
    out * clear + light.sky_luminance(flat) * (1.0 - clear)
}

/// Returns the fraction that the tunnel lamps contribute to the ambient light at a fragment.
fn tunnel_share(frame: &SceneInstant, f: &Fragment) -> f32 {
    let city = &frame.scene.city;
    if city.tunnel.is_none() {
        return 0.0;
    }
    match f.material {
        Material::Tunnel | Material::TunnelLamp => 1.0,
        Material::Road | Material::Curb | Material::Sidewalk => city.tunnel_share(f64::from(f.spot.uv.x)),
        _ => frame.parts[f.part].vehicle.map_or(0.0, |v| frame.vehicles[v as usize].tunnel),
    }
}

/// Returns the fraction of the light of the street that reaches a fragment in the tunnel through the portals.
fn portal_share(frame: &SceneInstant, f: &Fragment) -> f32 {
    let city = &frame.scene.city;
    if city.tunnel.is_none() {
        return 0.0;
    }
    match f.material {
        Material::Tunnel | Material::Road | Material::Curb | Material::Sidewalk => {
            city.portal_share(f64::from(f.spot.uv.x))
        }
        _ => frame.parts[f.part].vehicle.map_or(0.0, |v| frame.vehicles[v as usize].portal),
    }
}

/// Returns the ambient illuminance. It is the sum of skylight, light reflected by ground and facades, and light of the
/// tunnel lamps.
fn add_ambient(frame: &SceneInstant, f: &Fragment, tunnel: f32) -> Vec3 {
    let light = &frame.scene.light;
    let n = f.normal;
    let mut sky_share = match frame.parts[f.part].vehicle {
        Some(v) => f.sky * frame.vehicles[v as usize].sky * (0.5 + 0.5 * n.z),
        None => f.sky,
    };
    let contact = sky_share_under_vehicles(frame, f);
    sky_share *= contact;
    let surround = &frame.ambient;
    let glow = light.sun_glow * (0.5 * n.dot(surround.horizontal_sun_direction).max(0.0) * sky_share);
    let street = (1.0 - tunnel).max(portal_share(frame, f));
    let outside = surround.sky_lux * sky_share
        + glow
        + surround.non_sky_lux * ((1.0 - sky_share) * (0.35 + 0.65 * contact) * street);
    if tunnel == 0.0 {
        return outside;
    }
    // The lamps form two rows on the ceiling and are about 4 m apart, so their light is nearly uniform along the road.
    let facing = 0.62 + 0.38 * n.z;
    let level = light.tunnel_lux * light.lamp_level(frame.t, 0) * facing * (0.25 + 0.75 * contact);
    outside + Vec3::new(1.05, 1.0, 0.88) * (level * tunnel)
}

/// Returns the fraction of the open sky that vehicles do not hide from a point on the ground.
fn sky_share_under_vehicles(frame: &SceneInstant, f: &Fragment) -> f32 {
    if f.world.z > 0.3 || f.normal.z < 0.5 || frame.parts[f.part].vehicle.is_some() {
        return 1.0;
    }
    let mut open = 1.0f32;
    for &i in frame.near_grid.items_at(f.world.truncate()) {
        let p = &frame.vehicles[i as usize];
        let local = p.axes.transpose() * (f.world - p.origin);
        let half = p.shape.size * 0.5;
        let (x, y) = (local.x.abs() - half.x + 0.15, local.y.abs() - half.y + 0.12);
        let outside = Vec2::new(x.max(0.0), y.max(0.0)).length();
        let depth = (-x.max(y)).max(0.0);
        let cover = if outside > 0.0 {
            0.62 * libm::expf(-outside * 2.6 / p.shape.shell_half_extent.z.min(2.2))
        } else {
            0.62 + 0.33 * (depth * 2.5).min(1.0)
        };
        open = open.min(1.0 - cover);
    }
    open
}

/// Returns the fifth power in a fixed order of multiplications. The order of `f32::powi` is unspecified.
fn fifth_power(x: f32) -> f32 {
    let square = x * x;
    square * square * x
}

/// Returns the luminance of a GGX highlight for light that arrives from direction `to`.
///
/// The luminance is in cd/m2 per lux of illuminance on a surface that faces the light.
fn highlight_luminance(f: &Fragment, look: &Appearance, to: Vec3) -> f32 {
    let half = (to - f.view_direction).normalize_or_zero();
    let (nh, nl, nv) =
        (f.normal.dot(half).max(0.0), f.normal.dot(to).max(0.0), (-f.normal.dot(f.view_direction)).max(0.02));
    // The highlight is widened by the change of the normal across the pixel (Kaplanyan et al., "Filtering distributions of
    // normals for shading antialiasing", 2016). Otherwise the highlight of a curved surface could fall between pixels.
    let spread = 0.5 * f.normal_change;
    let a = (look.roughness * look.roughness).max(0.004);
    let a = (a * a + 0.5 * (spread * spread).min(0.36)).sqrt().min(1.0);
    let d = nh * nh * (a * a - 1.0) + 1.0;
    let density = a * a / (PI * d * d).max(1e-9);
    let fresnel = look.gloss + (1.0 - look.gloss) * fifth_power(1.0 - to.dot(half).clamp(0.0, 1.0));
    let k = 0.5 * a;
    let mask = 1.0 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
    // The formula is for a point light. A real lamp has a size, which limits the luminance of the highlight.
    (0.25 * density * fresnel * mask * nl).min(60.0)
}

/// Light of a street lamp at a point. Occlusion is not included.
struct LampLight {
    lamp: u16,
    direction: Vec3,
    cosine: f32,
    /// Illuminance on a surface that faces the lamp. `diffuse` is the illuminance on the actual surface.
    lux: f32,
    diffuse: f32,
}

fn lamp_light(frame: &SceneInstant, f: &Fragment, look: &Appearance, index: u16) -> Option<LampLight> {
    let light = &frame.scene.light;
    let lamp = &frame.scene.city.lamps[index as usize];
    let to = lamp.position - f.world;
    let distance = to.length();
    if !(0.05..LAMP_RANGE_M).contains(&distance) {
        return None;
    }
    let to = to / distance;
    let cosine = f.normal.dot(to);
    let through = look.transmission * 0.6 * (-cosine).max(0.0);
    // A cutoff luminaire has a wide beam downward and emits no light above the horizontal.
    let range2 = (distance / LAMP_RANGE_M).powi(2);
    let lobe = noise::smoothstep(0.0, 0.55, to.z) * (1.0 - range2 * range2);
    let level = light.lamp_cd * lamp.strength * light.lamp_level(frame.t, lamp.phase);
    let lux = level * lobe / (distance * distance);
    let diffuse = lux * (cosine.max(0.0) + through);
    (diffuse > 0.0).then_some(LampLight { lamp: index, direction: to, cosine, lux, diffuse })
}

/// Adds the light of the street lamps near the fragment. A shadow ray is traced only for lamps that provide at least
/// 7 % of the total light of these street lamps.
fn add_lamps(frame: &SceneInstant, f: &Fragment, look: &Appearance, arriving: &mut IncomingLight) {
    let scene = frame.scene;
    let place = f.world.truncate();
    let near = scene.lamp_grid.items_at(place);
    let offers: Vec<LampLight> = near.iter().filter_map(|&i| lamp_light(frame, f, look, i)).collect();
    let total: f32 = offers.iter().map(|o| o.diffuse).sum();
    for o in offers {
        let origin =
            f.world + f.facet * 0.03 + if look.transmission > 0.0 { o.direction * 0.35 } else { Vec3::ZERO };
        // A lamp with less than 7 % of the light of all near lamps counts as half visible, so most shadow rays are not
        // needed.
        let sky_share =
            if o.diffuse < 0.07 * total { 0.5 } else { lamp_visibility(frame, f, o.lamp, origin) };
        arriving.diffuse_lux += scene.light.lamp_tint * (o.diffuse * sky_share);
        if o.cosine > 0.0 && sky_share > 0.0 {
            arriving.highlight +=
                scene.light.lamp_tint * (o.lux * sky_share * highlight_luminance(f, look, o.direction));
        }
    }
}

/// Radius in meters of the penumbra of a lamp. A luminous face of 0.66 m x 0.22 m has this penumbra if an object is a
/// third of the way from the surface to the lamp.
const PENUMBRA_RADIUS_M: f32 = 0.12;

/// Returns the fraction of a lamp that is visible from `origin`.
///
/// Rays start on a circle around the point. Four rays are sufficient unless they differ.
fn lamp_visibility(frame: &SceneInstant, f: &Fragment, lamp: u16, origin: Vec3) -> f32 {
    let radius = PENUMBRA_RADIUS_M.max(0.5 * f.spot.footprint_m);
    let (u, v) = f.facet.any_orthonormal_pair();
    let position = frame.scene.city.lamps[usize::from(lamp)].position;
    let near = frame.near_grid.items_at(f.world.truncate());
    // All rays are within `radius` of the ray from the center. A vehicle near one of them is therefore near this ray.
    let (to, margin) = (position - origin, radius + 1e-3);
    let distance = to.length();
    let has_vehicle = near
        .iter()
        .any(|&i| frame.vehicles[usize::from(i)].is_near_ray(origin, to / distance, distance, margin));
    let count = |points: [(f32, f32); 4]| {
        let points = points.map(|(x, y)| origin + u * (x * radius) + v * (y * radius));
        let are_hidden = frame.scene.are_hidden_from_lamp(lamp, points);
        let is_behind_vehicle = |from: Vec3| {
            let to = position - from;
            let distance = to.length();
            frame.is_blocked_by(near, from, to / distance, (distance - POST_RADIUS_M).max(0.0))
        };
        let is_dark = |&(from, is_hidden): &(Vec3, bool)| is_hidden || has_vehicle && is_behind_vehicle(from);
        4 - points.into_iter().zip(are_hidden).filter(is_dark).count()
    };
    let outer = count([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]);
    if outer == 0 || outer == 4 {
        return if outer > 0 { 1.0 } else { 0.0 };
    }
    let inner = count([(0.4, 0.4), (-0.4, 0.4), (0.4, -0.4), (-0.4, -0.4)]);
    (outer + inner) as f32 / 8.0
}

/// Adds the light of low beams. A low beam is a bright, flat fan below the horizontal with a little stray light above.
fn add_beams(frame: &SceneInstant, f: &Fragment, look: &Appearance, arriving: &mut IncomingLight) {
    let light = &frame.scene.light;
    let tint = Vec3::new(1.03, 1.0, 0.90);
    for &i in frame.beam_grid.items_at(f.world.truncate()) {
        let beam = &frame.beams[i as usize];
        let from = f.world - beam.origin;
        let distance = from.length().max(0.5);
        let to = -from / distance;
        let along = -to.dot(beam.direction);
        let cosine = f.normal.dot(to);
        if along < 0.5 || cosine <= 0.0 {
            continue;
        }
        let across = 1.0 - along * along + to.z * to.z;
        let rise = from.z / distance - beam.direction.z;
        let fan = libm::expf(-across.max(0.0) * 14.0);
        let cut =
            0.035 + 0.965 * noise::smoothstep(0.012, -0.02, rise) * libm::expf(-(rise * 9.0) * (rise * 9.0));
        let lux = light.headlight_cd * fan * cut / (distance * distance);
        if lux * cosine < 0.02 {
            continue;
        }
        let near = frame.near_grid.items_at(f.world.truncate());
        if near.is_empty() || !frame.is_blocked_by(near, f.world + f.facet * 0.03, to, distance - 0.3) {
            arriving.diffuse_lux += tint * (lux * cosine);
            arriving.highlight += tint * (lux * highlight_luminance(f, look, to));
        }
    }
}

/// Mean of the lit rooms in reflections. A reflection that shows many rooms has this brightness.
const LIT_ROOM_SHARE: f32 = 0.08;

/// Returns the luminance of the surroundings that a reflection shows. The surroundings are a street between two rows of
/// facades under the sky.
fn reflected_environment(
    frame: &SceneInstant,
    f: &Fragment,
    direction: Vec3,
    tunnel: f32,
    rough: f32,
) -> Vec3 {
    let scene = frame.scene;
    let light = &scene.light;
    let lux = frame.ambient.sky_lux;
    // Angle in radians that the reflection in one pixel shows.
    let angle = 2.0 * f.normal_change + f.spot.footprint_m / f.distance.max(0.1);
    if tunnel > 0.5 {
        // The ceiling is about 4 m above the reflecting surface.
        let blur = 0.3 + 4.0 * angle;
        let streak = noise::smoothstep(0.55 - angle, 0.7 + angle, direction.z)
            * noise::pulses(f.world.x + direction.x * 4.0, 4.0, 0.0, 1.4, blur);
        return Vec3::new(1.05, 1.0, 0.88) * (light.tunnel_lux * (0.12 + 3.0 * streak));
    }
    let night = light.lamp_tint * (light.lamp_cd * 0.004);
    let ground = (light.sun_illuminance * (0.5 * light.sun_direction.z.max(0.0)) + lux * 0.6 + night * 2.0)
        * (0.11 / PI);
    if direction.z <= 0.0 {
        return ground;
    }
    let (height, half) = scene.city.street_canyon;
    let flat = direction.truncate().length().max(1e-4);
    let sideways = (direction.dot(frame.road_left) / flat).abs().max(0.02 + 0.6 * rough);
    let reach = (half / sideways).min(160.0);
    let at = f.world.truncate() + direction.truncate() * (reach / flat);
    let along = at.dot(Vec2::new(frame.road_left.y, -frame.road_left.x));
    // Extent in meters of the reflected facade that one pixel shows.
    let extent = (f.distance + reach) * angle;
    let skyline = height * (1.0 + 0.45 * noise::grain(Vec2::new(along, 7.0), 14.0, extent, 9));
    let climb = f.world.z + direction.z / flat * reach;
    let soft = 0.6 + 30.0 * rough + 0.5 * extent;
    let open = noise::smoothstep(-soft, soft, climb - skyline);
    let sharp = noise::fade(1.6, extent);
    let rooms = 0.5 + 0.5 * noise::grain(Vec2::new(along / 1.6, climb / 1.7), 1.0, extent / 1.6, 10);
    let lit = LIT_ROOM_SHARE + (noise::smoothstep(0.72, 0.9, rooms) - LIT_ROOM_SHARE) * sharp;
    let front = (light.sun_illuminance * 0.16 + lux * 0.36 + night)
        * (0.30 / PI)
        * (0.7 + 0.6 * (0.5 + (rooms - 0.5) * (1.0 - 2.5 * rough).max(0.0)))
        + Vec3::new(1.2, 0.95, 0.6) * (light.window_cd_m2 * 0.8 * lit);
    front.lerp(light.sky_luminance(direction), open)
}
