//! The poses of the camera and of all rigid parts of a scene at one instant.

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

use crate::drive::camera::PinholeCamera;
use crate::drive::vehicle_model::VehicleModel;
use crate::drive::vehicle_motion::{VehicleMotion, VehicleState};
use crate::lighting::AmbientLight;
use crate::shapes::grid::Grid;
use crate::shapes::mesh::Mesh;
use crate::world::Scene;

/// A rigid part of the scene. A part is the city, the shell of a vehicle, or an axle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part<'a> {
    pub mesh: &'a Mesh,
    pub vehicle: Option<u32>,
    pub to_world: DAffine3,
    pub world_axes: Mat3,
    pub world_origin: Vec3,
    /// Rotation from the axes of the part to the axes of the camera.
    pub camera_axes: Mat3,
    /// Position of the camera in part coordinates, as the sum of two `f32` vectors.
    ///
    /// The difference between a point and the camera position has single precision at any distance from the origin of
    /// the city.
    eye_halves: (Vec3, Vec3),
    pub is_hidden: bool,
}

impl Part<'_> {
    /// Returns a point of the part in camera coordinates.
    #[inline]
    pub(crate) fn to_camera(self, local: Vec3) -> Vec3 {
        self.camera_axes * ((local - self.eye_halves.0) - self.eye_halves.1)
    }
}

/// A vehicle at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedVehicle<'a> {
    pub shape: &'a VehicleModel,
    pub state: VehicleState,
    pub axes: Mat3,
    pub origin: Vec3,
    /// Center of a bounding sphere of the vehicle. The sphere has the radius `radius`. It is slightly larger than the
    /// bounding sphere of the vehicle's box.
    pub center: Vec3,
    pub radius: f32,
    /// Fraction of the sky that is visible from the vehicle. `tunnel` is the result of `City::tunnel_share` at the
    /// position of the vehicle.
    pub sky: f32,
    pub tunnel: f32,
    /// Result of `City::portal_share` at the position of the vehicle.
    pub portal: f32,
    pub is_driving: bool,
    pub is_braking: bool,
}

/// The headlights of one car. Both headlights are combined into one beam.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    pub origin: Vec3,
    pub direction: Vec3,
}

/// Range of headlights in meters.
const HEADLIGHT_REACH_M: f32 = 55.0;
/// Size of the margin around vehicles, in meters. Inside the margin, vehicles darken the ground and occlude lamps.
const NEAR_VEHICLE_MARGIN_M: f32 = 4.0;

/// The data that rasterization and shading need at one instant.
#[derive(Debug)]
pub(crate) struct SceneInstant<'a> {
    pub scene: &'a Scene,
    pub t: f64,
    pub camera: PinholeCamera,
    pub eye: Vec3,
    /// Rotation from the camera axes to the world axes.
    pub to_world_axes: Mat3,
    pub parts: Vec<Part<'a>>,
    pub vehicles: Vec<PlacedVehicle<'a>>,
    /// For each point on the ground, the vehicles whose shadow in the light of the sun or moon may cover the point.
    pub shadow_grid: Grid,
    /// For each place on the ground, the vehicles near the place.
    pub near_grid: Grid,
    pub beams: Vec<Beam>,
    pub beam_grid: Grid,
    pub ambient: AmbientLight,
    /// Unit vector to the left of the road at the position of the camera.
    pub road_left: Vec3,
    /// Distance between the camera and the exit of the tunnel in meters. The value is 0 outside the tunnel.
    pub tunnel_view_m: f32,
    /// Distance between the camera and the entrance of a tunnel ahead in meters. The value is infinite if there is no
    /// entrance ahead.
    pub entrance_m: f32,
}

impl<'a> SceneInstant<'a> {
    pub(crate) fn new(scene: &'a Scene, t: f64) -> Self {
        Self::with_camera(scene, scene.camera_unchecked(t), t)
    }

