//! Cubic interpolation between samples.

/// Returns the Catmull-Rom weights of four successive samples for the position `t` between the second and the third
/// sample.
///
/// `t` is 0 at the second sample and 1 at the third sample.
pub fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (2.0 * t2 - t - t3),
        0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
        0.5 * (t + 4.0 * t2 - 3.0 * t3),
        0.5 * (t3 - t2),
    ]
}
