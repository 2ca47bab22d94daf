//! A driving scene as a light source.

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::sensor::Mosaic;
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane_io::light::{Frame, Interpolation, OwnedSamples, Rate, Source, Timeline, luminance};
use spikelane_scene::{self as scene, KeyframePlan, Scene, SpanEnd};

/// Maximum duration of a span in seconds. `MAX_SPAN_BYTES` is the maximum size of the light of a span.
const MAX_SPAN_SECONDS: f64 = 25e-3;
const MAX_SPAN_BYTES: usize = 80 << 20;

/// The light of a scene, in units of white.
///
/// A frame is drawn whenever the fastest point of the image has moved by a quarter pixel. Between two frames, light
/// changes linearly; see [`Drive::timeline`]. Only the frames of one span are in memory, and a span lasts at most 25 ms.
pub struct Drive {
    scene: Scene,
    plan: KeyframePlan,
    /// Indices in `plan.readouts` of the frames.
    frames: Vec<usize>,
    /// Luminance of white at each frame in cd/m2.
    white_cd_m2: Vec<f32>,
    geometry: Geometry,
    rate: Rate,
    samples: scene::SamplesPerPixel,
    threads: usize,
    /// The color filters of the camera, or `None` for gray light.
    mosaic: Option<Mosaic>,
    /// The render of the first frame after the frames in `ready_light`.
    next_render: Option<SpanEnd>,
    ready_light: Vec<Vec<f32>>,
    first_ready_frame: usize,
    next_frame: usize,
}

impl Drive {
    /// Creates a source with the light of the first `readouts` readouts of `scene`. The readout rate is `rate`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if `readouts` is 0, or if the readouts exceed the duration of the drive.
    pub fn new(
        scene: Scene,
        rate: Rate,
        readouts: u64,
        samples: scene::SamplesPerPixel,
        threads: usize,
    ) -> Result<Self> {
        let drive = Self::with_frame_per_readout(scene, rate, readouts, samples, threads)?;
        drive.with_frames(|plan| plan.keyframes.clone())
    }

    /// Creates a source with one frame for every readout.
    ///
    /// # Errors
    /// Those of [`Drive::new`].
    pub fn with_frame_per_readout(
        scene: Scene,
        rate: Rate,
        readouts: u64,
        samples: scene::SamplesPerPixel,
        threads: usize,
    ) -> Result<Self> {
        if readouts == 0 {
            return Err(Error::new(ErrorKind::Usage, "drive")
                .found(Count(readouts, "readout"))
                .expected("at least one readout"));
        }
        let last = (readouts - 1) as f64 / rate.hz();
        let plan = scene.plan_keyframes(0.0, last, rate.hz(), threads)?;
        if plan.readouts.len() as u64 != readouts {
            return Err(Error::new(ErrorKind::Usage, "drive")
                .found(Count(plan.readouts.len(), "instant"))
                .expected(format_args!("{readouts}, one per readout")));
        }
        let here = scene.camera(0.0)?.intrinsics;
        let drive = Self {
            geometry: Geometry::new(here.width, here.height)?,
            scene,
            plan,
            frames: Vec::new(),
            white_cd_m2: Vec::new(),
            rate,
            samples,
            threads: threads.max(1),
            mosaic: None,
            next_render: None,
            ready_light: Vec::new(),
            first_ready_frame: 0,
            next_frame: 0,
        };
        drive.with_frames(|plan| (0..plan.readouts.len()).collect())
    }

    /// Sets the color filters of the camera. The frames then contain the light behind the filters, and their colors
    /// ([`Frame::rgb`]).
    ///
    /// Each frame is rendered completely. Without filters, most frames are computed from the previous frame, which is
    /// faster.
    #[must_use]
    pub fn with_mosaic(mut self, mosaic: Option<Mosaic>) -> Self {
        self.mosaic = mosaic;
        self
    }

    fn with_frames(mut self, frames: impl Fn(&KeyframePlan) -> Vec<usize>) -> Result<Self> {
        self.frames = frames(&self.plan);
        let white = |&k: &usize| self.scene.white_cd_m2(self.plan.readouts[k], self.threads);
        self.white_cd_m2 = self.frames.iter().map(white).collect::<Result<_>>()?;
        Ok(self)
    }

