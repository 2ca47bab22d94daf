//! Parametric vehicle models. A model consists of a lofted shell, windows, and wheels on axles.
//!
//! In the coordinates of a vehicle, x points forward, y left and z up. The origin is on the ground below the middle of
//! the vehicle's length. Small parts such as lamps, plates, door lines and wheel arches have no triangles. The body
//! material draws these parts as a texture that depends on the vehicle coordinates.

use glam::{DAffine3, DVec3, Vec2, Vec3};

use crate::random::Draws;
use crate::shapes::bvh::Bvh;
use crate::shapes::loft::{Station, loft, plain_station};
use crate::shapes::material::{Material, Semantic};
use crate::shapes::mesh::Mesh;

/// Class of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum VehicleClass {
    /// A passenger car.
    Sedan,
    /// A delivery van or minibus.
    Van,
    /// A city bus.
    Bus,
    /// A truck with a cargo box.
    Truck,
}

impl VehicleClass {
    /// Returns the semantic class.
    #[must_use]
    pub const fn semantic(self) -> Semantic {
        match self {
            Self::Sedan | Self::Van => Semantic::Car,
            Self::Bus => Semantic::Bus,
            Self::Truck => Semantic::Truck,
        }
    }

    /// Returns the name of the KITTI type. KITTI defines no type for a bus, so a bus is `Misc`.
    #[must_use]
    pub const fn kitti(self) -> &'static str {
        match self {
            Self::Sedan => "Car",
            Self::Van => "Van",
            Self::Bus => "Misc",
            Self::Truck => "Truck",
        }
    }
}

/// A vehicle model: meshes and dimensions in meters.
#[derive(Debug)]
pub(crate) struct VehicleModel {
    pub class: VehicleClass,
    /// Length, width and height of the shell with the wheels.
    pub size: Vec3,
    /// Half of the length, half of the width, and the full height of the shell without wheels. The texture uses this
    /// vector.
    pub shell_half_extent: Vec3,
    pub wheel_radius_m: f32,
    /// Positions of the axles along x, in meters.
    pub axles: Vec<f32>,
    pub shell: Mesh,
    pub axle: Mesh,
    /// Triangles of the shell and of the wheels at rest, for shadow rays.
    pub bvh: Bvh,
}

impl VehicleModel {
    /// Builds a model of `class`. The dimensions are drawn from `draws`.
    pub(crate) fn from_draws(class: VehicleClass, draws: Draws) -> Self {
        let mut shell = Mesh::default();
        let (wheel_m, axles, half) = match class {
            VehicleClass::Sedan => build_sedan(&mut shell, draws),
            VehicleClass::Van => build_van(&mut shell, draws),
            VehicleClass::Bus => build_bus(&mut shell, draws),
            VehicleClass::Truck => build_truck(&mut shell, draws),
        };
        shell.end_chunk();
        shell.bake(|_, _| 1.0);
        let mut axle = Mesh::default();
        build_wheels(&mut axle, wheel_m, half.y);
        axle.end_chunk();
        let rolled = |x: f32| axle.triangle_corners().map(move |t| t.map(|p| p + Vec3::new(x, 0.0, wheel_m)));
        let bvh = Bvh::new(
            shell.triangle_corners().chain(axles.iter().flat_map(|&x| rolled(x).collect::<Vec<_>>())),
        );
        let high = shell.vertices.iter().fold(Vec3::ZERO, |m, v| m.max(v.position.abs()));
        let size = Vec3::new(2.0 * high.x, 2.0 * high.y.max(half.y + WHEEL_PROTRUSION_M), high.z);
        Self { class, size, shell_half_extent: half, wheel_radius_m: wheel_m, axles, shell, axle, bvh }
    }
}

impl VehicleModel {
    /// Returns the rigid parts of the vehicle. The shell is first. Each part has a transform from the part's
    /// coordinates to the vehicle's coordinates.
    ///
    /// `rolled_m` is the distance that the wheels have rolled, in meters.
    pub(crate) fn parts(&self, rolled_m: f64) -> impl Iterator<Item = (&Mesh, DAffine3)> {
        let (sin, cos) = libm::sincos(rolled_m / f64::from(self.wheel_radius_m));
        let axles = self.axles.iter().map(move |&x| {
            let hub = DVec3::new(f64::from(x), 0.0, f64::from(self.wheel_radius_m));
            let rolled =
                DAffine3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos), hub);
            (&self.axle, rolled)
        });
        std::iter::once((&self.shell, DAffine3::IDENTITY)).chain(axles)
    }
}

