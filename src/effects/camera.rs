//! A camera: a sensor and its effects.

use std::hash::{Hash as _, Hasher};

use crate::count::Count;
use crate::draws::Seeds;
use crate::error::{Result, bail};
use crate::sensor::{FrontEnd, Mosaic, Sensor};
use crate::spikes::{Crop, Geometry};
use crate::{inputs, threads};

use super::catalog::name_clash_error;
use super::circuit::Circuit;
use super::definition::{Definition, OperatingPoint};
use super::effect::Effect;
use super::model::Model;
use super::{bias_voltage, dark_current, prnu, saturation_clamp, start_phase};

/// Measured per-pixel maps. Each map replaces a fixed pattern that effects draw.
///
/// Each map has one value per pixel, row-major, top row first.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, Simulator};
/// let mut camera = Camera::ideal(Sensor::new(4, 1, 20_000.0)?);
/// // One value per pixel. Pixel 3 is insensitive.
/// camera.maps.gain = Some(vec![1.0, 1.0, 0.5, 0.0]);
/// let spikes = Simulator::new(&camera, Seeds::default())?.run(&[255u8; 4], 2)?;
/// assert_eq!(spikes.to_dense(), [1, 1, 0, 0, 1, 1, 1, 0]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Maps {
    /// Conversion gain relative to the nominal one.
    pub gain: Option<Vec<f64>>,
    /// Dark current in picoamperes.
    pub dark_pa: Option<Vec<f64>>,
    /// Capacitance in femtofarads.
    pub capacitance_ff: Option<Vec<f64>>,
    /// Threshold voltage in volts.
    pub swing_v: Option<Vec<f64>>,
}

/// A sensor with its effects, measured maps and front end.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Sensor, effects};
/// let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?)
///     .with_effect(effects::find("shot_noise")?.typical())
///     .with_effect(effects::find("prnu")?.neutral().with_value("sigma", 0.02)?);
/// // The order of the effects does not depend on the order of the calls.
/// assert_eq!(camera.effects().iter().map(|effect| effect.name()).collect::<Vec<_>>(), ["prnu", "shot_noise"]);
/// assert!(camera.effect("dark_current").is_none());
/// assert!(camera.without_effect("prnu").effect("prnu").is_none());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in reports.
    pub name: String,
    /// Source of the camera's values.
    pub source: String,
    /// Geometry, rate and nominal circuit.
    pub sensor: Sensor,
    /// Conversion from stored codes to light.
    pub front_end: FrontEnd,
    /// The color filters of the whole sensor, or `None` for a gray camera. The first pixel of a window can have another
    /// filter; see [`Camera::window_mosaic`].
    pub mosaic: Option<Mosaic>,
    effects: Vec<Effect>,
    /// Measured maps.
    pub maps: Maps,
    /// If this camera is a window: the geometry of the whole sensor, and the rectangle that this camera reads out.
    pub(super) window: Option<(Geometry, Crop)>,
}

/// Upper bound of the memory needed to draw the fixed pattern, in bytes per pixel.
///
/// The memory is enough for 16 values per pixel: the six maps of the circuit, six copies of these maps if the camera is
/// a window, and four temporary maps of an effect.
const PATTERN_BYTES_PER_PIXEL: usize = 16 * size_of::<f64>();

