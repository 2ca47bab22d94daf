//! The hidden effects and their canonical names. Some of them are in the catalog, and some are not.

use super::physics::Physics;

/// A kind of imperfection. `largest` is the largest strength in the table of the catalog. `set` changes the parameters of
/// a sensor. Its arguments are the strength and three uniform values, which determine the other parameters.
pub struct Kind {
    pub name: &'static str,
    pub largest: f64,
    pub set: fn(&mut Physics, f64, [f64; 3]),
}

fn log(low: f64, high: f64, u: f64) -> f64 {
    low * (high / low).powf(u)
}

fn sign(u: f64) -> f64 {
    if u < 0.5 { -1.0 } else { 1.0 }
}

/// Effects of the catalog.
pub const CATALOG_KINDS: [Kind; 35] = [
    Kind { name: "dead_time", largest: 0.1, set: |p, s, _| p.dead_time += s },
    Kind { name: "response_nonlinearity", largest: 0.1, set: |p, s, u| p.quadratic = s * sign(u[0]) },
    Kind { name: "partial_reset", largest: 1.0, set: |p, s, _| p.lost_remainder = s },
    Kind { name: "leak", largest: 2e-3, set: |p, s, _| p.leak = s },
    Kind { name: "dark_shot_noise", largest: 1.0, set: |p, s, _| p.dark_shot = s },
    Kind { name: "comparator_noise", largest: 0.03, set: |p, s, _| p.comparator = s },
    Kind {
        name: "slow_threshold_noise",
        largest: 0.01,
        set: |p, s, u| p.slow = (s, log(100.0, 20_000.0, u[0])),
    },
    Kind {
        name: "adaptation",
        largest: 0.01,
        set: |p, s, u| p.adaptation = (s, 1.0 - log(0.001, 0.2, u[0])),
    },
    Kind {
        name: "telegraph_dark",
        largest: 1.0,
        set: |p, s, u| p.telegraph = (s, log(0.05, 0.5, u[0]), log(3e-4, 3e-3, u[1])),
    },
    Kind { name: "hot_pixels", largest: 0.015, set: |p, s, u| p.hot = (s, log(4.0, 20.0, u[0])) },
    Kind { name: "dead_pixels", largest: 0.015, set: |p, s, _| p.dead = s },
    Kind { name: "column_pattern", largest: 0.05, set: |p, s, _| p.column_sigma = s },
    Kind { name: "row_pattern", largest: 0.05, set: |p, s, _| p.row_sigma = s },
    Kind { name: "smooth_prnu", largest: 0.05, set: |p, s, u| p.smooth = (s, log(1.0, 6.0, u[0])) },
    Kind { name: "vignetting", largest: 0.3, set: |p, s, _| p.vignetting = s },
    Kind { name: "row_noise", largest: 0.03, set: |p, s, _| p.row_noise = s },
    Kind {
        name: "flicker",
        largest: 0.1,
        set: |p, s, u| p.flicker = (s, log(50.0, 2_000.0, u[0]), std::f64::consts::TAU * u[1]),
    },
    Kind { name: "gain_drift", largest: 0.1, set: |p, s, u| p.drift = s * sign(u[0]) },
    Kind { name: "image_lag", largest: 0.05, set: |p, s, u| p.lag = (s, log(5.0, 200.0, u[0])) },
    Kind { name: "crosstalk", largest: 0.06, set: |p, s, _| p.crosstalk = s },
    Kind { name: "spike_coupling", largest: 0.015, set: |p, s, u| p.coupling = s * sign(u[0]) },
    Kind { name: "supply_droop", largest: 0.03, set: |p, s, u| p.droop = s * sign(u[0]) },
    Kind { name: "missed_spikes", largest: 0.1, set: |p, s, _| p.missed = s },
    Kind { name: "false_spikes", largest: 0.01, set: |p, s, _| p.spurious = s },
    Kind { name: "dropped_readouts", largest: 0.05, set: |p, s, _| p.dropped = s },
    Kind { name: "repeated_readouts", largest: 0.05, set: |p, s, _| p.repeated = s },
    // The clamp is two thresholds minus the strength.
    Kind { name: "saturation_clamp", largest: 1.0, set: |p, s, _| p.clamp = 2.0 - s },
    Kind { name: "dark_tail", largest: 1.0, set: |p, s, _| p.dark_log_sigma = s },
    Kind { name: "gain_dark_correlation", largest: 1.0, set: |p, s, u| p.gain_dark = s * sign(u[0]) },
    Kind { name: "edge_columns", largest: 0.5, set: |p, s, _| p.edge = 1.0 + s },
    Kind { name: "correlated_shot_noise", largest: 60.0, set: |p, s, _| p.settle = s },
    Kind {
        name: "readout_jitter",
        largest: 0.03,
        set: |p, s, u| p.jitter = (s, 48.0 * u[0], log(16.0, 500.0, u[1])),
    },
    // These kinds are parameter mismatches: one parameter of the published model has another value.
    Kind { name: "thermal_noise", largest: 3.0, set: |p, s, _| p.threshold_noise *= 1.0 + s },
    Kind { name: "prnu", largest: 2.0, set: |p, s, _| p.gain_spread *= 1.0 + s },
    Kind { name: "dark_current", largest: 3.0, set: |p, s, _| p.dark_mean *= 1.0 + s },
];

/// Effects that are not in the catalog. Their fixed strengths make the sensor clearly different from a clean sensor.
pub const OUTSIDE_KINDS: [Kind; 8] = [
    Kind { name: "two-tap parity", largest: 0.03, set: |p, s, _| p.parity = s },
    Kind { name: "supply bursts", largest: 0.05, set: |p, s, u| p.burst = (log(1e-3, 1e-2, u[0]), s) },
    Kind { name: "wake-up transient", largest: 0.2, set: |p, s, u| p.wake = (s, log(20.0, 200.0, u[0])) },
    Kind { name: "diagonal banding", largest: 0.05, set: |p, s, u| p.banding = (s, log(4.0, 16.0, u[0])) },
    Kind { name: "stuck row", largest: 1.0, set: |p, s, u| p.stuck_row = Some(((u[0] * 48.0) as usize, s)) },
    Kind {
        name: "dark current that remembers light",
        largest: 2.0,
        set: |p, s, u| p.dark_memory = (s, log(100.0, 1000.0, u[0])),
    },
    Kind {
        name: "two populations of threshold noise",
        largest: 6.0,
        set: |p, s, u| p.noisy = (log(0.05, 0.3, u[0]), 1.0 + s),
    },
    Kind { name: "after-pulses", largest: 0.05, set: |p, s, _| p.after_pulse = s },
];

/// Returns the kind called `name`.
pub fn kind(name: &str) -> &'static Kind {
    CATALOG_KINDS
        .iter()
        .chain(&OUTSIDE_KINDS)
        .find(|k| k.name == name)
        .unwrap_or_else(|| panic!("no kind {name}"))
}