/// Distance between the outer faces of the wheels and the shell, in meters. Without this distance, the shell would
/// hide the wheels.
const WHEEL_PROTRUSION_M: f32 = 0.012;

type Measures = (f32, Vec<f32>, Vec3);

fn build_sedan(mesh: &mut Mesh, draws: Draws) -> Measures {
    let l = draws.range_f32(0, 1.95, 2.4);
    let w = draws.range_f32(1, 0.86, 0.95);
    let h = draws.range_f32(2, 1.38, 1.72);
    // A hatchback has its rear window at the end of the body. A sedan has a trunk behind the rear window.
    let tail = if draws.chance(3, 0.5) { 0.97 } else { 0.74 };
    let (bonnet, deck) = (0.60 * h + 0.06, 0.66 * h + 0.02);
    let belt = 0.645 * h;
    let roof = 0.76 * w;
    let cowl = 0.42 * l;
    let glass = |s: Station, side: bool, top: bool| Station { has_side_glass: side, has_top_glass: top, ..s };
    let stations = [
        plain_station(l, 0.34, 0.80 * w, 0.58, 0.63, 0.70 * w),
        plain_station(l - 0.05, 0.24, 0.91 * w, 0.63, 0.70, 0.79 * w),
        plain_station(l - 0.22, 0.20, 0.97 * w, 0.68, 0.75, 0.84 * w),
        plain_station(0.70 * l, 0.19, w, bonnet - 0.08, bonnet - 0.02, 0.86 * w),
        glass(plain_station(cowl, 0.19, w, belt - 0.02, belt + 0.06, 0.88 * w), true, true),
        glass(plain_station(0.10 * l, 0.19, w, belt, h - 0.06, roof), true, false),
        glass(plain_station(-0.08 * l, 0.19, w, belt, h, roof), true, false),
        glass(plain_station(-0.34 * l, 0.19, w, belt, h - 0.03, roof), true, false),
        glass(plain_station(-0.52 * l, 0.20, w, belt + 0.01, h - 0.11, 0.98 * roof), tail > 0.9, true),
        plain_station(-tail * l, 0.22, 0.98 * w, belt + 0.02, deck + 0.04, 0.86 * w),
        plain_station(-l + 0.04, 0.26, 0.93 * w, 0.60 * h, deck, 0.84 * w),
        plain_station(-l, 0.36, 0.84 * w, 0.50 * h, 0.56 * h, 0.76 * w),
    ];
    loft(mesh, &stations, 0.05);
    let r = draws.range_f32(4, 0.30, 0.35);
    (r, vec![0.62 * l, -0.60 * l], Vec3::new(l, w, h))
}

fn build_van(mesh: &mut Mesh, draws: Draws) -> Measures {
    let l = draws.range_f32(0, 2.35, 2.95);
    let w = draws.range_f32(1, 0.95, 1.02);
    let h = draws.range_f32(2, 1.9, 2.5);
    let minibus = draws.chance(3, 0.4);
    let belt = 1.12;
    let glass = |s: Station, side: bool, top: bool| Station { has_side_glass: side, has_top_glass: top, ..s };
    let stations = [
        plain_station(l, 0.42, 0.78 * w, 0.62, 0.70, 0.70 * w),
        plain_station(l - 0.07, 0.28, 0.92 * w, 0.80, 0.90, 0.82 * w),
        plain_station(l - 0.5, 0.24, w, 1.0, 1.08, 0.88 * w),
        glass(plain_station(l - 0.85, 0.24, w, belt, 1.20, 0.90 * w), true, true),
        glass(plain_station(l - 1.65, 0.24, w, belt, h - 0.08, 0.86 * w), true, false),
        glass(plain_station(l - 2.25, 0.24, w, belt, h, 0.87 * w), minibus, false),
        glass(plain_station(-l + 0.25, 0.26, w, belt, h, 0.87 * w), false, false),
        plain_station(-l + 0.05, 0.30, 0.98 * w, belt, h - 0.06, 0.86 * w),
        plain_station(-l, 0.40, 0.95 * w, belt, h - 0.14, 0.83 * w),
    ];
    loft(mesh, &stations, 0.06);
    (0.35, vec![l - 0.9, -l + 0.95], Vec3::new(l, w, h))
}

