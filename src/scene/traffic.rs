//! Who drives where: lanes of cars that follow one another, parked cars,
//! cars that wait in side streets, and the camera's own car.
//!
//! Cars of a lane obey the intelligent driver model (Treiber, Hennecke and
//! Helbing, Phys. Rev. E 62, 1805, 2000), which does not collide; nobody
//! changes lanes. The drive is integrated once when the scene is built.

use glam::{DAffine3, DVec2, DVec3, Vec3};

use super::random::Draws;
use super::road::Road;
use super::vehicle::{Shape, VehicleClass};

/// Time step of the integration; positions between steps follow a cubic.
const STEP_S: f64 = 0.05;
/// Time before the start of the scene in which the traffic settles.
const SETTLE_S: f64 = 5.0;
/// Length of the camera's own car, which is not drawn.
const EGO_LENGTH_M: f64 = 4.4;

/// Arc length and speed along the road at every step.
#[derive(Clone, Debug)]
pub(super) struct Track {
    start_s: f64,
    states: Vec<(f64, f64)>,
}

impl Track {
    /// Arc length (m) and speed (m/s) at `t`.
    pub fn at(&self, t: f64) -> (f64, f64) {
        let x = ((t - self.start_s) / STEP_S).clamp(0.0, (self.states.len() - 1) as f64 - 1e-9);
        let (i, u) = (x as usize, x - x.floor());
        let ((p0, v0), (p1, v1)) = (self.states[i], self.states[i + 1]);
        let (m0, m1) = (v0 * STEP_S, v1 * STEP_S);
        let (u2, u3) = (u * u, u * u * u);
        let s = p0 * (2.0 * u3 - 3.0 * u2 + 1.0)
            + m0 * (u3 - 2.0 * u2 + u)
            + p1 * (3.0 * u2 - 2.0 * u3)
            + m1 * (u3 - u2);
        (s, v0 + (v1 - v0) * u)
    }
}

/// How a vehicle moves.
#[derive(Clone, Debug)]
pub(super) enum Motion {
    /// Along a lane; `track` runs in its own direction of travel.
    Lane {
        track: Track,
        d: f64,
        forward: bool,
        sway: f64,
    },
    /// Stands at a place with a heading.
    Still { at: DVec2, heading: f64 },
}

/// One vehicle of the scene.
#[derive(Clone, Debug)]
pub(super) struct Vehicle {
    pub shape: usize,
    pub paint: Vec3,
    pub motion: Motion,
    pub seed: u32,
}

/// Where a vehicle is and how far its wheels have rolled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stance {
    pub at: DVec2,
    pub heading: f64,
    pub rolled_m: f64,
    pub speed: f64,
    /// Outside the stretch of road that exists.
    pub gone: bool,
}

/// All traffic of a scene.
#[derive(Debug)]
pub(super) struct Traffic {
    pub shapes: Vec<Shape>,
    pub vehicles: Vec<Vehicle>,
    pub ego: Motion,
}

/// What the traffic is asked to be.
pub(super) struct Demand {
    pub ego_mps: f64,
    pub duration_s: f64,
    pub cars: Option<u32>,
    pub span: (f64, f64),
    pub tunnel: bool,
}

