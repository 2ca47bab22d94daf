//! A rectangle around an object.

/// A rectangle around an object, in pixels.
///
/// # Examples
/// ```
/// use spikelane_benchmark::BoundingBox;
/// let a = BoundingBox { x: 0.0, y: 0.0, width: 2.0, height: 2.0 };
/// let b = BoundingBox { x: 1.0, ..a };
/// // The intersection has 2 square pixels, and the union has 6.
/// assert_eq!(a.intersection_over_union(b), 1.0 / 3.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingBox {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width, at least 0.
    pub width: f64,
    /// Height, at least 0.
    pub height: f64,
}

impl BoundingBox {
    /// Returns the area in square pixels.
    #[must_use]
    pub fn area(self) -> f64 {
        self.width * self.height
    }

    /// Returns the area that both rectangles cover, in square pixels.
    #[must_use]
    pub fn intersection(self, other: Self) -> f64 {
        let width = (self.x + self.width).min(other.x + other.width) - self.x.max(other.x);
        let height = (self.y + self.height).min(other.y + other.height) - self.y.max(other.y);
        if width > 0.0 && height > 0.0 { width * height } else { 0.0 }
    }

    /// Returns the area of the intersection divided by the area of the union, 0 to 1. Two rectangles without area
    /// have the value 0.
    #[must_use]
    pub fn intersection_over_union(self, other: Self) -> f64 {
        let shared = self.intersection(other);
        if shared > 0.0 { shared / (self.area() + other.area() - shared) } else { 0.0 }
    }

    pub(crate) fn is_finite(self) -> bool {
        [self.x, self.y, self.width, self.height].into_iter().all(f64::is_finite)
    }

    pub(crate) fn has_valid_sides(self) -> bool {
        self.width >= 0.0 && self.height >= 0.0
    }
}