impl Camera {
    /// Returns a camera without imperfections whose pixels start without charge.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// let camera = Camera::ideal(Sensor::new(4, 2, 20_000.0)?);
    /// // A third of full scale: all pixels fire together at every third readout.
    /// let spikes = Simulator::new(&camera, Seeds::default())?.run(&[85u8; 8], 9)?;
    /// assert_eq!(spikes.as_bytes(), [0, 0, 0xff, 0, 0, 0xff, 0, 0, 0xff]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn ideal(sensor: Sensor) -> Self {
        Self {
            name: "ideal".to_owned(),
            source: "no effects".to_owned(),
            sensor,
            front_end: FrontEnd::default(),
            mosaic: None,
            effects: Vec::new(),
            maps: Maps::default(),
            window: None,
        }
    }

    /// Returns the effects in canonical order.
    #[must_use]
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// Returns the effect called `name` if this camera has it.
    #[must_use]
    pub fn effect(&self, name: &str) -> Option<&Effect> {
        self.effects.iter().find(|e| e.name() == name)
    }

    /// Returns this camera with `effect`, which replaces an effect of the same name.
    #[must_use]
    pub fn with_effect(mut self, effect: Effect) -> Self {
        self.effects.retain(|e| e.name() != effect.name());
        self.effects.push(effect);
        // Effects of other crates come after the library's effects, sorted by name. The order of the calls of
        // `with_effect` therefore does not matter.
        let rank =
            |e: &Effect| (super::ALL.iter().position(|d| d.name == e.name()).unwrap_or(usize::MAX), e.name());
        self.effects.sort_by_key(rank);
        self
    }

    /// Returns this camera without the effect called `name`. A camera that lacks the effect is unchanged.
    #[must_use]
    pub fn without_effect(mut self, name: &str) -> Self {
        self.effects.retain(|e| e.name() != name);
        self
    }

    /// Returns the noise-free twin of this camera. It has the same sensor, mosaic, saturation clamp and start phase, but
    /// no other effect.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Sensor, effects};
    /// let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?)
    ///     .with_effect(effects::find("start_phase")?.typical())
    ///     .with_effect(effects::find("shot_noise")?.typical());
    /// let twin = camera.clean_twin();
    /// assert_eq!(twin.effects(), [effects::find("start_phase")?.typical()]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn clean_twin(&self) -> Self {
        let mut twin = Self::ideal(self.sensor);
        twin.name = format!("{} (clean)", self.name);
        twin.source.clone_from(&self.source);
        twin.mosaic.clone_from(&self.mosaic);
        for definition in [&start_phase::EFFECT, &saturation_clamp::EFFECT] {
            if let Some(effect) = self.effect(definition.name) {
                twin = twin.with_effect(effect.clone());
            }
        }
        // The nominal threshold includes the mean offset of the comparator, so the twin adds this offset to its
        // threshold.
        if let Some(bias) = self.effect(bias_voltage::EFFECT.name) {
            twin.sensor.swing_v += bias.values()[0];
        }
        twin
    }

    /// Hashes the exact value of every property that affects the recorded bits. `name` and `source` are excluded.
    ///
    /// # Examples
    /// ```
    /// use std::hash::{DefaultHasher, Hasher};
    /// use spikelane::{Camera, Sensor};
    /// let hash = |camera: &Camera| {
    ///     let mut hasher = DefaultHasher::new();
    ///     camera.hash_exactly(&mut hasher);
    ///     hasher.finish()
    /// };
    /// let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?);
    /// let mut renamed = camera.clone();
    /// renamed.name = "another name".into();
    /// assert_eq!(hash(&renamed), hash(&camera));
    /// assert_ne!(hash(&Camera::ideal(Sensor::new(64, 48, 20_001.0)?)), hash(&camera));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    pub fn hash_exactly(&self, into: &mut impl Hasher) {
        let Self { name: _, source: _, sensor, front_end: light, mosaic, effects, maps, window } = self;
        // `Debug` writes every float with enough digits to distinguish it from all other floats.
        format!("{sensor:?} {light:?} {window:?}").hash(into);
        if let Some(mosaic) = mosaic {
            format!("{mosaic:?}").hash(into);
        }
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        effects.len().hash(into);
        for effect in effects {
            (effect.name(), bits(effect.values())).hash(into);
        }
        let Maps { gain, dark_pa, capacitance_ff, swing_v } = maps;
        for map in [gain, dark_pa, capacitance_ff, swing_v] {
            map.as_deref().map(bits).hash(into);
        }
    }

    /// Returns the operating point of a nominal pixel.
    ///
    /// `increment` is the mean charge per readout in nominal thresholds, including the charge of the dark current.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Sensor, effects};
    /// // 4.783 fC is a threshold. A dark current of 1 pA adds 0.05 fC in a readout of 50 us.
    /// let dark = effects::find("dark_current")?.neutral().with_text("mean", "1 pA")?;
    /// let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?).with_effect(dark);
    /// let point = camera.operating_point(0.2);
    /// assert!((point.from_dark - 0.05 / 4.783).abs() < 1e-5);
    /// assert_eq!(point.from_light, 0.2 - point.from_dark);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn operating_point(&self, increment: f64) -> OperatingPoint {
        let mut circuit = Circuit::without_maps(&self.sensor);
        let mean = |d: &Definition| self.effect(d.name).map_or(0.0, |e| e.values()[0]);
        circuit.nominal_v += mean(&bias_voltage::EFFECT);
        let from_dark = circuit.thresholds_per_readout(mean(&dark_current::EFFECT));
        let from_light = increment - from_dark;
        let gain = self.effect(prnu::EFFECT.name).map_or(1.0, |e| e.values()[0]);
        OperatingPoint {
            light: from_light / (gain * circuit.sensitivity),
            from_light,
            from_dark,
            electrons: circuit.electrons(),
            swing_v: circuit.nominal_v,
            capacitance_ff: circuit.nominal_ff,
            period_s: circuit.period_s,
        }
    }

    /// Draws the fixed pattern of `seeds.camera` and collects the operations of all effects.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Seeds, Sensor, effects};
    /// let prnu = effects::find("prnu")?.neutral().with_value("sigma", 0.02)?;
    /// let camera = Camera::ideal(Sensor::new(100, 100, 20_000.0)?).with_effect(prnu);
    /// let model = camera.model(Seeds { camera: 7, ..Seeds::default() })?;
    /// let variance = model.circuit.gain.iter().map(|gain| (gain - 1.0).powi(2)).sum::<f64>() / 10_000.0;
    /// assert!((variance.sqrt() - 0.02).abs() < 0.001);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if
    /// * a measured map does not match the sensor in size or contains a value that is not finite,
    /// * the effects together set the threshold of a pixel to zero or less,
    /// * an effect of another crate has the name of an effect of this library.
    ///
    /// Also returns an error if the sensor is invalid or if the pattern does not fit in memory.
    pub fn model(&self, seeds: Seeds) -> Result<Model> {
        if let Some((full_sensor, crop)) = self.whole_sensor()? {
            return full_sensor.model(seeds).map(|model| model.window(crop));
        }
        let sensor = self.sensor.validate()?;
        let geometry = sensor.geometry;
        inputs::check_memory(
            format_args!("camera of {geometry} pixels"),
            PATTERN_BYTES_PER_PIXEL * geometry.pixels(),
        )?;
        let mut circuit = Circuit::nominal(&sensor);
        let mut ops = Vec::new();
        for effect in &self.effects {
            if super::ALL.iter().any(|d| d.name == effect.name() && *d != effect.definition()) {
                return Err(name_clash_error(effect.name()));
            }
            threads::check_stop();
            effect.edit(&sensor, &mut circuit, seeds);
            ops.extend(effect.ops(&sensor));
        }
        self.maps.apply(&mut circuit)?;
        let model = Model { circuit, ops };
        model.check_thresholds()?;
        Ok(model)
    }
}

impl Maps {
    fn apply(&self, circuit: &mut Circuit) -> Result<()> {
        let pixels = circuit.pixels();
        let pairs = [
            ("gain map", &self.gain, &mut circuit.gain),
            ("dark current map", &self.dark_pa, &mut circuit.dark_pa),
            ("capacitance map", &self.capacitance_ff, &mut circuit.capacitance_ff),
            ("threshold voltage map", &self.swing_v, &mut circuit.swing_v),
        ];
        for (what, map, target) in pairs {
            let Some(map) = map else { continue };
            if map.len() != pixels || map.iter().any(|v| !v.is_finite()) {
                bail!(Config, "{what}"; found "{}", Count(map.len(), "value");
                    expected "{pixels} finite values, one per pixel");
            }
            target.clone_from(map);
        }
        Ok(())
    }
}
