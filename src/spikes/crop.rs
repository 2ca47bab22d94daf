use crate::error::{Error, ErrorKind, Result};
use crate::spikes::Geometry;

/// A rectangle of pixels. `x` is counted from the left, and `y` from the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct Crop {
    /// First row.
    pub row: usize,
    /// First column.
    pub col: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Crop {
    /// Returns the geometry of the rectangle.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`] if the rectangle is empty or not within `full`.
    pub fn geometry(&self, full: Geometry) -> Result<Geometry> {
        let inside =
            |start: usize, len, size| len > 0 && start.checked_add(len).is_some_and(|end| end <= size);
        let side = |n| u32::try_from(n).unwrap_or(u32::MAX);
        if inside(self.col, self.width, full.width()) && inside(self.row, self.height, full.height()) {
            return Geometry::new(side(self.width), side(self.height));
        }
        Err(Error::new(ErrorKind::Usage, "crop")
            .found(format_args!("{}x{} at row {}, col {}", self.width, self.height, self.row, self.col))
            .expected(format_args!("a rectangle of pixels within {full}")))
    }

    /// Returns the values of the pixels in the rectangle, row by row. `values` contains one value per pixel of a sensor
    /// of geometry `full`.
    ///
    /// # Panics
    /// Panics if the rectangle is not within the sensor, or if `values` lacks the value of a pixel in the rectangle.
    pub fn pick<T: Copy>(&self, full: Geometry, values: &[T]) -> Vec<T> {
        let rows = (self.row..self.row + self.height).map(|row| row * full.width() + self.col);
        rows.flat_map(|start| &values[start..start + self.width]).copied().collect()
    }
}
