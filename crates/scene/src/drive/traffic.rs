//! The traffic of a scene. The traffic consists of moving cars in lanes, parked cars, cars that wait in side streets,
//! and the camera's own car.
//!
//! Cars never change lanes, and the car-following model (`car_following.rs`) keeps a distance between the cars of a
//! lane. Therefore cars do not collide. The motion of all cars is integrated once for the whole drive, when the scene
//! is built.

use glam::{DVec2, Vec3};

use super::car_following::{Driver, insert_ego, integrate_lane};
use super::road::Road;
use super::traffic_vehicle::Vehicle;
use super::vehicle_model::{VehicleClass, VehicleModel};
use super::vehicle_motion::{VehicleMotion, vehicle_state};
use crate::random::Draws;

/// All traffic of a scene.
#[derive(Debug)]
pub(crate) struct Traffic {
    pub shapes: Vec<VehicleModel>,
    pub vehicles: Vec<Vehicle>,
    pub ego: VehicleMotion,
}

/// Properties of the traffic that the caller requests.
pub(crate) struct TrafficOptions {
    pub ego_mps: f64,
    pub duration_s: f64,
    pub cars: Option<u32>,
    pub span: (f64, f64),
    pub tunnel: bool,
}

const PAINT_ALBEDOS: [[f32; 3]; 12] = [
    [0.70, 0.70, 0.68],
    [0.75, 0.75, 0.74],
    [0.02, 0.02, 0.022],
    [0.03, 0.03, 0.035],
    [0.32, 0.33, 0.34],
    [0.15, 0.155, 0.165],
    [0.42, 0.03, 0.03],
    [0.03, 0.08, 0.30],
    [0.05, 0.12, 0.20],
    [0.30, 0.26, 0.20],
    [0.04, 0.14, 0.07],
    [0.62, 0.32, 0.03],
];

impl Traffic {
    /// Places vehicles on `road`. At t = 0, the camera's car is at s = 0.
    pub(crate) fn from_seed(seed: u64, road: &Road, demand: &TrafficOptions) -> Self {
        let draws = Draws::new(seed, "traffic");
        let classes = [
            (VehicleClass::Sedan, 6u64),
            (VehicleClass::Van, 2),
            (VehicleClass::Bus, 1),
            (VehicleClass::Truck, 2),
        ];
        let shapes = classes
            .iter()
            .flat_map(|&(class, n)| {
                (0..n).map(move |i| VehicleModel::from_draws(class, draws.item(100 + i).item(class as u64)))
            })
            .collect();
        let mut traffic = Self {
            shapes,
            vehicles: Vec::new(),
            ego: VehicleMotion::Parked { at: DVec2::ZERO, heading: 0.0 },
        };
        let ego_lane = draws.index_below(1, road.lanes);
        for forward in [true, false] {
            for lane in 0..road.lanes {
                let is_ego_lane = forward && lane == ego_lane;
                traffic.fill_lane(
                    draws.item(10 + lane as u64 * 2 + u64::from(forward)),
                    road,
                    demand,
                    (lane, forward, is_ego_lane),
                );
            }
        }
        if !demand.tunnel {
            traffic.add_parked_cars(draws.item(20), road, demand);
            traffic.add_waiting_cars(draws.item(30), road);
        }
        traffic.limit_vehicles(road, demand);
        traffic
    }

    fn vehicle(&self, draws: Draws, motion: VehicleMotion, parked: bool) -> Vehicle {
        let share = draws.unit(90);
        let class = match share {
            _ if parked && share < 0.88 => VehicleClass::Sedan,
            _ if parked => VehicleClass::Van,
            x if x < 0.70 => VehicleClass::Sedan,
            x if x < 0.84 => VehicleClass::Van,
            x if x < 0.91 => VehicleClass::Bus,
            _ => VehicleClass::Truck,
        };
        let models: Vec<usize> = (0..self.shapes.len()).filter(|&i| self.shapes[i].class == class).collect();
        let paint = Vec3::from(PAINT_ALBEDOS[draws.index_below(91, PAINT_ALBEDOS.len())]);
        Vehicle {
            shape: models[draws.index_below(92, models.len())],
            paint,
            motion,
            seed: draws.bits(93) as u32,
        }
    }

