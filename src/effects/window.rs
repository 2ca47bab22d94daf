//! A part of a larger sensor: the pixels, columns and rows of that place.

use crate::effects::Camera;
use crate::error::{Error, Kind, Result};
use crate::spikes::{Crop, Geometry};

impl Camera {
    /// The rectangle `crop` of this camera as a camera of its own: its pixels have the fixed pattern of that
    /// place, and its plan the fixed point of the whole sensor. Temporal noise and start phases are its own,
    /// and pixels outside act on none inside. Maps stay those of the whole sensor. A window of a window is one
    /// of the whole sensor.
    ///
    /// # Errors
    /// When the rectangle is empty or leaves this camera.
    pub fn window(&self, crop: Crop) -> Result<Self> {
        let geometry = crop.geometry(self.sensor.geometry)?;
        let (whole, outer) = match self.whole()? {
            Some((whole, outer)) => (whole.sensor.geometry, (outer.x, outer.y)),
            None => (self.sensor.geometry, (0, 0)),
        };
        let mut part = self.clone();
        part.sensor.geometry = geometry;
        part.window = Some((whole, Crop { x: outer.0 + crop.x, y: outer.1 + crop.y, ..crop }));
        Ok(part)
    }

    /// The whole sensor whose window this camera is, and the place of the window; `None` for a whole one.
    ///
    /// # Errors
    /// When the size of the sensor was changed after the window was cut.
    pub fn whole(&self) -> Result<Option<(Self, Crop)>> {
        let Some((geometry, crop)) = self.window else { return Ok(None) };
        if crop.geometry(geometry)? != self.sensor.geometry {
            return Err(Error::new(Kind::Config, "window")
                .found(format_args!("a sensor of {}", self.sensor.geometry))
                .expected(format_args!("{}x{}, the size of the window", crop.width, crop.height))
                .remedy("change the size first, then cut the window"));
        }
        let mut whole = self.clone();
        whole.sensor.geometry = geometry;
        whole.window = None;
        Ok(Some((whole, crop)))
    }

    /// Width and height of the sensor that maps belong to: the whole one, of a window too.
    #[must_use]
    pub fn whole_geometry(&self) -> Geometry {
        self.window.map_or(self.sensor.geometry, |(whole, _)| whole)
    }

    /// The place of this window in the whole sensor; `None` for a whole one.
    #[must_use]
    pub fn place(&self) -> Option<Crop> {
        self.window.map(|(_, crop)| crop)
    }
}
