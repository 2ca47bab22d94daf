//! The road, which is a smooth plane curve. All objects are placed along this curve.
//!
//! The heading of the road is a sum of a few sines of the arc length. Position, heading and curvature are therefore
//! smooth. The heading deviates from the x axis by less than 40 degrees, so x increases with s and the curve never
//! crosses itself.

use glam::{DVec2, Vec3};

use crate::random::Draws;

/// Arc length between consecutive tabulated points, in meters.
const TABLE_STEP_M: f64 = 1.0;
/// Width of one driving lane, in meters.
pub(crate) const LANE_WIDTH_M: f64 = 3.5;

/// A road seen from above. `s` is the arc length, and `d` is the offset to the left. Both are in meters.
#[derive(Clone, Debug)]
pub(crate) struct Road {
    waves: [(f64, f64, f64); 3],
    start_s: f64,
    points: Vec<DVec2>,
    /// Number of lanes in each direction of travel.
    pub lanes: usize,
    /// Width of the strip for parked cars on each side in meters. The width is zero if there is no strip.
    pub parking_m: f64,
    /// +1 for right-hand traffic, -1 for left-hand traffic.
    pub driving_side: f64,
    /// Width of the sidewalk on each side in meters.
    pub sidewalk_m: f64,
    /// Crossings with side streets, in ascending order of `s`.
    pub junctions: Vec<Junction>,
}

/// A side street that crosses the road at a right angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Junction {
    /// Arc length of the main road at the center line of the side street.
    pub s: f64,
    /// Half of the width of the side street's roadway.
    pub half_width_m: f64,
}

impl Road {
    /// Builds a road for arc lengths `[start_s, end_s]`. The lanes, curves and junctions are drawn from `seed`.
    pub(crate) fn from_seed(seed: u64, start_s: f64, end_s: f64, tunnel: bool) -> Self {
        let draws = Draws::new(seed, "road");
        let bend = if tunnel { 0.25 } else { 1.0 };
        let wave = |i: u64, amplitude: f64, length: (f64, f64)| {
            let amplitude = amplitude * bend * draws.range(i, 0.3, 1.0);
            let length = draws.range(i + 10, length.0, length.1);
            (amplitude, std::f64::consts::TAU / length, draws.range(i + 20, 0.0, std::f64::consts::TAU))
        };
        let mut road = Self {
            waves: [
                wave(0, 0.30, (700.0, 1100.0)),
                wave(1, 0.16, (320.0, 520.0)),
                wave(2, 0.05, (170.0, 240.0)),
            ],
            start_s,
            points: Vec::new(),
            lanes: 1 + draws.index_below(30, 3).min(1) + usize::from(draws.chance(31, 0.2)),
            parking_m: if !tunnel && draws.chance(32, 0.7) { 2.4 } else { 0.0 },
            driving_side: if draws.chance(33, 0.8) { 1.0 } else { -1.0 },
            sidewalk_m: if tunnel { 1.2 } else { draws.range(34, 3.2, 5.0) },
            junctions: Vec::new(),
        };
        road.lanes = road.lanes.min(2);
        road.integrate(end_s);
        if !tunnel {
            road.place_junctions(draws, start_s, end_s);
        }
        road
    }

    fn integrate(&mut self, end_s: f64) {
        let count = ((end_s - self.start_s) / TABLE_STEP_M).ceil() as usize + 2;
        let mut at = DVec2::new(self.start_s, 0.0);
        self.points.push(at);
        for i in 0..count {
            let s = self.start_s + i as f64 * TABLE_STEP_M;
            // Simpson's rule integrates the tangent along one step.
            let unit = |s: f64| self.tangent(s);
            at += (unit(s) + 4.0 * unit(s + 0.5 * TABLE_STEP_M) + unit(s + TABLE_STEP_M))
                * (TABLE_STEP_M / 6.0);
            self.points.push(at);
        }
    }

    fn place_junctions(&mut self, draws: Draws, start_s: f64, end_s: f64) {
        let mut s = start_s + draws.range(40, 40.0, 110.0);
        let mut i = 0;
        while s < end_s - 30.0 {
            self.junctions.push(Junction { s, half_width_m: draws.item(i).range(0, 3.2, 5.5) });
            s += draws.item(i).range(1, 75.0, 150.0);
            i += 1;
        }
    }

