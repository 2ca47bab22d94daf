//! A driving scene as a light source with one frame per readout.

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane_io::light::{Frame, OwnedSamples, Rate, Source};
use spikelane_scene::{self as scene, KeyframePlan, RenderedFrame, Scene};

/// Maximum duration of a span in seconds. `MAX_SPAN_BYTES` is the maximum size of the light of a span.
const MAX_SPAN_SECONDS: f64 = 5e-3;
const MAX_SPAN_BYTES: usize = 64 << 20;

/// The light of a scene at every readout, in units of a white luminance.
///
/// The image is rendered in tiles. A tile is rendered again after its content has moved by about 0.4 px. Between two
/// renders, the light is warped along the motion. Only the readouts of one span are in memory, and a span lasts at
/// most 5 ms.
pub struct Drive {
    scene: Scene,
    plan: KeyframePlan,
    white_cd_m2: f32,
    geometry: Geometry,
    rate: Rate,
    samples: scene::SamplesPerPixel,
    threads: usize,
    /// The render of the first readout after the readouts in `ready_light`.
    next_render: Option<RenderedFrame>,
    ready_light: Vec<Vec<f32>>,
    first_ready_readout: usize,
    next_readout: usize,
}

impl Drive {
    /// Creates a source with the light of the first `readouts` readouts of `scene`. The readout rate is `rate`.
    ///
    /// Light 1.0 is the luminance `white_cd_m2`. If `white_cd_m2` is `None`, the scene's own white is used. Brighter
    /// points have light above 1.0.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if `readouts` is 0, if `white_cd_m2` is not positive, or if the readouts exceed the
    /// duration of the drive.
    pub fn new(
        scene: Scene,
        rate: Rate,
        readouts: u64,
        white_cd_m2: Option<f32>,
        samples: scene::SamplesPerPixel,
        threads: usize,
    ) -> Result<Self> {
        let white = white_cd_m2.unwrap_or(scene.white_cd_m2());
        if readouts == 0 || !(white.is_finite() && white > 0.0) {
            return Err(Error::new(ErrorKind::Usage, "drive")
                .found(format_args!("{}, white at {white} cd/m2", Count(readouts, "readout")))
                .expected("at least one readout and a positive luminance"));
        }
        let last = (readouts - 1) as f64 / rate.hz();
        let plan = scene.plan_keyframes(0.0, last, rate.hz(), threads)?;
        if plan.readouts.len() as u64 != readouts {
            return Err(Error::new(ErrorKind::Usage, "drive")
                .found(Count(plan.readouts.len(), "instant"))
                .expected(format_args!("{readouts}, one per readout")));
        }
        let here = scene.camera(0.0)?.intrinsics;
        Ok(Self {
            geometry: Geometry::new(here.width, here.height)?,
            scene,
            plan,
            white_cd_m2: white,
            rate,
            samples,
            threads: threads.max(1),
            next_render: None,
            ready_light: Vec::new(),
            first_ready_readout: 0,
            next_readout: 0,
        })
    }

    /// Returns the scene.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the plan, which contains the instants of the readouts and the keyframes.
    #[must_use]
    pub const fn plan(&self) -> &KeyframePlan {
        &self.plan
    }

    /// Returns the luminance of light 1.0 in cd/m2.
    #[must_use]
    pub const fn white_cd_m2(&self) -> f32 {
        self.white_cd_m2
    }

    /// Renders the light of one readout, in units of the white luminance.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if `readout` is not less than the number of readouts.
    pub fn light(&self, readout: u64) -> Result<Frame> {
        let at =
            usize::try_from(readout).ok().filter(|&r| r < self.plan.readouts.len()).ok_or_else(|| {
                Error::new(ErrorKind::Usage, format_args!("readout {readout}"))
                    .expected(format_args!("less than {}", self.plan.readouts.len()))
            })?;
        let scale = 1.0 / self.white_cd_m2;
        let light = self.render(at)?.light.into_iter().map(|v| v * scale).collect();
        Frame::new(self.geometry, OwnedSamples::F32(light))
    }

    /// Multiplies the exposure by the positive number `factor`. The luminance of light 1.0 is therefore divided by
    /// `factor`.
    pub(super) fn scale_exposure(&mut self, factor: f32) {
        self.white_cd_m2 /= factor;
    }

    fn render(&self, readout: usize) -> Result<RenderedFrame> {
        self.scene.render(self.plan.readouts[readout], self.samples, self.threads)
    }

    /// Renders the readouts of one span, starting with readout `from`.
    fn render_span(&mut self, from: usize) -> Result<()> {
        let first = match self.next_render.take() {
            Some(first) => first,
            None => self.render(from)?,
        };
        self.first_ready_readout = from;
        let steps = self.plan.readouts.len() - 1 - from;
        if steps == 0 {
            self.ready_light = vec![first.light];
            return Ok(());
        }
        // The remaining steps are divided into spans of nearly equal length. With spans of maximum length, the last
        // span could be very short.
        let to = from + steps.div_ceil(steps.div_ceil(self.max_span_steps()));
        let span = self.scene.render_span(first, &self.plan.readouts[from..=to], self.samples, self.threads);
        self.ready_light = span.light;
        self.next_render = Some(span.last_frame);
        Ok(())
    }

    /// Returns the maximum number of steps of a span.
    ///
    /// The duration of a span is limited, because the light changes even if nothing moves. The size of the span's light
    /// is limited, because the light is stored in memory.
    fn max_span_steps(&self) -> usize {
        let max_frames = MAX_SPAN_BYTES / (size_of::<f32>() * self.geometry.pixels());
        ((MAX_SPAN_SECONDS * self.rate.hz()) as usize).min(max_frames).max(1)
    }
}

impl Source for Drive {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn frames(&self) -> Option<u64> {
        Some(self.plan.readouts.len() as u64)
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.next_readout >= self.plan.readouts.len() {
            return Ok(false);
        }
        if self.next_readout >= self.first_ready_readout + self.ready_light.len() {
            self.render_span(self.next_readout)?;
        }
        let light = std::mem::take(&mut self.ready_light[self.next_readout - self.first_ready_readout]);
        let scale = 1.0 / self.white_cd_m2;
        *into = Frame::new(self.geometry, OwnedSamples::F32(light.into_iter().map(|v| v * scale).collect()))?;
        self.next_readout += 1;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        Some(self.rate)
    }

    fn describe(&self) -> String {
        format!(
            "driving scene {} ({}), white {} cd/m2, {}, up to {:.3} px per frame",
            self.scene.seed(),
            self.scene.lighting().name(),
            self.white_cd_m2,
            Count(self.plan.readouts.len(), "frame"),
            self.plan.max_px_per_readout,
        )
    }
}