const PAINTS: [[f32; 3]; 12] = [
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
    /// Vehicles on `road`, the camera's car at s = 0 when t = 0.
    pub fn random(seed: u64, road: &Road, demand: &Demand) -> Self {
        let draws = Draws::new(seed, "traffic");
        let classes = [
            (VehicleClass::Sedan, 6u64),
            (VehicleClass::Van, 2),
            (VehicleClass::Bus, 1),
            (VehicleClass::Lorry, 2),
        ];
        let shapes = classes
            .iter()
            .flat_map(|&(class, n)| {
                (0..n).map(move |i| Shape::random(class, draws.of(100 + i).of(class as u64)))
            })
            .collect();
        let mut traffic = Self {
            shapes,
            vehicles: Vec::new(),
            ego: Motion::Still {
                at: DVec2::ZERO,
                heading: 0.0,
            },
        };
        let ego_lane = draws.pick(1, road.lanes);
        for forward in [true, false] {
            for lane in 0..road.lanes {
                let own = forward && lane == ego_lane;
                traffic.fill_lane(
                    draws.of(10 + lane as u64 * 2 + u64::from(forward)),
                    road,
                    demand,
                    (lane, forward, own),
                );
            }
        }
        if !demand.tunnel {
            traffic.park(draws.of(20), road, demand);
            traffic.wait_in_side_streets(draws.of(30), road);
        }
        traffic.limit(road, demand);
        traffic
    }

    fn vehicle(&self, draws: Draws, motion: Motion, parked: bool) -> Vehicle {
        let share = draws.unit(90);
        let class = match share {
            _ if parked && share < 0.88 => VehicleClass::Sedan,
            _ if parked => VehicleClass::Van,
            x if x < 0.70 => VehicleClass::Sedan,
            x if x < 0.84 => VehicleClass::Van,
            x if x < 0.91 => VehicleClass::Bus,
            _ => VehicleClass::Lorry,
        };
        let models: Vec<usize> = (0..self.shapes.len())
            .filter(|&i| self.shapes[i].class == class)
            .collect();
        let paint = Vec3::from(PAINTS[draws.pick(91, PAINTS.len())]);
        Vehicle {
            shape: models[draws.pick(92, models.len())],
            paint,
            motion,
            seed: draws.bits(93) as u32,
        }
    }

    /// Populates and drives one lane. Positions run in the lane's own direction.
    fn fill_lane(
        &mut self,
        draws: Draws,
        road: &Road,
        demand: &Demand,
        (lane, forward, own): (usize, bool, bool),
    ) {
        let limit = if lane == 0 { 1.05 } else { 0.92 } * demand.ego_mps;
        let (low, high) = if forward {
            demand.span
        } else {
            (-demand.span.1, -demand.span.0)
        };
        let mut drivers: Vec<Driver> = Vec::new();
        let mut s = low + draws.range(0, 5.0, 40.0);
        let mut i = 0u64;
        while s < high - 20.0 {
            let draw = draws.of(i);
            i += 1;
            let wish = limit * draw.range(0, 0.9, 1.1);
            let vehicle = self.vehicle(
                draw,
                Motion::Still {
                    at: DVec2::ZERO,
                    heading: 0.0,
                },
                false,
            );
            let length = f64::from(self.shapes[vehicle.shape].size.x);
            drivers.push(Driver {
                s,
                v: limit * 0.95,
                wish,
                length,
                vehicle: Some(vehicle),
            });
            s += length + 6.0 + limit * draw.range(1, 0.8, 3.2);
        }
        let ego = own.then(|| insert_ego(&mut drivers, demand.ego_mps));
        let mut tracks = drive(&mut drivers, demand.duration_s);
        if let Some(index) = ego {
            let shift = tracks[index].at(0.0).0;
            tracks
                .iter_mut()
                .for_each(|t| t.states.iter_mut().for_each(|x| x.0 -= shift));
        }
        let d = road.lane_d(lane, forward);
        for (driver, track) in drivers.into_iter().zip(tracks) {
            let sway = driver
                .vehicle
                .as_ref()
                .map_or(0.3, |v| f64::from(v.seed % 1000) * 6.28e-3);
            let motion = Motion::Lane {
                track,
                d,
                forward,
                sway,
            };
            match driver.vehicle {
                Some(v) => self.vehicles.push(Vehicle { motion, ..v }),
                None => self.ego = motion,
            }
        }
    }

    fn park(&mut self, draws: Draws, road: &Road, demand: &Demand) {
        if road.parking_m == 0.0 {
            return;
        }
        let density = draws.range(0, 0.3, 0.85);
        for side in [-1.0, 1.0] {
            let (mut s, mut i) = (demand.span.0 + 10.0, 0u64);
            while s < demand.span.1 - 10.0 {
                let draw = draws.of(if side > 0.0 { 1 } else { 2 }).of(i);
                i += 1;
                let still = Motion::Still {
                    at: DVec2::ZERO,
                    heading: 0.0,
                };
                let vehicle = self.vehicle(draw, still, true);
                let length = f64::from(self.shapes[vehicle.shape].size.x);
                let middle = s + 0.5 * length;
                s += length + draw.range(0, 0.7, 2.5);
                if !draw.chance(1, density) || road.in_junction(middle, 0.5 * length + 5.0) {
                    continue;
                }
                let d = side * (road.half_m() - 0.5 * road.parking_m + draw.range(2, 0.0, 0.12));
                let along = if side * road.hand < 0.0 {
                    0.0
                } else {
                    std::f64::consts::PI
                };
                let heading = road.heading(middle) + along + draw.range(3, -0.02, 0.02);
                let motion = Motion::Still {
                    at: road.point(middle, d),
                    heading,
                };
                self.vehicles.push(Vehicle { motion, ..vehicle });
            }
        }
    }

    fn wait_in_side_streets(&mut self, draws: Draws, road: &Road) {
        for (i, junction) in road.junctions.iter().enumerate() {
            for side in [-1.0, 1.0] {
                let draw = draws.of(i as u64 * 2 + u64::from(side > 0.0));
                if !draw.chance(0, 0.6) {
                    continue;
                }
                let vehicle = self.vehicle(
                    draw,
                    Motion::Still {
                        at: DVec2::ZERO,
                        heading: 0.0,
                    },
                    true,
                );
                let half = 0.5 * f64::from(self.shapes[vehicle.shape].size.x);
                let along = road.tangent(junction.s).perp() * side;
                let across = road.tangent(junction.s) * (side * road.hand);
                let at = road.point(junction.s, 0.0)
                    + along * (road.half_m() + road.pavement_m + 1.8 + half)
                    + across * (0.5 * junction.half_m);
                let heading = libm::atan2(-along.y, -along.x);
                self.vehicles.push(Vehicle {
                    motion: Motion::Still { at, heading },
                    ..vehicle
                });
            }
        }
    }

    /// Keeps as many vehicles as asked for, those that the camera passes first.
    fn limit(&mut self, road: &Road, demand: &Demand) {
        let Some(cars) = demand.cars else { return };
        let ego = stance_of(road, &self.ego, 0.0, demand.span).at;
        let ahead = road.tangent(0.0);
        let rank = |v: &Vehicle| {
            let to = stance_of(road, &v.motion, 0.0, demand.span).at - ego;
            let forward = to.dot(ahead);
            to.length() + if forward < 4.0 { 1e4 } else { 0.0 }
        };
        let mut order: Vec<(f64, usize)> = self
            .vehicles
            .iter()
            .enumerate()
            .map(|(i, v)| (rank(v), i))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order.truncate(cars as usize);
        let mut keep: Vec<usize> = order.into_iter().map(|(_, i)| i).collect();
        keep.sort_unstable();
        self.vehicles = keep.into_iter().map(|i| self.vehicles[i].clone()).collect();
    }
}