    /// Returns the timeline that maps readouts to the frames of this source.
    ///
    /// # Errors
    /// Those of [`Timeline::from_first_readouts`].
    pub fn timeline(&self, interpolation: Interpolation) -> Result<Timeline> {
        let first_readouts: Vec<u64> = self.frames.iter().map(|&k| k as u64).collect();
        match first_readouts.len() {
            1 => Timeline::from_readouts_per_frame(1, interpolation),
            _ => Timeline::from_first_readouts(&first_readouts, interpolation),
        }
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

    /// Returns the first readout of each frame.
    #[must_use]
    pub fn first_readouts(&self) -> &[usize] {
        &self.frames
    }

    /// Returns the scene and the plan.
    #[must_use]
    pub fn into_parts(self) -> (Scene, KeyframePlan) {
        (self.scene, self.plan)
    }

    /// Returns the luminance of white in cd/m2 at a readout. Between two frames, the luminance is that of the earlier
    /// frame.
    #[must_use]
    pub fn white_cd_m2(&self, readout: usize) -> f32 {
        self.white_cd_m2[self.frames.partition_point(|&k| k <= readout).saturating_sub(1)]
    }

    /// Renders the light of one readout, in units of white.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if `readout` is not less than the number of readouts.
    pub fn light(&self, readout: u64) -> Result<Frame> {
        let at =
            usize::try_from(readout).ok().filter(|&r| r < self.plan.readouts.len()).ok_or_else(|| {
                Error::new(ErrorKind::Usage, format_args!("readout {readout}"))
                    .expected(format_args!("less than {}", self.plan.readouts.len()))
            })?;
        if let Some(mosaic) = &self.mosaic {
            return self.color_frame(mosaic, at, self.white_cd_m2(at));
        }
        let end = self.render(at);
        self.frame(end.sensor_light(&self.scene), self.white_cd_m2(at))
    }

    /// Multiplies the exposure by the positive number `factor`. The luminance of white is therefore divided by
    /// `factor`.
    pub(super) fn scale_exposure(&mut self, factor: f32) {
        self.white_cd_m2.iter_mut().for_each(|white| *white /= factor);
    }

    fn frame(&self, mut light: Vec<f32>, white_cd_m2: f32) -> Result<Frame> {
        let scale = 1.0 / white_cd_m2;
        light.iter_mut().for_each(|v| *v *= scale);
        Frame::new(self.geometry, OwnedSamples::F32(light))
    }

    /// Renders the light of a readout behind the filters of `mosaic`.
    ///
    /// The color of a pixel has the luminance of the gray light, in which the luminance of lamps is limited.
    fn color_frame(&self, mosaic: &Mosaic, readout: usize, white_cd_m2: f32) -> Result<Frame> {
        let rendered = self.scene.render(self.plan.readouts[readout], self.samples, self.threads)?;
        let color = |(rgb, light): (&[f32; 3], &f32)| {
            let rgb = rgb.map(|x| x.max(0.0));
            let luminance = luminance(rgb);
            let scale = if luminance > 0.0 { light / luminance / white_cd_m2 } else { 0.0 };
            rgb.map(|x| x * scale)
        };
        let rgb = rendered.rgb.iter().zip(&rendered.light).flat_map(color).collect();
        mosaic.light(&self.frame(rendered.light, white_cd_m2)?.with_rgb(rgb)?)
    }

    fn render(&self, readout: usize) -> SpanEnd {
        self.scene.span_end(self.plan.readouts[readout], self.samples, self.threads)
    }

    /// Renders the frames of one span, starting with frame `from`.
    fn render_span(&mut self, from: usize) {
        let first = match self.next_render.take() {
            Some(first) => first,
            None => self.render(self.frames[from]),
        };
        self.first_ready_frame = from;
        let steps = self.frames.len() - 1 - from;
        if steps == 0 {
            self.ready_light = vec![first.sensor_light(&self.scene)];
            return;
        }
        let times: Vec<f64> = self.frames[from..=from + self.span_steps(from, steps)]
            .iter()
            .map(|&k| self.plan.readouts[k])
            .collect();
        let span = self.scene.render_span(first, &times, self.samples, self.threads);
        self.ready_light = span.light;
        self.next_render = Some(span.end);
    }

    /// Returns the number of steps of the span that starts at frame `from`. `steps` steps remain.
    ///
    /// The duration of a span is limited, because the light changes even if nothing moves. The size of the span's light
    /// is limited, because the light is stored in memory. The remaining steps are divided into spans of nearly equal
    /// length. With spans of maximum length, the last span could be very short.
    fn span_steps(&self, from: usize, steps: usize) -> usize {
        let max_frames = MAX_SPAN_BYTES / (size_of::<f32>() * self.geometry.pixels());
        let lasts_s = self.plan.readouts[self.frames[from + steps]] - self.plan.readouts[self.frames[from]];
        let spans = (lasts_s / MAX_SPAN_SECONDS).ceil().max(1.0) as usize;
        steps.div_ceil(spans.max(steps.div_ceil(max_frames.max(1))))
    }
}

impl Source for Drive {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn frames(&self) -> Option<u64> {
        Some(self.frames.len() as u64)
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.next_frame >= self.frames.len() {
            return Ok(false);
        }
        if let Some(mosaic) = &self.mosaic {
            let white = self.white_cd_m2[self.next_frame];
            *into = self.color_frame(mosaic, self.frames[self.next_frame], white)?;
            self.next_frame += 1;
            return Ok(true);
        }
        if self.next_frame >= self.first_ready_frame + self.ready_light.len() {
            self.render_span(self.next_frame);
        }
        let light = std::mem::take(&mut self.ready_light[self.next_frame - self.first_ready_frame]);
        *into = self.frame(light, self.white_cd_m2[self.next_frame])?;
        self.next_frame += 1;
        Ok(true)
    }

    /// Returns the readout rate if every readout has a frame. Otherwise the frames have no constant rate.
    fn rate(&self) -> Option<Rate> {
        (self.frames.len() == self.plan.readouts.len()).then_some(self.rate)
    }

    fn describe(&self) -> String {
        format!(
            "driving scene {} ({}), white {:.4} cd/m2, {}, up to {:.3} px per readout",
            self.scene.seed(),
            self.scene.lighting().name(),
            self.white_cd_m2[0],
            Count(self.frames.len(), "frame"),
            self.plan.max_px_per_readout,
        )
    }
}
