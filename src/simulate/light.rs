//! The light of a run: the form that callers pass, and the form that kernels use.

use crate::count::Count;
use crate::error::{Result, Setting, error};
use crate::kernels::{Samples, Segment, SegmentLight};
use crate::light::Timeline;
use crate::light::full_scale::check_float_light;
use crate::simulate::FrameRef;
use crate::simulate::frame_ref::DenseFrame;
use crate::simulate::frame_sequence::FrameSequence;
use crate::spikes::Geometry;

/// The light during the readouts of one call.
///
/// [`Samples`], a slice of samples, a [`FrameRef`] or a [`Frame`](crate::light::Frame) convert to light that is constant during the whole call.
///
/// # Examples
/// ```
/// use spikelane::light::{Interpolation, Timeline};
/// use spikelane::{Camera, FrameRef, Light, Seeds, Sensor, Simulator};
/// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(4, 2, 20_000.0)?), Seeds::default())?;
/// let (dark, bright) = (vec![0u8; 8], vec![255u8; 8]);
///
/// // One frame for ten readouts.
/// simulator.run(&bright, 10)?;
///
/// // A straight line from one frame to another, with a weight of the second frame for each of four readouts.
/// simulator.run(Light::linear(&dark, &bright, &[0.0, 0.25, 0.5, 0.75]), 4)?;
///
/// // Frames along a timeline: a new frame every 20 readouts, linear in between.
/// let frames = [FrameRef::new(&dark), FrameRef::new(&bright)];
/// let timeline = Timeline::from_readouts_per_frame(20, Interpolation::Linear)?;
/// let spikes = simulator.run(Light::sequence(&frames, &timeline), 40)?;
/// assert_eq!(spikes.readouts(), 40);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Light<'a> {
    source: Source<'a>,
    /// Whether floats that are probably codes are accepted.
    is_any_brightness: bool,
}

#[derive(Clone, Debug)]
enum Source<'a> {
    Hold(FrameRef<'a>),
    Linear { from: FrameRef<'a>, to: FrameRef<'a>, weights: &'a [f32] },
    Sequence { frames: &'a [FrameRef<'a>], timeline: &'a Timeline },
}

impl<'a> Light<'a> {
    const fn from_source(source: Source<'a>) -> Self {
        Self { source, is_any_brightness: false }
    }

    /// Returns this light with floats of any brightness. Otherwise, floats of 0 to 255 at the first readout are an error,
    /// because they are probably codes.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Light, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(4, 2, 20_000.0)?), Seeds::default())?;
    /// let bright = [255.0_f32; 8];
    /// assert!(simulator.run(&bright, 10).is_err());
    /// // Every pixel fires at every readout, because the sensor clips the light.
    /// assert_eq!(simulator.run(Light::hold(&bright).with_any_brightness(), 10)?.spikes(), 10 * 8);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub const fn with_any_brightness(mut self) -> Self {
        self.is_any_brightness = true;
        self
    }

    /// Returns whether floats that are probably codes are accepted.
    pub(super) const fn is_any_brightness(&self) -> bool {
        self.is_any_brightness
    }

    /// Returns light that is `frame` at every readout.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Light, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(4, 2, 20_000.0)?), Seeds::default())?;
    /// // Half of full scale: every pixel fires at every second readout.
    /// assert_eq!(simulator.run(Light::hold(&[0.5f32; 8]), 10)?.spikes(), 5 * 8);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn hold(frame: impl Into<FrameRef<'a>>) -> Self {
        Self::from_source(Source::Hold(frame.into()))
    }

    /// Returns light between two frames. The light of readout `i` is `from + (to - from) * weights[i]`.
    ///
    /// A call of the simulator must run exactly one readout per weight. Weights must be within 0 to 1.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Light, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
    /// let light = Light::linear(&[0.0f32; 8], &[1.0f32; 8], &[0.25, 0.25, 0.5, 1.0]);
    /// // The charge reaches the threshold at the third readout and again at the fourth readout.
    /// assert_eq!(simulator.run(light.clone(), 4)?.as_bytes(), [0x00, 0x00, 0xff, 0xff]);
    ///
    /// let error = simulator.run(light, 5).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn linear(from: impl Into<FrameRef<'a>>, to: impl Into<FrameRef<'a>>, weights: &'a [f32]) -> Self {
        Self::from_source(Source::Linear { from: from.into(), to: to.into(), weights })
    }

    /// Returns the light of frames on a timeline. Readout 0 of the timeline is the first readout of the call of the
    /// simulator.
    ///
    /// A call of the simulator may run at most [`Timeline::readouts`] readouts. To continue with further frames in
    /// another call, pass the last frame of the earlier call as the first frame of the later call.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Interpolation, Timeline};
    /// use spikelane::{Camera, FrameRef, Light, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
    /// let (dark, bright) = ([0u8; 8], [255u8; 8]);
    /// let frames = [FrameRef::new(&dark), FrameRef::new(&bright)];
    /// let timeline = Timeline::from_readouts_per_frame(2, Interpolation::Hold)?;
    /// let spikes = simulator.run(Light::sequence(&frames, &timeline), 4)?;
    /// assert_eq!(spikes.as_bytes(), [0x00, 0x00, 0xff, 0xff]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn sequence(frames: &'a [FrameRef<'a>], timeline: &'a Timeline) -> Self {
        Self::from_source(Source::Sequence { frames, timeline })
    }
}