    /// Fills one lane with vehicles and integrates their motion. Positions increase in the direction of travel of the
    /// lane.
    fn fill_lane(
        &mut self,
        draws: Draws,
        road: &Road,
        demand: &TrafficOptions,
        (lane, forward, is_ego_lane): (usize, bool, bool),
    ) {
        let limit = if lane == 0 { 1.05 } else { 0.92 } * demand.ego_mps;
        let (low, high) = if forward { demand.span } else { (-demand.span.1, -demand.span.0) };
        let mut drivers: Vec<Driver> = Vec::new();
        let mut s = low + draws.range(0, 5.0, 40.0);
        let mut i = 0u64;
        while s < high - 20.0 {
            let draw = draws.item(i);
            i += 1;
            let wish = limit * draw.range(0, 0.9, 1.1);
            let vehicle = self.vehicle(draw, VehicleMotion::Parked { at: DVec2::ZERO, heading: 0.0 }, false);
            let length = f64::from(self.shapes[vehicle.shape].size.x);
            drivers.push(Driver { s, v: limit * 0.95, desired_speed: wish, length, vehicle: Some(vehicle) });
            s += length + 6.0 + limit * draw.range(1, 0.8, 3.2);
        }
        let ego = is_ego_lane.then(|| insert_ego(&mut drivers, demand.ego_mps));
        let mut tracks = integrate_lane(&mut drivers, demand.duration_s);
        if let Some(index) = ego {
            let shift = tracks[index].at(0.0).0;
            tracks.iter_mut().for_each(|t| t.shift(-shift));
        }
        let d = road.lane_offset(lane, forward);
        for (driver, track) in drivers.into_iter().zip(tracks) {
            let phase = driver.vehicle.as_ref().map_or(0.3, |v| f64::from(v.seed % 1000) * 6.28e-3);
            let motion = VehicleMotion::Lane { track, d, forward, phase };
            match driver.vehicle {
                Some(v) => self.vehicles.push(Vehicle { motion, ..v }),
                None => self.ego = motion,
            }
        }
    }

    fn add_parked_cars(&mut self, draws: Draws, road: &Road, demand: &TrafficOptions) {
        if road.parking_m == 0.0 {
            return;
        }
        let density = draws.range(0, 0.3, 0.85);
        for side in [-1.0, 1.0] {
            let (mut s, mut i) = (demand.span.0 + 10.0, 0u64);
            while s < demand.span.1 - 10.0 {
                let draw = draws.item(if side > 0.0 { 1 } else { 2 }).item(i);
                i += 1;
                let still = VehicleMotion::Parked { at: DVec2::ZERO, heading: 0.0 };
                let vehicle = self.vehicle(draw, still, true);
                let length = f64::from(self.shapes[vehicle.shape].size.x);
                let middle = s + 0.5 * length;
                s += length + draw.range(0, 0.7, 2.5);
                if !draw.chance(1, density) || road.in_junction(middle, 0.5 * length + 5.0) {
                    continue;
                }
                let d = side * (road.half_width_m() - 0.5 * road.parking_m + draw.range(2, 0.0, 0.12));
                let along = if side * road.driving_side < 0.0 { 0.0 } else { std::f64::consts::PI };
                let heading = road.heading(middle) + along + draw.range(3, -0.02, 0.02);
                let motion = VehicleMotion::Parked { at: road.point(middle, d), heading };
                self.vehicles.push(Vehicle { motion, ..vehicle });
            }
        }
    }

    fn add_waiting_cars(&mut self, draws: Draws, road: &Road) {
        for (i, junction) in road.junctions.iter().enumerate() {
            for side in [-1.0, 1.0] {
                let draw = draws.item(i as u64 * 2 + u64::from(side > 0.0));
                if !draw.chance(0, 0.6) {
                    continue;
                }
                let vehicle =
                    self.vehicle(draw, VehicleMotion::Parked { at: DVec2::ZERO, heading: 0.0 }, true);
                let half = 0.5 * f64::from(self.shapes[vehicle.shape].size.x);
                let along = road.tangent(junction.s).perp() * side;
                let across = road.tangent(junction.s) * (side * road.driving_side);
                let at = road.point(junction.s, 0.0)
                    + along * (road.half_width_m() + road.sidewalk_m + 1.8 + half)
                    + across * (0.5 * junction.half_width_m);
                let heading = libm::atan2(-along.y, -along.x);
                self.vehicles.push(Vehicle { motion: VehicleMotion::Parked { at, heading }, ..vehicle });
            }
        }
    }

