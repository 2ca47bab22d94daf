use crate::error::{Error, Kind, Result};
use crate::spikes::Geometry;

/// A rectangle of pixels, `x` from the left and `y` from the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Crop {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Crop {
    /// The geometry of the rectangle, if it lies within `of`.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the rectangle is empty or leaves the frame.
    pub fn geometry(&self, of: Geometry) -> Result<Geometry> {
        let inside =
            |start: usize, len, whole| len > 0 && start.checked_add(len).is_some_and(|end| end <= whole);
        let side = |n| u32::try_from(n).unwrap_or(u32::MAX);
        if inside(self.x, self.width, of.width()) && inside(self.y, self.height, of.height()) {
            return Geometry::new(side(self.width), side(self.height));
        }
        Err(Error::new(Kind::Usage, "crop")
            .found(format_args!("{}x{} at x {}, y {}", self.width, self.height, self.x, self.y))
            .expected(format_args!("a rectangle of pixels within {of}")))
    }

    /// The values of its pixels out of `values` of a sensor of geometry `of`, row by row.
    ///
    /// # Panics
    /// When the rectangle leaves the sensor, or there is not a value for every pixel of it.
    pub fn pick<T: Copy>(&self, of: Geometry, values: &[T]) -> Vec<T> {
        let rows = (self.y..self.y + self.height).map(|row| row * of.width() + self.x);
        rows.flat_map(|start| &values[start..start + self.width]).copied().collect()
    }
}