struct Driver {
    s: f64,
    v: f64,
    wish: f64,
    length: f64,
    vehicle: Option<Vehicle>,
}

/// Puts the camera's car at s = 0 and clears its surroundings.
fn insert_ego(drivers: &mut Vec<Driver>, ego_mps: f64) -> usize {
    let gap = 8.0 + 0.8 * ego_mps;
    drivers.retain(|d| d.s.abs() > 0.5 * (d.length + EGO_LENGTH_M) + gap);
    let index = drivers.iter().filter(|d| d.s < 0.0).count();
    if let Some(leader) = drivers.get_mut(index) {
        leader.wish = leader.wish.max(ego_mps);
    }
    drivers.insert(
        index,
        Driver {
            s: 0.0,
            v: ego_mps,
            wish: ego_mps,
            length: EGO_LENGTH_M,
            vehicle: None,
        },
    );
    index
}

/// Integrates the lane (drivers ascending by position) over the whole drive.
fn drive(drivers: &mut [Driver], duration_s: f64) -> Vec<Track> {
    let steps = ((duration_s + SETTLE_S) / STEP_S).ceil() as usize + 2;
    let mut tracks: Vec<Track> = drivers
        .iter()
        .map(|_| Track {
            start_s: -SETTLE_S,
            states: Vec::with_capacity(steps),
        })
        .collect();
    for _ in 0..steps {
        for (d, t) in drivers.iter().zip(&mut tracks) {
            t.states.push((d.s, d.v));
        }
        let pulls: Vec<f64> = (0..drivers.len())
            .map(|i| acceleration(&drivers[i], drivers.get(i + 1)))
            .collect();
        for (d, a) in drivers.iter_mut().zip(pulls) {
            let v = (d.v + a * STEP_S).max(0.0);
            d.s += 0.5 * (d.v + v) * STEP_S;
            d.v = v;
        }
    }
    tracks
}

/// The intelligent driver model with common urban parameters.
fn acceleration(me: &Driver, leader: Option<&Driver>) -> f64 {
    const ACCELERATION: f64 = 1.5;
    const BRAKING: f64 = 2.0;
    const HEADWAY_S: f64 = 1.2;
    const STANDSTILL_M: f64 = 2.5;
    let free = 1.0 - (me.v / me.wish.max(0.1)).powi(4);
    let pressure = leader.map_or(0.0, |l| {
        let gap = (l.s - me.s - 0.5 * (l.length + me.length)).max(0.3);
        let wanted = STANDSTILL_M
            + (me.v * HEADWAY_S + me.v * (me.v - l.v) / (2.0 * (ACCELERATION * BRAKING).sqrt()))
                .max(0.0);
        (wanted / gap).powi(2)
    });
    (ACCELERATION * (free - pressure)).max(-8.0)
}

