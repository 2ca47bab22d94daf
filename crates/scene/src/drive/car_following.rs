//! Car following according to the intelligent driver model (Treiber, Hennecke and Helbing, Phys. Rev. E 62, 1805,
//! 2000).
//!
//! In this model, cars never collide.

use super::traffic_vehicle::{EGO_LENGTH_M, Vehicle};
use super::vehicle_motion::{STEP_S, Track};

/// Simulated time before the start of the scene. During this time, the traffic becomes steady.
const WARM_UP_S: f64 = 5.0;

/// One car in a lane. `s` increases in the direction of travel of the lane.
pub(crate) struct Driver {
    pub s: f64,
    pub v: f64,
    /// Speed of the car on an empty road, in m/s.
    pub desired_speed: f64,
    pub length: f64,
    /// The vehicle, or `None` for the camera's own car.
    pub vehicle: Option<Vehicle>,
}

/// Removes the cars close to s = 0 and inserts the camera's car at s = 0. Returns the index of the camera's car.
pub(crate) fn insert_ego(drivers: &mut Vec<Driver>, ego_mps: f64) -> usize {
    let gap = 8.0 + 0.8 * ego_mps;
    drivers.retain(|d| d.s.abs() > 0.5 * (d.length + EGO_LENGTH_M) + gap);
    let index = drivers.iter().filter(|d| d.s < 0.0).count();
    if let Some(leader) = drivers.get_mut(index) {
        leader.desired_speed = leader.desired_speed.max(ego_mps);
    }
    drivers.insert(
        index,
        Driver { s: 0.0, v: ego_mps, desired_speed: ego_mps, length: EGO_LENGTH_M, vehicle: None },
    );
    index
}

/// Integrates the motion of all cars in a lane for the whole drive. `drivers` must be in ascending order of position.
pub(crate) fn integrate_lane(drivers: &mut [Driver], duration_s: f64) -> Vec<Track> {
    let steps = ((duration_s + WARM_UP_S) / STEP_S).ceil() as usize + 2;
    let mut tracks: Vec<Track> =
        drivers.iter().map(|_| Track { start_s: -WARM_UP_S, states: Vec::with_capacity(steps) }).collect();
    for _ in 0..steps {
        for (d, t) in drivers.iter().zip(&mut tracks) {
            t.states.push((d.s, d.v));
        }
        let pulls: Vec<f64> =
            (0..drivers.len()).map(|i| acceleration(&drivers[i], drivers.get(i + 1))).collect();
        for (d, a) in drivers.iter_mut().zip(pulls) {
            let v = (d.v + a * STEP_S).max(0.0);
            d.s += 0.5 * (d.v + v) * STEP_S;
            d.v = v;
        }
    }
    tracks
}

/// Returns the acceleration according to the intelligent driver model with common parameters for urban traffic.
fn acceleration(me: &Driver, leader: Option<&Driver>) -> f64 {
    const ACCELERATION: f64 = 1.5;
    const BRAKING: f64 = 2.0;
    const HEADWAY_S: f64 = 1.2;
    const STANDSTILL_M: f64 = 2.5;
    let speed2 = (me.v / me.desired_speed.max(0.1)).powi(2);
    let free = 1.0 - speed2 * speed2;
    let pressure = leader.map_or(0.0, |l| {
        let gap = (l.s - me.s - 0.5 * (l.length + me.length)).max(0.3);
        let wanted = STANDSTILL_M
            + (me.v * HEADWAY_S + me.v * (me.v - l.v) / (2.0 * (ACCELERATION * BRAKING).sqrt())).max(0.0);
        (wanted / gap).powi(2)
    });
    (ACCELERATION * (free - pressure)).max(-8.0)
}
