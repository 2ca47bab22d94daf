use crate::error::{Result, error};
use crate::spikes::Geometry;

/// A rectangle of pixels. Rows are counted from the top, and columns from the left.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, spikes::Crop};
/// let full = Geometry::new(4, 2)?;
/// let crop = Crop { row: 1, col: 2, width: 2, height: 1 };
/// assert_eq!(crop.geometry(full)?, Geometry::new(2, 1)?);
/// assert_eq!(crop.pick(full, &[0, 1, 2, 3, 10, 11, 12, 13]), [12, 13]);
///
/// let error = Crop { col: 3, ..crop }.geometry(full).unwrap_err();
/// assert_eq!(error.to_string(), "crop: found 2x1 at row 1, col 3, expected a rectangle of pixels within 4x2");
/// # Ok::<(), spikelane::Error>(())
/// ```
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
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the rectangle is empty or not within `full`.
    pub fn geometry(&self, full: Geometry) -> Result<Geometry> {
        let inside =
            |start: usize, len, size| len > 0 && start.checked_add(len).is_some_and(|end| end <= size);
        let side = |n| u32::try_from(n).unwrap_or(u32::MAX);
        if inside(self.col, self.width, full.width()) && inside(self.row, self.height, full.height()) {
            return Geometry::new(side(self.width), side(self.height));
        }
        Err(error!(Usage, "crop";
            found "{}x{} at row {}, col {}", self.width, self.height, self.row, self.col;
            expected "a rectangle of pixels within {full}"))
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
