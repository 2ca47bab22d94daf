//! Windows: cameras that read out only a part of a larger sensor.

use crate::effects::Camera;
use crate::error::{Result, bail};
use crate::sensor::Mosaic;
use crate::spikes::{Crop, Geometry};

impl Camera {
    /// Returns the rectangle `crop` of this camera as a separate camera.
    ///
    /// The window has the fixed pattern of `crop` in this camera. The plan of the window has the fixed-point scales of
    /// the whole sensor. Temporal noise and start phases differ from the temporal noise and start phases of the whole
    /// sensor. Pixels outside `crop` do not affect pixels inside `crop`. `maps` and `mosaic` still describe the whole
    /// sensor. If this camera is a window, the result is a window of the same whole sensor.
    ///
    /// # Examples
    /// ```
    /// use spikelane::spikes::Crop;
    /// use spikelane::{Camera, Geometry, Seeds, Sensor, effects};
    /// let camera = Camera::ideal(Sensor::new(400, 250, 20_000.0)?).with_effect(effects::find("prnu")?.typical());
    /// let crop = Crop { row: 100, col: 200, width: 32, height: 24 };
    /// let part = camera.window(crop)?;
    /// assert_eq!(part.sensor.geometry, Geometry::new(32, 24)?);
    /// // The pixels have the gains that they have in the whole sensor.
    /// let gains = |camera: &Camera| camera.model(Seeds::default()).map(|model| model.circuit.gain);
    /// assert_eq!(gains(&part)?, crop.pick(camera.sensor.geometry, &gains(&camera)?));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the rectangle is empty or not within this camera.
    /// Returns the errors of [`Self::whole_sensor`].
    pub fn window(&self, crop: Crop) -> Result<Self> {
        let geometry = crop.geometry(self.sensor.geometry)?;
        let (full_sensor, outer) = match self.whole_sensor()? {
            Some((whole, outer)) => (whole.sensor.geometry, (outer.row, outer.col)),
            None => (self.sensor.geometry, (0, 0)),
        };
        let mut part = self.clone();
        part.sensor.geometry = geometry;
        part.window = Some((full_sensor, Crop { row: outer.0 + crop.row, col: outer.1 + crop.col, ..crop }));
        Ok(part)
    }

    /// Returns the whole sensor of which this camera is a window, and the rectangle of the window.
    ///
    /// Returns `None` if this camera is not a window.
    ///
    /// # Examples
    /// ```
    /// use spikelane::spikes::Crop;
    /// use spikelane::{Camera, Sensor};
    /// let camera = Camera::ideal(Sensor::new(400, 250, 20_000.0)?);
    /// let crop = Crop { row: 100, col: 200, width: 32, height: 24 };
    /// assert_eq!(camera.window(crop)?.whole_sensor()?, Some((camera.clone(), crop)));
    /// assert_eq!(camera.whole_sensor()?, None);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the size of the sensor was changed after the window was cut.
    pub fn whole_sensor(&self) -> Result<Option<(Self, Crop)>> {
        let Some((geometry, crop)) = self.window else { return Ok(None) };
        if crop.geometry(geometry)? != self.sensor.geometry {
            bail!(Config, "window"; found "a sensor of {}", self.sensor.geometry;
                expected "{}x{}, the size of the window", crop.width, crop.height;
                remedy "resize the camera first, then select the window");
        }
        let mut full = self.clone();
        full.sensor.geometry = geometry;
        full.window = None;
        Ok(Some((full, crop)))
    }

    /// Returns the mosaic of the pixels that this camera reads out. If the camera is a window, the first pixel of the
    /// mosaic is the first pixel of the window.
    ///
    /// # Examples
    /// ```
    /// use spikelane::spikes::Crop;
    /// use spikelane::{Camera, Sensor};
    /// let mut camera = Camera::ideal(Sensor::new(400, 250, 20_000.0)?);
    /// camera.mosaic = Some("RGGB".parse()?);
    /// let part = camera.window(Crop { row: 1, col: 20, width: 32, height: 24 })?;
    /// assert_eq!(part.window_mosaic().map(|mosaic| mosaic.to_string()).as_deref(), Some("GBRG"));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn window_mosaic(&self) -> Option<Mosaic> {
        let mosaic = self.mosaic.as_ref()?;
        Some(self.window.map_or_else(|| mosaic.clone(), |(_, crop)| mosaic.crop(crop)))
    }

    /// Returns the geometry of the maps of this camera. If the camera is a window, it is the geometry of the whole
    /// sensor.
    #[must_use]
    pub fn sensor_geometry(&self) -> Geometry {
        self.window.map_or(self.sensor.geometry, |(geometry, _)| geometry)
    }

    /// Returns the rectangle of this window in the whole sensor, or `None` if this camera is not a window.
    #[must_use]
    pub fn window_crop(&self) -> Option<Crop> {
        self.window.map(|(_, crop)| crop)
    }
}