    /// Removes vehicles until at most `demand.cars` vehicles remain. Vehicles behind the camera are removed first, and
    /// then the vehicles that are farthest from the camera.
    fn limit_vehicles(&mut self, road: &Road, demand: &TrafficOptions) {
        let Some(cars) = demand.cars else { return };
        let ego = vehicle_state(road, &self.ego, 0.0, demand.span).position;
        let ahead = road.tangent(0.0);
        let rank = |v: &Vehicle| {
            let to = vehicle_state(road, &v.motion, 0.0, demand.span).position - ego;
            let forward = to.dot(ahead);
            to.length() + if forward < 4.0 { 1e4 } else { 0.0 }
        };
        let mut order: Vec<(f64, usize)> =
            self.vehicles.iter().enumerate().map(|(i, v)| (rank(v), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order.truncate(cars as usize);
        let mut keep: Vec<usize> = order.into_iter().map(|(_, i)| i).collect();
        keep.sort_unstable();
        self.vehicles = keep.into_iter().map(|i| self.vehicles[i].clone()).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::super::vehicle_motion::VehicleState;
    use super::*;
    use crate::drive::traffic_vehicle::EGO_LENGTH_M;

    fn drive_of(seed: u64) -> (Road, Traffic, (f64, f64)) {
        let span = (-120.0, 600.0);
        let road = Road::from_seed(seed, span.0, span.1, false);
        let demand = TrafficOptions { ego_mps: 22.0, duration_s: 6.0, cars: None, span, tunnel: false };
        let traffic = Traffic::from_seed(seed, &road, &demand);
        (road, traffic, span)
    }

    /// Returns whether the rectangles of two vehicles overlap, seen from above. The test compares the projections of
    /// both rectangles onto the axes of each rectangle (separating axis test).
    fn overlap(a: (VehicleState, DVec2), b: (VehicleState, DVec2)) -> bool {
        let axes = |s: &VehicleState| {
            let (sin, cos) = s.heading.sin_cos();
            [DVec2::new(cos, sin), DVec2::new(-sin, cos)]
        };
        let reach = |(s, half): &(VehicleState, DVec2), n: DVec2| {
            let [x, y] = axes(s);
            half.x * x.dot(n).abs() + half.y * y.dot(n).abs()
        };
        axes(&a.0)
            .into_iter()
            .chain(axes(&b.0))
            .all(|n| (a.0.position - b.0.position).dot(n).abs() < reach(&a, n) + reach(&b, n))
    }

    #[test]
    fn no_vehicles_collide_during_a_drive() {
        for seed in 0..4 {
            let (road, traffic, span) = drive_of(seed);
            for step in 0..=12 {
                let t = 0.5 * f64::from(step);
                let mut boxes: Vec<(VehicleState, DVec2)> = traffic
                    .vehicles
                    .iter()
                    .map(|v| {
                        let size = traffic.shapes[v.shape].size;
                        let half = DVec2::new(f64::from(size.x), f64::from(size.y)) * 0.5;
                        (vehicle_state(&road, &v.motion, t, span), half)
                    })
                    .filter(|(s, _)| !s.is_outside)
                    .collect();
                boxes
                    .push((vehicle_state(&road, &traffic.ego, t, span), DVec2::new(0.5 * EGO_LENGTH_M, 0.9)));
                for i in 0..boxes.len() {
                    for j in 0..i {
                        let (a, b) = (boxes[i], boxes[j]);
                        assert!(!overlap(a, b), "seed {seed} t {t}: {a:?} {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn wheels_touch_the_road_and_roll_without_slipping() {
        let (road, traffic, span) = drive_of(9);
        let rim_gap = 1.0 - (std::f64::consts::PI / 24.0).cos();
        for v in &traffic.vehicles {
            let shape = &traffic.shapes[v.shape];
            let stance = vehicle_state(&road, &v.motion, 2.0, span);
            if stance.is_outside {
                continue;
            }
            for (mesh, to_vehicle) in shape.parts(stance.rolled_m).skip(1) {
                let low = mesh
                    .vertices
                    .iter()
                    .map(|p| to_vehicle.transform_point3(p.position.as_dvec3()).z)
                    .fold(f64::MAX, f64::min);
                // A tire is a polygon with 24 sides, so either a corner or a flat side touches the road.
                let gap = rim_gap * f64::from(shape.wheel_radius_m) + 1e-6;
                assert!((-1e-6..=gap).contains(&low), "wheel at {low} m");
            }
            let later = vehicle_state(&road, &v.motion, 2.001, span);
            let rolled = later.rolled_m - stance.rolled_m;
            // A driver sways within the lane, which makes the path longer by at most 0.5 %.
            assert!((rolled - later.position.distance(stance.position)).abs() < 0.006 * rolled.abs() + 1e-6);
        }
    }

    #[test]
    fn the_camera_starts_at_the_origin_and_drives() {
        let (road, traffic, span) = drive_of(2);
        let start = vehicle_state(&road, &traffic.ego, 0.0, span);
        assert!((start.position - road.point(0.0, 0.0)).length() < 12.0);
        let end = vehicle_state(&road, &traffic.ego, 6.0, span);
        assert!(end.position.distance(start.position) > 60.0);
    }
}
