//! Light that leaves a surface point towards the camera, in cd/m2.

use glam::{Vec2, Vec3};

use super::fragment::{Bare, Fragment};
use super::frame::Frame;
use super::texture;
use super::texture::Look;
use super::texture::noise;
use crate::lighting::LAMP_REACH_M;
use crate::shapes::lampward::POST_M;
use crate::shapes::material::Material;

const PI: f32 = std::f32::consts::PI;

/// True where the sun (or moon) shines on a point unhindered.
pub(crate) fn sees_sun(frame: &Frame, p: &Bare) -> bool {
    let sun = frame.scene.light.sun_way;
    if !p.leaf && p.facet.dot(sun) <= 0.0 {
        return false;
    }
    // Leaves look past their own tuft.
    let origin = p.world + if p.leaf { sun * 0.35 } else { p.facet * 0.03 };
    if frame.scene.sunward().blocked(origin, 400.0) {
        return false;
    }
    // Where the shadow of this point would fall tells who might cast one on it.
    let ground = origin.truncate() - sun.truncate() * (origin.z / sun.z.max(0.05));
    !frame.blocked_by(frame.shadows.at(ground), origin, sun, 200.0)
}

/// Light that reaches a surface: diffuse illuminance and the highlights.
struct Arriving {
    lux: Vec3,
    glint: Vec3,
}

/// The luminance of a fragment, `sun` being the visible share of the sun.
pub(crate) fn shade(frame: &Frame, f: &Fragment, sun: f32) -> Vec3 {
    let scene = frame.scene;
    let light = &scene.light;
    let look = texture::look(f.material, &f.spot, &scene.city, light);
    let tunnel = tunnel_share(frame, f);
    let mut arriving = Arriving { lux: ambient(frame, f, tunnel), glint: Vec3::ZERO };
    if sun > 0.0 {
        let cosine = f.normal.dot(light.sun_way);
        let through = look.through * 0.6 * (-cosine).max(0.0);
        arriving.lux += light.sun * (sun * (cosine.max(0.0) + through));
        if cosine > 0.0 {
            arriving.glint += light.sun * (sun * glint(f, &look, light.sun_way));
        }
    }
    if light.lamp_cd > 0.0 {
        lamps(frame, f, &look, &mut arriving);
    }
    if light.headlight_cd > 0.0 {
        beams(frame, f, &look, &mut arriving);
    }
    let cosine = (-f.normal.dot(f.way)).clamp(0.0, 1.0);
    let fresnel = look.gloss + (1.0 - look.gloss) * (1.0 - look.rough) * (1.0 - cosine).powi(5);
    let clear = (1.0 - look.rough) * (1.0 - look.rough);
    let mut out = look.albedo * arriving.lux * (1.0 / PI) + arriving.glint + look.emission;
    if fresnel * clear > 0.002 {
        let way = f.way - f.normal * (2.0 * f.way.dot(f.normal));
        out = out * (1.0 - fresnel * clear)
            + environment(frame, f, way, tunnel, look.rough) * (fresnel * clear);
    }
    haze(frame, out, f.way, f.distance)
}

/// What is behind everything.
pub(crate) fn sky(frame: &Frame, way: Vec3) -> Vec3 {
    let light = &frame.scene.light;
    let mut sky = light.sky(way);
    if light.clouds > 0.0 && way.z > 0.01 {
        let p = Vec2::new(way.x, way.y) / (way.z + 0.12) * 1.3 + Vec2::new(frame.eye.x, frame.eye.y) * 2e-4;
        let n = noise::value(p, 1)
            + 0.5 * noise::value(p * 2.1, 2)
            + 0.25 * noise::value(p * 4.3, 3)
            + 0.12 * noise::value(p * 8.9, 4);
        let cover = noise::smooth(0.75 - 1.1 * light.clouds, 1.35 - 0.9 * light.clouds, n);
        let cover = cover * noise::smooth(0.01, 0.14, way.z);
        let bright =
            light.sky_lux() * (0.42 / PI) + light.sun * (0.10 * (1.0 + 0.5 * way.dot(light.sun_way)));
        let closed = light.sky(way) * (0.9 + 0.12 * n);
        sky = if light.clouds >= 1.0 { closed } else { sky.lerp(bright, 0.85 * cover) };
    }
    // The sun's own disc, a hundred times dimmed so that no sample becomes a beacon.
    let disc = noise::smooth(0.99985, 0.99998, way.dot(light.sun_way));
    sky + light.sun * (12.0 * disc)
}

/// Daylight scattered into the line of sight; a stretch inside the tunnel adds none.
fn haze(frame: &Frame, out: Vec3, way: Vec3, distance: f32) -> Vec3 {
    let light = &frame.scene.light;
    let air = (distance - frame.dark_m).max(0.0);
    let clear = libm::expf(-air / light.haze_m);
    let flat = Vec3::new(way.x, way.y, way.z.max(0.0) * 0.3 + 0.03).normalize_or_zero();
    out * clear + light.sky(flat) * (1.0 - clear)
}

