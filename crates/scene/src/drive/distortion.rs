//! Radial distortion of a lens, by the division model.
//!
//! A ray has the normalized coordinates (x / z, y / z). Let r be the distance of the distorted point from the optical
//! axis. Then the ray is the distorted point divided by 1 + lambda r^2 (A. Fitzgibbon, "Simultaneous linear estimation
//! of multiple view geometry and lens distortion", CVPR 2001). Both directions have a closed form, so labels need no
//! iteration.

use wide::f32x4;

/// The parameter of the division model.
///
/// If `lambda` is 0, distorted points and rays are equal, to the last bit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RadialDistortion {
    pub lambda: f32,
}

impl RadialDistortion {
    /// Returns the factor by which a distorted point is multiplied to obtain its ray.
    #[inline]
    pub(crate) fn ray_factor(self, x: f32, y: f32) -> f32 {
        1.0 / (1.0 + self.lambda * (x * x + y * y))
    }

    /// Returns sqrt(1 - 4 lambda s) for a ray with the squared distance `s` from the optical axis.
    #[inline]
    fn root(self, s: f32) -> f32 {
        (1.0 - 4.0 * self.lambda * s).sqrt()
    }

    /// Returns the factor by which a ray is multiplied to obtain its distorted point. `s` is the squared distance of the
    /// ray from the optical axis.
    #[inline]
    pub(crate) fn image_factor(self, s: f32) -> f32 {
        2.0 / (1.0 + self.root(s))
    }

    /// Returns the distorted point of the ray (x, y).
    #[inline]
    pub(crate) fn distort(self, x: f32, y: f32) -> (f32, f32) {
        let g = self.image_factor(x * x + y * y);
        (x * g, y * g)
    }

    /// Returns the displacement of the distorted point if the ray (x, y) moves by (dx, dy).
    ///
    /// The result keeps the relative precision of a small displacement. With g the factor and q the root, the
    /// displacement is d g' + u (g' - g), where g' - g = 2 (q - q') / ((1 + q) (1 + q')) and q - q' = 4 lambda (s' - s)
    /// / (q + q').
    #[inline]
    pub(crate) fn displacement(self, (x, y): (f32, f32), (dx, dy): (f32, f32)) -> (f32, f32) {
        let s = x * x + y * y;
        let ds = dx * (2.0 * x + dx) + dy * (2.0 * y + dy);
        let (q, q2) = (self.root(s), self.root(s + ds));
        let g2 = 2.0 / (1.0 + q2);
        let change = g2 / (1.0 + q) * (4.0 * self.lambda * ds) / (q + q2);
        (dx * g2 + x * change, dy * g2 + y * change)
    }

    /// Returns [`ray_factor`](Self::ray_factor) of four points, with the same bits.
    #[inline]
    pub(crate) fn ray_factor4(self, x: f32x4, y: f32x4) -> f32x4 {
        f32x4::ONE / ((x * x + y * y) * self.lambda + 1.0)
    }

    /// Returns [`displacement`](Self::displacement) of four rays, with the same bits.
    #[inline]
    pub(crate) fn displacement4(self, (x, y): (f32x4, f32x4), (dx, dy): (f32x4, f32x4)) -> (f32x4, f32x4) {
        let root = |s: f32x4| (f32x4::ONE - s * (4.0 * self.lambda)).sqrt();
        let s = x * x + y * y;
        let ds = dx * (x * 2.0 + dx) + dy * (y * 2.0 + dy);
        let (q, q2) = (root(s), root(s + ds));
        let g2 = f32x4::splat(2.0) / (q2 + 1.0);
        let change = g2 / (q + 1.0) * (ds * (4.0 * self.lambda)) / (q + q2);
        (dx * g2 + x * change, dy * g2 + y * change)
    }
}

#[cfg(test)]
mod tests {
    use super::RadialDistortion;

    const BARREL: RadialDistortion = RadialDistortion { lambda: -0.06 };

    #[test]
    fn rays_of_distorted_points_are_the_rays_again() {
        for (x, y) in [(0.0, 0.0), (0.3, -0.2), (0.7, 0.44), (-2.0, 1.0)] {
            let (u, v) = BARREL.distort(x, y);
            let k = BARREL.ray_factor(u, v);
            assert!((u * k - x).abs() < 1e-6 * (1.0 + x.abs()) && (v * k - y).abs() < 1e-6 * (1.0 + y.abs()));
            assert!(u.abs() <= x.abs() && v.abs() <= y.abs(), "barrel distortion moves points inward");
        }
    }

    /// In double precision, the difference of two distorted points is exact to 1e-16. The relative error of the
    /// displacement in single precision is a few roundings of 6e-8.
    #[test]
    fn small_displacements_keep_their_precision() {
        let exact = |x: f64, y: f64| {
            let g = 2.0 / (1.0 + (1.0 - 4.0 * f64::from(BARREL.lambda) * (x * x + y * y)).sqrt());
            (x * g, y * g)
        };
        for (x, y, dx, dy) in
            [(0.5f32, -0.3f32, 1e-5f32, 3e-6f32), (0.8, 0.5, -2e-3, 1e-3), (0.0, 0.0, 1e-4, 0.0)]
        {
            let (u, v) = BARREL.displacement((x, y), (dx, dy));
            let (x, y, dx, dy) = (f64::from(x), f64::from(y), f64::from(dx), f64::from(dy));
            let (a, b) = (exact(x, y), exact(x + dx, y + dy));
            let size = dx.hypot(dy);
            assert!((f64::from(u) - (b.0 - a.0)).abs() < 1e-6 * size, "{u} for {}", b.0 - a.0);
            assert!((f64::from(v) - (b.1 - a.1)).abs() < 1e-6 * size, "{v} for {}", b.1 - a.1);
        }
    }

    #[test]
    fn without_distortion_nothing_changes() {
        let none = RadialDistortion::default();
        assert_eq!(none.distort(0.37, -0.11), (0.37, -0.11));
        assert_eq!(none.ray_factor(0.37, -0.11), 1.0);
        assert_eq!(none.displacement((0.37, -0.11), (1e-3, 2e-3)), (1e-3, 2e-3));
    }
}
