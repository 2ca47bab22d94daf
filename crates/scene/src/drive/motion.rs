//! Where a vehicle is at any instant: smooth in time, exact in its wheels.

use glam::{DAffine3, DVec2, DVec3};

use super::road::Road;

/// Time step of the integration; positions between steps follow a cubic.
pub(crate) const STEP_S: f64 = 0.05;

/// Arc length and speed along the road at every step.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub(crate) start_s: f64,
    pub(crate) states: Vec<(f64, f64)>,
}

impl Track {
    /// Moves the whole run along the road.
    pub(crate) fn shift(&mut self, by_m: f64) {
        self.states.iter_mut().for_each(|x| x.0 += by_m);
    }

    /// Arc length (m) and speed (m/s) at `t`.
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

/// How a vehicle moves.
#[derive(Clone, Debug)]
pub(crate) enum Motion {
    /// Along a lane; `track` runs in its own direction of travel.
    Lane { track: Track, d: f64, forward: bool, sway: f64 },
    /// Stands at a place with a heading.
    Still { at: DVec2, heading: f64 },
}

/// Where a vehicle is and how far its wheels have rolled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stance {
    pub at: DVec2,
    pub heading: f64,
    pub rolled_m: f64,
    pub speed: f64,
    /// Outside the stretch of road that exists.
    pub gone: bool,
}

/// Where `motion` has brought its vehicle at `t`.
pub(crate) fn stance_of(road: &Road, motion: &Motion, t: f64, span: (f64, f64)) -> Stance {
    match motion {
        Motion::Still { at, heading } => {
            Stance { at: *at, heading: *heading, rolled_m: 0.0, speed: 0.0, gone: false }
        }
        Motion::Lane { track, d, forward, sway } => {
            let (run, speed) = track.at(t);
            let s = if *forward { run } else { -run };
            // A driver sways by a hand's breadth within the lane.
            let (k, amplitude) = (0.045, 0.11);
            let offset = d + amplitude * libm::sin(k * s + sway);
            let slope = amplitude * k * libm::cos(k * s + sway);
            let turn = if *forward { 0.0 } else { std::f64::consts::PI };
            let heading = road.heading(s) + libm::atan(slope / (1.0 - d * road.curvature(s))) + turn;
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
    pub(crate) fn to_world(self) -> DAffine3 {
        let (sin, cos) = libm::sincos(self.heading);
        DAffine3::from_cols(
            DVec3::new(cos, sin, 0.0),
            DVec3::new(-sin, cos, 0.0),
            DVec3::Z,
            self.at.extend(0.0),
        )
    }
}