    /// Returns the heading at arc length `s` as the angle from the x axis in radians, counterclockwise.
    pub(crate) fn heading(&self, s: f64) -> f64 {
        self.waves.iter().map(|&(a, k, p)| a * libm::sin(k * s + p)).sum()
    }

    /// Returns the curvature at arc length `s`, which is the change of heading in radians per meter.
    pub(crate) fn curvature(&self, s: f64) -> f64 {
        self.waves.iter().map(|&(a, k, p)| a * k * libm::cos(k * s + p)).sum()
    }

    /// Returns the unit vector along the road at arc length `s`.
    pub(crate) fn tangent(&self, s: f64) -> DVec2 {
        let h = self.heading(s);
        DVec2::new(libm::cos(h), libm::sin(h))
    }

    /// Returns the point that is `d` meters to the left of the road at arc length `s`.
    pub(crate) fn point(&self, s: f64, d: f64) -> DVec2 {
        let x = ((s - self.start_s) / TABLE_STEP_M).clamp(0.0, (self.points.len() - 2) as f64);
        let i = x as usize;
        let s0 = self.start_s + i as f64 * TABLE_STEP_M;
        let (t, h) = ((s - s0) / TABLE_STEP_M, TABLE_STEP_M);
        let (p0, p1) = (self.points[i], self.points[i + 1]);
        let (m0, m1) = (self.tangent(s0) * h, self.tangent(s0 + h) * h);
        let (t2, t3) = (t * t, t * t * t);
        let on = p0 * (2.0 * t3 - 3.0 * t2 + 1.0)
            + m0 * (t3 - 2.0 * t2 + t)
            + p1 * (3.0 * t2 - 2.0 * t3)
            + m1 * (t3 - t2);
        on + self.tangent(s).perp() * d
    }

    /// Returns the point at height `z` that is `d` meters to the left of the road at arc length `s`. The result is in
    /// single precision.
    pub(crate) fn place(&self, s: f64, d: f64, z: f64) -> Vec3 {
        let p = self.point(s, d);
        Vec3::new(p.x as f32, p.y as f32, z as f32)
    }

    /// Returns (s, d) of a world point near the road. `s` is the arc length, and `d` is the distance of the point from
    /// the center line, positive to the left.
    pub(crate) fn locate(&self, x: f32, y: f32) -> (f64, f64) {
        let p = DVec2::new(f64::from(x), f64::from(y));
        let mut s = p.x;
        for _ in 0..4 {
            s += (p - self.point(s, 0.0)).dot(self.tangent(s));
        }
        (s, (p - self.point(s, 0.0)).dot(self.tangent(s).perp()))
    }

    /// Returns half of the width of the roadway. It is the sum of the widths of the lanes and of the parking strip on
    /// one side.
    pub(crate) fn half_width_m(&self) -> f64 {
        self.lanes as f64 * LANE_WIDTH_M + self.parking_m
    }

    /// Returns the distance of the center of `lane` from the center line of the road, positive to the left. Lane 0 is
    /// next to the center line.
    pub(crate) fn lane_offset(&self, lane: usize, forward: bool) -> f64 {
        let d = (lane as f64 + 0.5) * LANE_WIDTH_M * self.driving_side;
        if forward { -d } else { d }
    }

    /// Returns whether `s` is on the roadway of a side street or closer than `margin` to such a roadway.
    pub(crate) fn in_junction(&self, s: f64, margin: f64) -> bool {
        self.junctions.iter().any(|j| (s - j.s).abs() < j.half_width_m + margin)
    }
}

#[cfg(test)]
mod tests {
    use super::Road;

    #[test]
    fn locate_inverts_point() {
        let road = Road::from_seed(3, -50.0, 600.0, false);
        for (s, d) in [(0.0, 0.0), (120.0, 6.0), (333.3, -11.0), (590.0, 20.0)] {
            let p = road.point(s, d);
            let (s2, d2) = road.locate(p.x as f32, p.y as f32);
            // Single-precision coordinates below 1024 m have a resolution of 6e-5 m.
            assert!((s - s2).abs() < 1e-3 && (d - d2).abs() < 1e-3, "{s} {s2} {d} {d2}");
        }
    }
}
