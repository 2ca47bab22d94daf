//! Camera handles. This module uses no pointers.
#![forbid(unsafe_code)]

use std::path::Path;

use spikelane::spikes::Crop;
use spikelane::{Geometry, Result, Sensor, effects};

use crate::error::usage;

/// The content of a camera handle.
#[derive(Clone)]
pub struct Camera(pub spikelane::Camera);

impl Camera {
    pub fn load(path: &str) -> Result<Self> {
        effects::Catalog::new().load_camera(Path::new(path)).map(Self)
    }

    pub fn ideal(width: u32, height: u32, readout_hz: f64) -> Result<Self> {
        Ok(Self(spikelane::Camera::ideal(Sensor::new(width, height, readout_hz)?)))
    }

    /// Replaces the camera by the result of `change`. If `change` fails, the camera is unchanged.
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
        // If the camera lacks the effect, the parameters start with neutral values, as in camera files.
        let effect = self.0.effect(name).cloned().unwrap_or_else(|| definition.neutral());
        let effect = set(effect)?;
        self.change(|camera| Ok(camera.with_effect(effect)))
    }

    pub fn remove_effect(&mut self, name: &str) -> Result<()> {
        effects::find(name)?;
        self.change(|camera| Ok(camera.without_effect(name)))
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
                    return Err(error.with_suggestion(key, names));
                }
            } = value;
            camera.sensor = camera.sensor.validate()?;
            Ok(camera)
        })
    }

    pub fn set_map(&mut self, name: &str, values: &[f64]) -> Result<()> {
        let geometry = self.0.sensor_geometry();
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
                return Err(error.with_suggestion(name, names));
            }
        } = Some(values.to_vec());
        Ok(())
    }

    pub fn resize(&mut self, width: u32, height: u32) -> Result<()> {
        if self.0.window_crop().is_some() || self.0.maps != effects::Maps::default() {
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
        let [row, col, width, height] = [row, col, width, height].map(|n| n as usize);
        self.0.window(Crop { row, col, width, height }).map(Self)
    }
}
