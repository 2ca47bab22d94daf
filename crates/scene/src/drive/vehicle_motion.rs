//! The position of a vehicle at any instant. Positions are smooth functions of time, and the wheels roll without
//! slipping.

use glam::{DAffine3, DVec2, DVec3};

use super::road::Road;

/// Time step of the integration in seconds. Between two steps, positions are interpolated with a cubic polynomial.
pub(crate) const STEP_S: f64 = 0.05;

/// Arc length and speed of a vehicle at every time step.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub(crate) start_s: f64,
    pub(crate) states: Vec<(f64, f64)>,
}

impl Track {
    /// Adds `by_m` meters to all arc lengths of the track.
    pub(crate) fn shift(&mut self, by_m: f64) {
        self.states.iter_mut().for_each(|x| x.0 += by_m);
    }

    /// Returns the arc length in meters and the speed in m/s at time `t`.
    pub(crate) fn at(&self, t: f64) -> (f64, f64) {
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

/// Motion of a vehicle.
#[derive(Clone, Debug)]
pub(crate) enum VehicleMotion {
    /// The vehicle moves along a lane. The arc length in `track` increases in the direction of travel.
    Lane { track: Track, d: f64, forward: bool, phase: f64 },
    /// The vehicle is parked at a point with a heading.
    Parked { at: DVec2, heading: f64 },
}

impl VehicleMotion {
    /// Returns the arc length along the road, and the distance of the lane from the center line, at time `t`. Returns
    /// `None` for a parked vehicle.
    pub(crate) fn lane_place(&self, t: f64) -> Option<(f64, f64)> {
        match self {
            Self::Lane { track, d, forward, .. } => {
                let (run, _) = track.at(t);
                Some((if *forward { run } else { -run }, *d))
            }
            Self::Parked { .. } => None,
        }
    }
}

/// Position of a vehicle, and the distance that its wheels have rolled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VehicleState {
    pub position: DVec2,
    pub heading: f64,
    pub rolled_m: f64,
    pub speed: f64,
    /// Whether the vehicle is outside the range of arc length for which the road was built.
    pub is_outside: bool,
}

/// Returns the state at time `t` of a vehicle with the motion `motion`.
pub(crate) fn vehicle_state(road: &Road, motion: &VehicleMotion, t: f64, span: (f64, f64)) -> VehicleState {
    match motion {
        VehicleMotion::Parked { at, heading } => {
            VehicleState { position: *at, heading: *heading, rolled_m: 0.0, speed: 0.0, is_outside: false }
        }
        VehicleMotion::Lane { track, d, forward, phase } => {
            let (run, speed) = track.at(t);
            let s = if *forward { run } else { -run };
            // The driver does not steer exactly along the center of the lane. The offset oscillates by 0.11 m.
            let (k, amplitude) = (0.045, 0.11);
            let offset = d + amplitude * libm::sin(k * s + phase);
            let slope = amplitude * k * libm::cos(k * s + phase);
            let turn = if *forward { 0.0 } else { std::f64::consts::PI };
            let heading = road.heading(s) + libm::atan(slope / (1.0 - d * road.curvature(s))) + turn;
            // The parallel curve at offset d has the length s - d * (heading(s) - heading(0)).
            let length = s - d * (road.heading(s) - road.heading(0.0));
            VehicleState {
                position: road.point(s, offset),
                heading,
                rolled_m: if *forward { length } else { -length },
                speed,
                is_outside: s < span.0 + 8.0 || s > span.1 - 8.0,
            }
        }
    }
}

impl VehicleState {
    /// Returns the transform from vehicle coordinates to world coordinates.
    pub(crate) fn to_world(self) -> DAffine3 {
        let (sin, cos) = libm::sincos(self.heading);
        DAffine3::from_cols(
            DVec3::new(cos, sin, 0.0),
            DVec3::new(-sin, cos, 0.0),
            DVec3::Z,
            self.position.extend(0.0),
        )
    }
}