fn build_bus(mesh: &mut Mesh, draws: Draws) -> Measures {
    let (l, w, h) = (draws.range_f32(0, 5.2, 6.0), 1.25, draws.range_f32(1, 2.9, 3.2));
    let s = |x: f32, b: f32, waist: f32, t: f32| plain_station(x, b, waist, 1.0, t, 0.94 * waist);
    let stations = [
        s(l, 0.45, 0.93 * w, h - 0.30),
        s(l - 0.08, 0.33, 0.99 * w, h - 0.10),
        s(l - 0.35, 0.30, w, h),
        s(0.0, 0.30, w, h),
        s(-l + 0.25, 0.30, w, h),
        s(-l + 0.05, 0.34, 0.99 * w, h - 0.08),
        s(-l, 0.45, 0.96 * w, h - 0.2),
    ];
    loft(mesh, &stations, 0.14);
    (0.48, vec![0.52 * l, -0.48 * l], Vec3::new(l, w, h))
}

fn build_truck(mesh: &mut Mesh, draws: Draws) -> Measures {
    let (l, w, h) = (draws.range_f32(0, 3.6, 4.8), 1.22, draws.range_f32(1, 3.1, 3.8));
    let cab = draws.range_f32(2, 2.45, 2.8);
    let s = |x: f32, b: f32, waist: f32, t: f32| plain_station(x, b, waist, 1.1, t, 0.94 * waist);
    let stations = [
        s(l, 0.50, 0.92 * w, cab - 0.45),
        s(l - 0.10, 0.38, 0.98 * w, cab - 0.15),
        s(l - 0.5, 0.36, w, cab),
        s(l - 1.75, 0.36, w, cab),
        s(l - 1.8, 0.40, 0.98 * w, cab - 0.05),
    ];
    loft(mesh, &stations, 0.12);
    mesh.begin_surface(Material::RubberTrim);
    let beam = Vec3::new(-0.1, 0.0, 0.72);
    mesh.add_box(beam, [Vec3::X * (l - 0.15), Vec3::Y * 0.45, Vec3::Z * 0.18]);
    mesh.begin_surface(Material::Cargo);
    let (front, back) = (l - 1.95, -l);
    let middle = Vec3::new(0.5 * (front + back), 0.0, 0.5 * (0.92 + h));
    mesh.add_box(middle, [Vec3::X * 0.5 * (front - back), Vec3::Y * w, Vec3::Z * 0.5 * (h - 0.92)]);
    mesh.begin_surface(Material::RubberTrim);
    let under = [(back, -w), (front, -w), (front, w), (back, w)].map(|(x, y)| Vec3::new(x, y, 0.92));
    mesh.add_quad(under, [Vec2::ZERO; 4], -Vec3::Z);
    (0.47, vec![l - 0.95, -l + 1.5], Vec3::new(l, w, h))
}

/// Adds both wheels of an axle around the center of the axle.
fn build_wheels(mesh: &mut Mesh, radius: f32, half_width: f32) {
    const SIDES: u32 = 24;
    let width = 0.62 * radius;
    mesh.begin_surface(Material::Wheel);
    for side in [-1.0f32, 1.0] {
        let (outer, inner) =
            (side * (half_width + WHEEL_PROTRUSION_M), side * (half_width + WHEEL_PROTRUSION_M - width));
        let rim = |i: u32| {
            let a = std::f32::consts::TAU * i as f32 / SIDES as f32;
            Vec3::new(libm::cosf(a), 0.0, libm::sinf(a))
        };
        let hub = mesh.add_lit_vertex(Vec3::Y * outer, Vec3::Y * side, Vec2::ZERO, 0.8);
        for i in 0..SIDES {
            let (a, b) = (rim(i), rim(i + 1));
            let at = |n: Vec3, y: f32| n * radius + Vec3::Y * y;
            let tread = [(a, outer), (b, outer), (b, inner), (a, inner)]
                .map(|(n, y)| mesh.add_lit_vertex(at(n, y), n, Vec2::new(9.0, 9.0), 0.5));
            mesh.add_quad_of(if side < 0.0 { tread } else { [tread[3], tread[2], tread[1], tread[0]] });
            let [p, q] =
                [a, b].map(|n| mesh.add_lit_vertex(at(n, outer), Vec3::Y * side, Vec2::new(n.x, n.z), 0.8));
            mesh.add_triangle(if side < 0.0 { [hub, p, q] } else { [hub, q, p] });
        }
    }
}