/// Where `motion` has brought its vehicle at `t`.
pub(super) fn stance_of(road: &Road, motion: &Motion, t: f64, span: (f64, f64)) -> Stance {
    match motion {
        Motion::Still { at, heading } => Stance {
            at: *at,
            heading: *heading,
            rolled_m: 0.0,
            speed: 0.0,
            gone: false,
        },
        Motion::Lane {
            track,
            d,
            forward,
            sway,
        } => {
            let (run, speed) = track.at(t);
            let s = if *forward { run } else { -run };
            // A driver sways by a hand's breadth within the lane.
            let (k, amplitude) = (0.045, 0.11);
            let offset = d + amplitude * libm::sin(k * s + sway);
            let slope = amplitude * k * libm::cos(k * s + sway);
            let turn = if *forward { 0.0 } else { std::f64::consts::PI };
            let heading =
                road.heading(s) + libm::atan(slope / (1.0 - d * road.curvature(s))) + turn;
            // The arc length of a parallel curve differs by offset times turning.
            let length = s - d * (road.heading(s) - road.heading(0.0));
            Stance {
                at: road.point(s, offset),
                heading,
                rolled_m: if *forward { length } else { -length },
                speed,
                gone: s < span.0 + 8.0 || s > span.1 - 8.0,
            }
        }
    }
}

impl Stance {
    /// From the vehicle's coordinates to the world's.
    pub fn to_world(self) -> DAffine3 {
        let (sin, cos) = libm::sincos(self.heading);
        DAffine3::from_cols(
            DVec3::new(cos, sin, 0.0),
            DVec3::new(-sin, cos, 0.0),
            DVec3::Z,
            self.at.extend(0.0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive_of(seed: u64) -> (Road, Traffic, (f64, f64)) {
        let span = (-120.0, 600.0);
        let road = Road::random(seed, span.0, span.1, false);
        let demand = Demand {
            ego_mps: 22.0,
            duration_s: 6.0,
            cars: None,
            span,
            tunnel: false,
        };
        let traffic = Traffic::random(seed, &road, &demand);
        (road, traffic, span)
    }

    /// Do two upright boxes overlap? Separating axes of both rectangles.
    fn overlap(a: (Stance, DVec2), b: (Stance, DVec2)) -> bool {
        let axes = |s: &Stance| {
            let (sin, cos) = s.heading.sin_cos();
            [DVec2::new(cos, sin), DVec2::new(-sin, cos)]
        };
        let reach = |(s, half): &(Stance, DVec2), n: DVec2| {
            let [x, y] = axes(s);
            half.x * x.dot(n).abs() + half.y * y.dot(n).abs()
        };
        axes(&a.0)
            .into_iter()
            .chain(axes(&b.0))
            .all(|n| (a.0.at - b.0.at).dot(n).abs() < reach(&a, n) + reach(&b, n))
    }

    #[test]
    fn nobody_collides_during_a_drive() {
        for seed in 0..4 {
            let (road, traffic, span) = drive_of(seed);
            for step in 0..=12 {
                let t = 0.5 * f64::from(step);
                let mut boxes: Vec<(Stance, DVec2)> = traffic
                    .vehicles
                    .iter()
                    .map(|v| {
                        let size = traffic.shapes[v.shape].size;
                        let half = DVec2::new(f64::from(size.x), f64::from(size.y)) * 0.5;
                        (stance_of(&road, &v.motion, t, span), half)
                    })
                    .filter(|(s, _)| !s.gone)
                    .collect();
                boxes.push((
                    stance_of(&road, &traffic.ego, t, span),
                    DVec2::new(0.5 * EGO_LENGTH_M, 0.9),
                ));
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
            let stance = stance_of(&road, &v.motion, 2.0, span);
            if stance.gone {
                continue;
            }
            for (mesh, to_vehicle) in shape.parts(stance.rolled_m).skip(1) {
                let low = mesh
                    .vertices
                    .iter()
                    .map(|p| to_vehicle.transform_point3(p.position.as_dvec3()).z)
                    .fold(f64::MAX, f64::min);
                // A tyre of 24 sides stands on a corner or on a side.
                let gap = rim_gap * f64::from(shape.wheel_m) + 1e-6;
                assert!((-1e-6..=gap).contains(&low), "wheel at {low} m");
            }
            let later = stance_of(&road, &v.motion, 2.001, span);
            let rolled = later.rolled_m - stance.rolled_m;
            // Sway adds a little path across the lane: 0.5 % at most.
            assert!((rolled - later.at.distance(stance.at)).abs() < 0.006 * rolled.abs() + 1e-6);
        }
    }

    #[test]
    fn the_camera_starts_at_the_origin_and_drives() {
        let (road, traffic, span) = drive_of(2);
        let start = stance_of(&road, &traffic.ego, 0.0, span);
        assert!((start.at - road.point(0.0, 0.0)).length() < 12.0);
        let end = stance_of(&road, &traffic.ego, 6.0, span);
        assert!(end.at.distance(start.at) > 60.0);
    }
}
