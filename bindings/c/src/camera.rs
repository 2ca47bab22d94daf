//! Cameras, without pointers.
#![forbid(unsafe_code)]

use std::path::Path;

use spikelane::spikes::Crop;
use spikelane::{Geometry, Result, Sensor, effects};

use crate::error::usage;

/// What a camera handle holds.
#[derive(Clone)]
pub struct Camera(pub spikelane::Camera);

impl Camera {
    pub fn load(path: &str) -> Result<Self> {
        effects::Catalogue::new().open(Path::new(path)).map(Self)
    }

    pub fn ideal(width: u32, height: u32, readout_hz: f64) -> Result<Self> {
        Ok(Self(spikelane::Camera::ideal(Sensor::new(width, height, readout_hz)?)))
    }

    /// Changes the camera by `change`, or leaves it as it was.
    fn change(&mut self, change: impl FnOnce(spikelane::Camera) -> Result<spikelane::Camera>) -> Result<()> {
        self.0 = change(self.0.clone())?;
        Ok(())
    }

    pub fn set_effect(
        &mut self,
        name: &str,
        set: impl FnOnce(effects::Effect) -> Result<effects::Effect>,
    ) -> Result<()> {
        let definition = effects::find(name)?;
        // An effect that is not there starts from neutral, as those of camera files do.
        let effect = self.0.effect(name).cloned().unwrap_or_else(|| definition.neutral());
        let effect = set(effect)?;
        self.change(|camera| Ok(camera.with(effect)))
    }

    pub fn without(&mut self, name: &str) -> Result<()> {
        effects::find(name)?;
        self.change(|camera| Ok(camera.without(name)))
    }

    pub fn set_sensor(&mut self, key: &str, value: f64) -> Result<()> {
        self.change(|mut camera| {
            let sensor = &mut camera.sensor;
            let names = ["readout_hz", "capacitance_ff", "swing_v", "thresholds_at_full_scale"];
            *match key {
                "readout_hz" => &mut sensor.readout_hz,
                "capacitance_ff" => &mut sensor.capacitance_ff,
                "swing_v" => &mut sensor.swing_v,
                "thresholds_at_full_scale" => &mut sensor.thresholds_at_full_scale,
                _ => {
                    let error = usage("key", key, names.join(", "), "give one of them");
                    return Err(error.or_nearest(key, names));
                }
            } = value;
            camera.sensor = camera.sensor.validated()?;
            Ok(camera)
        })
    }

    pub fn set_map(&mut self, name: &str, values: &[f64]) -> Result<()> {
        let geometry = self.0.whole_geometry();
        if values.len() != geometry.pixels() || values.iter().any(|v| !v.is_finite()) {
            return Err(usage(
                "values",
                format_args!("{} numbers, or one that is not finite", values.len()),
                format_args!("{} finite numbers, the pixels of {geometry}", geometry.pixels()),
                "give the map of the whole sensor, row by row",
            ));
        }
        let maps = &mut self.0.maps;
        let names = ["gain", "dark_pa", "capacitance_ff", "swing_v"];
        *match name {
            "gain" => &mut maps.gain,
            "dark_pa" => &mut maps.dark_pa,
            "capacitance_ff" => &mut maps.capacitance_ff,
            "swing_v" => &mut maps.swing_v,
            _ => {
                let error = usage("map", name, names.join(", "), "give one of them");
                return Err(error.or_nearest(name, names));
            }
        } = Some(values.to_vec());
        Ok(())
    }

    pub fn resize(&mut self, width: u32, height: u32) -> Result<()> {
        if self.0.place().is_some() || self.0.maps != effects::Maps::default() {
            return Err(usage(
                "camera",
                "a window, or a camera with maps",
                "a whole sensor without maps",
                "resize the camera first, or cut a window of it",
            ));
        }
        self.0.sensor.geometry = Geometry::new(width, height)?;
        Ok(())
    }

    pub fn window(&self, col: u32, row: u32, width: u32, height: u32) -> Result<Self> {
        let [x, y, width, height] = [col, row, width, height].map(|n| n as usize);
        self.0.window(Crop { x, y, width, height }).map(Self)
    }
}