    /// Returns the scene at time `t`, seen by another camera.
    pub(crate) fn with_camera(scene: &'a Scene, camera: PinholeCamera, t: f64) -> Self {
        let mut frame = Self {
            scene,
            t,
            camera,
            eye: camera.pose.position.as_vec3(),
            to_world_axes: camera.pose.rotation.transpose().as_mat3(),
            parts: Vec::new(),
            vehicles: Vec::new(),
            shadow_grid: Grid::default(),
            near_grid: Grid::default(),
            beams: Vec::new(),
            beam_grid: Grid::default(),
            ambient: scene.light.ambient_light(),
            road_left: Vec3::Y,
            tunnel_view_m: 0.0,
            entrance_m: f32::INFINITY,
        };
        frame.add_part(&scene.city.mesh, None, DAffine3::IDENTITY, false);
        for i in 0..scene.traffic.vehicles.len() {
            frame.place_vehicle(i, t);
        }
        frame.find_surroundings();
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
            eye_halves: (high, low),
            is_hidden: hidden,
        });
    }

    fn place_vehicle(&mut self, index: usize, t: f64) {
        let scene = self.scene;
        let vehicle = &scene.traffic.vehicles[index];
        let stance = scene.vehicle_state(&vehicle.motion, t);
        let shape = &scene.traffic.shapes[vehicle.shape];
        let to_world = stance.to_world();
        let id = Some(index as u32);
        for (mesh, to_vehicle) in shape.parts(stance.rolled_m) {
            self.add_part(mesh, id, to_world * to_vehicle, stance.is_outside);
        }
        let (s, d) = vehicle.motion.lane_place(t).unwrap_or(scene.parked_places[index]);
        let drives = matches!(vehicle.motion, VehicleMotion::Lane { .. });
        let before =
            if drives { scene.vehicle_state(&vehicle.motion, (t - 0.1).max(0.0)).speed } else { 0.0 };
        let on_road = d.abs() < scene.city.road.half_width_m() + 2.0;
        let (axes, origin) = (to_world.matrix3.as_mat3(), to_world.translation.as_vec3());
        self.vehicles.push(PlacedVehicle {
            shape,
            state: stance,
            axes,
            origin,
            center: origin + axes.z_axis * (0.5 * shape.size.z),
            radius: (shape.size * 0.5).length() + 0.1,
            sky: if on_road { scene.city.sky_at(s) } else { 0.7 },
            tunnel: scene.city.tunnel_share(s),
            portal: scene.city.portal_share(s),
            is_driving: drives,
            is_braking: drives && before - stance.speed > 0.05,
        });
    }

    fn find_surroundings(&mut self) {
        let city = &self.scene.city;
        let (s, _) = city.road.locate(self.eye.x, self.eye.y);
        let t = city.road.tangent(s);
        self.road_left = Vec3::new(-t.y as f32, t.x as f32, 0.0);
        self.tunnel_view_m =
            city.tunnel.filter(|&(a, b)| s > a && s < b).map_or(0.0, |(_, b)| (b - s) as f32);
        self.entrance_m = city.tunnel.filter(|&(a, _)| s <= a).map_or(f32::INFINITY, |(a, _)| (a - s) as f32);
    }

    fn index_vehicles(&mut self) {
        let sun = self.scene.light.sun_direction;
        let (mut near, mut shadows) = (Vec::new(), Vec::new());
        for (i, p) in self.vehicles.iter().enumerate().filter(|(_, p)| !p.state.is_outside) {
            let half = p.shape.size * 0.5;
            let reach = Vec2::new(
                (p.axes.x_axis.x * half.x).abs() + (p.axes.y_axis.x * half.y).abs(),
                (p.axes.x_axis.y * half.x).abs() + (p.axes.y_axis.y * half.y).abs(),
            );
            let at = p.origin.truncate();
            near.push((at - reach - NEAR_VEHICLE_MARGIN_M, at + reach + NEAR_VEHICLE_MARGIN_M, i as u16));
            // `fall` is the horizontal displacement of the shadow of the roof, away from the sun.
            let fall = -sun.truncate() / sun.z.max(0.05) * p.shape.size.z;
            let (a, b) = (at.min(at + fall), at.max(at + fall));
            shadows.push((a - reach, b + reach, i as u16));
        }
        self.near_grid = Grid::new(6.0, &near);
        self.shadow_grid = Grid::new(6.0, &shadows);
    }

    fn index_beams(&mut self, t: f64) {
        if self.scene.light.headlight_cd == 0.0 {
            return;
        }
        let ego = self.scene.vehicle_state(&self.scene.traffic.ego, t);
        let axes = ego.to_world();
        let beam = |axes: DAffine3, ahead: f64| Beam {
            origin: axes.transform_point3(DVec3::new(ahead, 0.0, 0.68)).as_vec3(),
            direction: axes.transform_vector3(DVec3::new(1.0, 0.0, -0.02)).as_vec3().normalize(),
        };
        self.beams.push(beam(axes, 2.2));
        for p in self.vehicles.iter().filter(|p| p.is_driving && !p.state.is_outside) {
            let b = beam(p.state.to_world(), f64::from(p.shape.shell_half_extent.x) + 0.05);
            if b.origin.distance(self.eye) < 260.0 {
                self.beams.push(b);
            }
        }
        let things: Vec<(Vec2, Vec2, u16)> = self
            .beams
            .iter()
            .enumerate()
            .map(|(i, b)| {
                let (p, q) = (b.origin.truncate(), (b.origin + b.direction * HEADLIGHT_REACH_M).truncate());
                (p.min(q) - 14.0, p.max(q) + 14.0, i as u16)
            })
            .collect();
        self.beam_grid = Grid::new(10.0, &things);
    }

    /// Returns whether a vehicle of `list` lies between `origin` and `origin + max * direction`.
    pub(crate) fn is_blocked_by(&self, list: &[u16], origin: Vec3, direction: Vec3, max: f32) -> bool {
        list.iter()
            .map(|&i| &self.vehicles[usize::from(i)])
            .filter(|p| p.is_near_ray(origin, direction, max, 0.0))
            .any(|p| {
                let from = p.axes.transpose() * (origin - p.origin);
                let to = p.axes.transpose() * direction;
                let middle = Vec3::Z * (0.5 * p.shape.size.z);
                let half = p.shape.size * 0.5 + 0.02;
                intersects_box(from - middle, to, half, max) && p.shape.bvh.is_blocked(from, to, 0.0, max)
            })
    }
}

impl PlacedVehicle<'_> {
    /// Returns whether a ray is at most `margin` meters from the bounding sphere of the vehicle. This fast test rejects most
    /// rays.
    pub(crate) fn is_near_ray(&self, origin: Vec3, direction: Vec3, max: f32, margin: f32) -> bool {
        let to = self.center - origin;
        let along = to.dot(direction).clamp(0.0, max);
        let radius = self.radius + margin;
        (to - direction * along).length_squared() <= radius * radius
    }
}

/// Returns whether a ray intersects a box centered on the origin (slab test).
fn intersects_box(from: Vec3, direction: Vec3, half: Vec3, max: f32) -> bool {
    let inverse = Vec3::ONE / direction;
    let (a, b) = ((-half - from) * inverse, (half - from) * inverse);
    let (near, far) = (a.min(b), a.max(b));
    near.max_element().max(0.0) <= far.min_element().min(max)
}