/// How much of the light at a fragment is the tunnel's.
fn tunnel_share(frame: &Frame, f: &Fragment) -> f32 {
    let city = &frame.scene.city;
    if city.tunnel.is_none() {
        return 0.0;
    }
    match f.material {
        Material::Tunnel | Material::TunnelLamp => 1.0,
        Material::Road | Material::Kerb | Material::Pavement => city.tunnel_share(f64::from(f.spot.uv.x)),
        _ => frame.parts[f.part].vehicle.map_or(0.0, |v| frame.placed[v as usize].tunnel),
    }
}

/// Skylight, its bounce from ground and fronts, and the tunnel's lamps.
fn ambient(frame: &Frame, f: &Fragment, tunnel: f32) -> Vec3 {
    let light = &frame.scene.light;
    let n = f.normal;
    let mut seen = match frame.parts[f.part].vehicle {
        Some(v) => f.sky * frame.placed[v as usize].sky * (0.5 + 0.5 * n.z),
        None => f.sky,
    };
    let contact = under_vehicles(frame, f);
    seen *= contact;
    let surround = &frame.surround;
    let glow = light.glow * (0.5 * n.dot(surround.sun_side).max(0.0) * seen);
    let outside = surround.sky_lux * seen
        + glow
        + surround.around * ((1.0 - seen) * (0.35 + 0.65 * contact) * (1.0 - tunnel));
    if tunnel == 0.0 {
        return outside;
    }
    // Lamps stand in two rows overhead, four metres apart: nearly even along the road.
    let facing = 0.62 + 0.38 * n.z;
    let level = light.tunnel_lux * light.lamp_level(frame.t, 0) * facing * (0.25 + 0.75 * contact);
    outside + Vec3::new(1.05, 1.0, 0.88) * (level * tunnel)
}

/// What vehicles leave of the open sky on the ground around them.
fn under_vehicles(frame: &Frame, f: &Fragment) -> f32 {
    if f.world.z > 0.3 || f.normal.z < 0.5 || frame.parts[f.part].vehicle.is_some() {
        return 1.0;
    }
    let mut open = 1.0f32;
    for &i in frame.near.at(f.world.truncate()) {
        let p = &frame.placed[i as usize];
        let local = p.axes.transpose() * (f.world - p.origin);
        let half = p.shape.size * 0.5;
        let (x, y) = (local.x.abs() - half.x + 0.15, local.y.abs() - half.y + 0.12);
        let outside = Vec2::new(x.max(0.0), y.max(0.0)).length();
        let depth = (-x.max(y)).max(0.0);
        let cover = if outside > 0.0 {
            0.62 * libm::expf(-outside * 2.6 / p.shape.half.z.min(2.2))
        } else {
            0.62 + 0.33 * (depth * 2.5).min(1.0)
        };
        open = open.min(1.0 - cover);
    }
    open
}

/// A GGX highlight's luminance for one lux times cosine from `to`.
fn glint(f: &Fragment, look: &Look, to: Vec3) -> f32 {
    let half = (to - f.way).normalize_or_zero();
    let (nh, nl, nv) =
        (f.normal.dot(half).max(0.0), f.normal.dot(to).max(0.0), (-f.normal.dot(f.way)).max(0.02));
    let a = (look.rough * look.rough).max(0.004);
    let d = nh * nh * (a * a - 1.0) + 1.0;
    let spread = a * a / (PI * d * d).max(1e-9);
    let fresnel = look.gloss + (1.0 - look.gloss) * (1.0 - to.dot(half).clamp(0.0, 1.0)).powi(5);
    let k = 0.5 * a;
    let mask = 1.0 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
    // No lamp is a point: its own size keeps the highlight below this.
    (0.25 * spread * fresnel * mask * nl).min(60.0)
}

/// What a street lamp would give to a point if nothing stood between.
struct Offer {
    lamp: u16,
    to: Vec3,
    distance: f32,
    cosine: f32,
    /// Illuminance on a surface that faces the lamp, and on this one.
    lux: f32,
    diffuse: f32,
}

fn offer(frame: &Frame, f: &Fragment, look: &Look, index: u16) -> Option<Offer> {
    let light = &frame.scene.light;
    let lamp = &frame.scene.city.lamps[index as usize];
    let to = lamp.position - f.world;
    let distance = to.length();
    if !(0.05..LAMP_REACH_M).contains(&distance) {
        return None;
    }
    let to = to / distance;
    let cosine = f.normal.dot(to);
    let through = look.through * 0.6 * (-cosine).max(0.0);
    // A cut-off luminaire: wide below, nothing above the horizontal.
    let lobe = noise::smooth(0.0, 0.55, to.z) * (1.0 - (distance / LAMP_REACH_M).powi(4));
    let level = light.lamp_cd * lamp.strength * light.lamp_level(frame.t, lamp.phase);
    let lux = level * lobe / (distance * distance);
    let diffuse = lux * (cosine.max(0.0) + through);
    (diffuse > 0.0).then_some(Offer { lamp: index, to, distance, cosine, lux, diffuse })
}

