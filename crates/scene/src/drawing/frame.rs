//! One instant: where every rigid part is, seen from where the camera is.

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

use crate::drive::camera::Camera;
use crate::drive::motion::{Motion, Stance};
use crate::drive::vehicle::Shape;
use crate::lighting::Surround;
use crate::shapes::grid::Grid;
use crate::shapes::mesh::Mesh;
use crate::world::Scene;

/// A rigid part of the scene: the city, a vehicle's shell, or an axle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part<'a> {
    pub mesh: &'a Mesh,
    pub vehicle: Option<u32>,
    pub to_world: DAffine3,
    pub world_axes: Mat3,
    pub world_origin: Vec3,
    /// From the part's axes to the camera's.
    pub camera_axes: Mat3,
    /// The camera in the part's coordinates, in two halves: differences to it
    /// then keep single precision's digits wherever the city's origin is.
    eye: (Vec3, Vec3),
    pub hidden: bool,
}

impl Part<'_> {
    /// A point of the part in camera coordinates.
    #[inline]
    pub(crate) fn to_camera(self, local: Vec3) -> Vec3 {
        self.camera_axes * ((local - self.eye.0) - self.eye.1)
    }
}

/// A vehicle at this instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed<'a> {
    pub shape: &'a Shape,
    pub stance: Stance,
    pub axes: Mat3,
    pub origin: Vec3,
    /// The ball around it, a little larger than its box.
    pub middle: Vec3,
    pub radius: f32,
    /// Share of the sky over it, and how deep in the tunnel it is.
    pub sky: f32,
    pub tunnel: f32,
    pub drives: bool,
    pub braking: bool,
}

/// The headlights of one car as one beam.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    pub from: Vec3,
    pub way: Vec3,
}

/// How far headlights are followed.
const BEAM_M: f32 = 55.0;
/// Margin around vehicles in which they darken the ground and block lamps.
const NEAR_M: f32 = 4.0;

/// Everything that shading and rasterising need at one instant.
#[derive(Debug)]
pub(crate) struct Frame<'a> {
    pub scene: &'a Scene,
    pub t: f64,
    pub camera: Camera,
    pub eye: Vec3,
    /// From the camera's axes to the world's.
    pub to_world_axes: Mat3,
    pub parts: Vec<Part<'a>>,
    pub placed: Vec<Placed<'a>>,
    /// Vehicles whose shadow of sun or moon may fall on a place of the ground.
    pub shadows: Grid,
    /// Vehicles near a place.
    pub near: Grid,
    pub beams: Vec<Beam>,
    pub lit_by: Grid,
    pub surround: Surround,
    /// Left of the road where the camera is.
    pub left: Vec3,
    /// How far the camera looks through the tunnel before it sees daylight.
    pub dark_m: f32,
}

impl<'a> Frame<'a> {
    pub(crate) fn new(scene: &'a Scene, t: f64) -> Self {
        let camera = scene.camera_unchecked(t);
        let mut frame = Self {
            scene,
            t,
            camera,
            eye: camera.pose.position.as_vec3(),
            to_world_axes: camera.pose.rotation.transpose().as_mat3(),
            parts: Vec::new(),
            placed: Vec::new(),
            shadows: Grid::default(),
            near: Grid::default(),
            beams: Vec::new(),
            lit_by: Grid::default(),
            surround: scene.light.surround(),
            left: Vec3::Y,
            dark_m: 0.0,
        };
        frame.add_part(&scene.city.mesh, None, DAffine3::IDENTITY, false);
        for i in 0..scene.traffic.vehicles.len() {
            frame.place(i, t);
        }
        frame.surroundings();
        frame.index_vehicles();
        frame.index_beams(t);
        frame
    }

    fn add_part(&mut self, mesh: &'a Mesh, vehicle: Option<u32>, to_world: DAffine3, hidden: bool) {
        let pose = self.camera.pose;
        let eye = to_world.inverse().transform_point3(pose.position);
        let high = eye.as_vec3();
        let low = (eye - high.as_dvec3()).as_vec3();
        self.parts.push(Part {
            mesh,
            vehicle,
            to_world,
            world_axes: to_world.matrix3.as_mat3(),
            world_origin: to_world.translation.as_vec3(),
            camera_axes: (pose.rotation * to_world.matrix3).as_mat3(),
            eye: (high, low),
            hidden,
        });
    }