impl<'a> From<Samples<'a>> for Light<'a> {
    fn from(samples: Samples<'a>) -> Self {
        Self::hold(samples)
    }
}

impl<'a> From<FrameRef<'a>> for Light<'a> {
    fn from(frame: FrameRef<'a>) -> Self {
        Self::hold(frame)
    }
}

/// Samples and [`Frame`](crate::light::Frame)s convert as they do into a [`FrameRef`].
impl<'a, T: ?Sized> From<&'a T> for Light<'a>
where
    &'a T: Into<FrameRef<'a>>,
{
    fn from(frame: &'a T) -> Self {
        Self::hold(frame)
    }
}

/// Light whose frames have the size of the sensor and valid samples.
pub(super) enum ValidLight<'a> {
    Hold(DenseFrame<'a>),
    Linear { from: DenseFrame<'a>, to: DenseFrame<'a>, weights: &'a [f32] },
    Sequence(Box<FrameSequence<'a>>),
}

impl<'a> ValidLight<'a> {
    /// Checks `light` for a call of `readouts` readouts.
    ///
    /// # Errors
    /// Returns the errors of [`crate::Simulator::fill`].
    pub(super) fn new(light: Light<'a>, geometry: Geometry, readouts: usize) -> Result<Self> {
        Ok(match light.source {
            Source::Hold(frame) => Self::Hold(frame.validate(geometry)?),
            Source::Linear { from, to, weights } => {
                check_weights(weights, readouts)?;
                Self::Linear { from: from.validate(geometry)?, to: to.validate(geometry)?, weights }
            }
            Source::Sequence { frames, timeline } => {
                Self::Sequence(Box::new(FrameSequence::new(frames, timeline, geometry, readouts)?))
            }
        })
    }

    /// Rejects floats that are probably codes. Only the first frame is checked, because the check takes longer than a
    /// readout of all pixels.
    ///
    /// # Errors
    /// Returns the error of [`check_float_light`].
    pub(super) fn check_codes(&self) -> Result<()> {
        let samples = match self {
            Self::Hold(frame) | Self::Linear { from: frame, .. } => frame.samples(),
            Self::Sequence(frames) => frames.current(),
        };
        let Samples::F32(values) = samples else { return Ok(()) };
        check_float_light(values, "light", "").map_err(|e| {
            e.remedy(format_args!(
                "divide codes by 255, or set {} to the brightest light",
                Setting("max_light")
            ))
        })
    }

    /// Returns a segment of one readout with the light of the last readout.
    pub(super) fn last(&self) -> Segment<'_> {
        let light = match self {
            Self::Hold(frame) => SegmentLight::Hold(frame.samples()),
            Self::Linear { from, to, weights } => SegmentLight::Linear {
                from: from.samples(),
                to: to.samples(),
                weights: &weights[weights.len().saturating_sub(1)..],
            },
            Self::Sequence(frames) => SegmentLight::Hold(frames.current()),
        };
        Segment { readouts: 1, light }
    }
}

fn check_weights(weights: &[f32], readouts: usize) -> Result<()> {
    let error = || error!(Usage, "weights");
    if weights.len() != readouts {
        return Err(error()
            .found(Count(weights.len(), "weight"))
            .expected(format_args!("{readouts}, one for each readout")));
    }
    match weights.iter().find(|w| !(0.0..=1.0).contains(*w)) {
        Some(weight) => Err(error().found(weight).expected("weights within 0 to 1")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use crate::effects::Camera;
    use crate::error::ErrorKind;
    use crate::sensor::Sensor;
    use crate::simulate::SimulatorOptions;

    #[test]
    fn floats_that_are_codes_are_an_error_at_the_first_readout() {
        let camera = Camera::ideal(Sensor::new(4, 2, 20_000.0).unwrap());
        let codes = [0.0_f32, 51.0, 102.0, 153.0, 204.0, 255.0, 255.0, 255.0];
        let mut simulator = SimulatorOptions::new().build(&camera).unwrap();
        let error = simulator.run(&codes, 10).unwrap_err();
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("max_light"), "{error}");
        assert_eq!(simulator.state().readout(), 0);
        let lamp = [0.1_f32, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 255.0];
        simulator.run(&lamp, 10).unwrap();
        // The light was checked at the first readout.
        simulator.run(&codes, 10).unwrap();
    }
}