/// Street lamps near the fragment; those that matter get a shadow ray each.
fn lamps(frame: &Frame, f: &Fragment, look: &Look, arriving: &mut Arriving) {
    let scene = frame.scene;
    let place = f.world.truncate();
    let near = scene.lamp_grid.at(place);
    let offers: Vec<Offer> = near.iter().filter_map(|&i| offer(frame, f, look, i)).collect();
    let total: f32 = offers.iter().map(|o| o.diffuse).sum();
    for o in offers {
        let origin = f.world + f.facet * 0.03 + if look.through > 0.0 { o.to * 0.35 } else { Vec3::ZERO };
        let reach = o.distance - POST_M;
        // Half of a faint lamp's light is a fair guess, and saves most rays.
        let seen = if o.diffuse < 0.07 * total {
            0.5
        } else if scene.hides_lamp(o.lamp, origin)
            || frame.blocked_by(frame.near.at(place), origin, o.to, reach)
        {
            0.0
        } else {
            1.0
        };
        arriving.lux += scene.light.lamp_tint * (o.diffuse * seen);
        if o.cosine > 0.0 && seen > 0.0 {
            arriving.glint += scene.light.lamp_tint * (o.lux * seen * glint(f, look, o.to));
        }
    }
}

/// Low beams: a bright flat fan below the horizontal, a little stray light above.
fn beams(frame: &Frame, f: &Fragment, look: &Look, arriving: &mut Arriving) {
    let light = &frame.scene.light;
    let tint = Vec3::new(1.03, 1.0, 0.90);
    for &i in frame.lit_by.at(f.world.truncate()) {
        let beam = &frame.beams[i as usize];
        let from = f.world - beam.from;
        let distance = from.length().max(0.5);
        let to = -from / distance;
        let along = -to.dot(beam.way);
        let cosine = f.normal.dot(to);
        if along < 0.5 || cosine <= 0.0 {
            continue;
        }
        let across = 1.0 - along * along + to.z * to.z;
        let rise = from.z / distance - beam.way.z;
        let fan = libm::expf(-across.max(0.0) * 14.0);
        let cut =
            0.035 + 0.965 * noise::smooth(0.012, -0.02, rise) * libm::expf(-(rise * 9.0) * (rise * 9.0));
        let lux = light.headlight_cd * fan * cut / (distance * distance);
        if lux * cosine < 0.02 {
            continue;
        }
        let near = frame.near.at(f.world.truncate());
        if near.is_empty() || !frame.blocked_by(near, f.world + f.facet * 0.03, to, distance - 0.3) {
            arriving.lux += tint * (lux * cosine);
            arriving.glint += tint * (lux * glint(f, look, to));
        }
    }
}

/// What a reflection sees: the street as a canyon of fronts under the sky.
fn environment(frame: &Frame, f: &Fragment, way: Vec3, tunnel: f32, rough: f32) -> Vec3 {
    let scene = frame.scene;
    let light = &scene.light;
    let lux = frame.surround.sky_lux;
    if tunnel > 0.5 {
        let streak =
            noise::smooth(0.55, 0.7, way.z) * noise::pulses(f.world.x + way.x * 4.0, 4.0, 0.0, 1.4, 0.3);
        return Vec3::new(1.05, 1.0, 0.88) * (light.tunnel_lux * (0.12 + 3.0 * streak));
    }
    let night = light.lamp_tint * (light.lamp_cd * 0.004);
    let ground = (light.sun * (0.5 * light.sun_way.z.max(0.0)) + lux * 0.6 + night * 2.0) * (0.11 / PI);
    if way.z <= 0.0 {
        return ground;
    }
    let (height, half) = scene.city.canyon;
    let flat = way.truncate().length().max(1e-4);
    let sideways = (way.dot(frame.left) / flat).abs().max(0.02 + 0.6 * rough);
    let reach = (half / sideways).min(160.0);
    let at = f.world.truncate() + way.truncate() * (reach / flat);
    let along = at.dot(Vec2::new(frame.left.y, -frame.left.x));
    let skyline = height * (1.0 + 0.45 * noise::value(Vec2::new(along / 14.0, 0.5), 9));
    let climb = f.world.z + way.z / flat * reach;
    let soft = 0.6 + 30.0 * rough;
    let open = noise::smooth(-soft, soft, climb - skyline);
    let rooms = 0.5 + 0.5 * noise::value(Vec2::new(along / 1.6, climb / 1.7), 10);
    let front = (light.sun * 0.16 + lux * 0.36 + night)
        * (0.30 / PI)
        * (0.7 + 0.6 * (0.5 + (rooms - 0.5) * (1.0 - 2.5 * rough).max(0.0)))
        + Vec3::new(1.2, 0.95, 0.6) * (light.window_cd_m2 * 0.8 * noise::smooth(0.72, 0.9, rooms));
    front.lerp(light.sky(way), open)
}