    fn place(&mut self, index: usize, t: f64) {
        let scene = self.scene;
        let vehicle = &scene.traffic.vehicles[index];
        let stance = scene.stance(&vehicle.motion, t);
        let shape = &scene.traffic.shapes[vehicle.shape];
        let to_world = stance.to_world();
        let id = Some(index as u32);
        for (mesh, to_vehicle) in shape.parts(stance.rolled_m) {
            self.add_part(mesh, id, to_world * to_vehicle, stance.gone);
        }
        let (s, d) = scene.city.road.locate(stance.at.x as f32, stance.at.y as f32);
        let drives = matches!(vehicle.motion, Motion::Lane { .. });
        let before = if drives { scene.stance(&vehicle.motion, (t - 0.1).max(0.0)).speed } else { 0.0 };
        let on_road = d.abs() < scene.city.road.half_m() + 2.0;
        let (axes, origin) = (to_world.matrix3.as_mat3(), to_world.translation.as_vec3());
        self.placed.push(Placed {
            shape,
            stance,
            axes,
            origin,
            middle: origin + axes.z_axis * (0.5 * shape.size.z),
            radius: (shape.size * 0.5).length() + 0.1,
            sky: if on_road { scene.city.sky_at(s) } else { 0.7 },
            tunnel: scene.city.tunnel_share(s),
            drives,
            braking: drives && before - stance.speed > 0.05,
        });
    }

    fn surroundings(&mut self) {
        let city = &self.scene.city;
        let (s, _) = city.road.locate(self.eye.x, self.eye.y);
        let t = city.road.tangent(s);
        self.left = Vec3::new(-t.y as f32, t.x as f32, 0.0);
        self.dark_m = city.tunnel.filter(|&(a, b)| s > a && s < b).map_or(0.0, |(_, b)| (b - s) as f32);
    }

    fn index_vehicles(&mut self) {
        let sun = self.scene.light.sun_way;
        let (mut near, mut shadows) = (Vec::new(), Vec::new());
        for (i, p) in self.placed.iter().enumerate().filter(|(_, p)| !p.stance.gone) {
            let half = p.shape.size * 0.5;
            let reach = Vec2::new(
                (p.axes.x_axis.x * half.x).abs() + (p.axes.y_axis.x * half.y).abs(),
                (p.axes.x_axis.y * half.x).abs() + (p.axes.y_axis.y * half.y).abs(),
            );
            let at = p.origin.truncate();
            near.push((at - reach - NEAR_M, at + reach + NEAR_M, i as u16));
            // The roof's shadow falls this far away from the sun.
            let fall = -sun.truncate() / sun.z.max(0.05) * p.shape.size.z;
            let (a, b) = (at.min(at + fall), at.max(at + fall));
            shadows.push((a - reach, b + reach, i as u16));
        }
        self.near = Grid::new(6.0, &near);
        self.shadows = Grid::new(6.0, &shadows);
    }

    fn index_beams(&mut self, t: f64) {
        if self.scene.light.headlight_cd == 0.0 {
            return;
        }
        let ego = self.scene.stance(&self.scene.traffic.ego, t);
        let axes = ego.to_world();
        let beam = |axes: DAffine3, ahead: f64| Beam {
            from: axes.transform_point3(DVec3::new(ahead, 0.0, 0.68)).as_vec3(),
            way: axes.transform_vector3(DVec3::new(1.0, 0.0, -0.02)).as_vec3().normalize(),
        };
        self.beams.push(beam(axes, 2.2));
        for p in self.placed.iter().filter(|p| p.drives && !p.stance.gone) {
            let b = beam(p.stance.to_world(), f64::from(p.shape.half.x) + 0.05);
            if b.from.distance(self.eye) < 260.0 {
                self.beams.push(b);
            }
        }
        let things: Vec<(Vec2, Vec2, u16)> = self
            .beams
            .iter()
            .enumerate()
            .map(|(i, b)| {
                let (p, q) = (b.from.truncate(), (b.from + b.way * BEAM_M).truncate());
                (p.min(q) - 14.0, p.max(q) + 14.0, i as u16)
            })
            .collect();
        self.lit_by = Grid::new(10.0, &things);
    }

    /// True when a vehicle of `list` lies between `origin` and `origin + max way`.
    pub(crate) fn blocked_by(&self, list: &[u16], origin: Vec3, way: Vec3, max: f32) -> bool {
        list.iter().map(|&i| &self.placed[usize::from(i)]).filter(|p| p.is_near(origin, way, max)).any(|p| {
            let from = p.axes.transpose() * (origin - p.origin);
            let to = p.axes.transpose() * way;
            let middle = Vec3::Z * (0.5 * p.shape.size.z);
            let half = p.shape.size * 0.5 + 0.02;
            hits_box(from - middle, to, half, max) && p.shape.bvh.blocked(from, to, 0.0, max)
        })
    }
}

impl Placed<'_> {
    /// Whether a ray passes through the ball around the vehicle. Most rays do not, and this asks least of each.
    fn is_near(&self, origin: Vec3, way: Vec3, max: f32) -> bool {
        let to = self.middle - origin;
        let along = to.dot(way).clamp(0.0, max);
        (to - way * along).length_squared() <= self.radius * self.radius
    }
}

/// Slab test of a ray against a box about the origin.
fn hits_box(from: Vec3, way: Vec3, half: Vec3, max: f32) -> bool {
    let inverse = Vec3::ONE / way;
    let (a, b) = ((-half - from) * inverse, (half - from) * inverse);
    let (near, far) = (a.min(b), a.max(b));
    near.max_element().max(0.0) <= far.min_element().min(max)
}
