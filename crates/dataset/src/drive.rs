//! A driving scene as light: one frame per readout.

use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane_io::light::{Frame, OwnedSamples, Rate, Source};
use spikelane_scene::{self as scene, KeyPlan, Rendered, Scene};

/// Readouts of a span lie within this time, and their light within this many bytes.
const LONGEST_S: f64 = 5e-3;
const LONGEST_BYTES: usize = 64 << 20;

/// The light of a scene at every readout, in units of a white luminance.
///
/// The picture is rendered in tiles, each as often as what it shows moves by two fifths of a pixel; readouts between
/// are carried along the motion. Memory holds the readouts of a span of at most 5 ms.
pub struct Drive {
    scene: Scene,
    plan: KeyPlan,
    white_cd_m2: f32,
    geometry: Geometry,
    rate: Rate,
    samples: scene::SamplesPerPixel,
    threads: usize,
    /// The render of the readout behind those that are ready.
    following: Option<Rendered>,
    ready: Vec<Vec<f32>>,
    ready_from: usize,
    next: usize,
}

impl Drive {
    /// `readouts` frames of `scene` from its start, `rate` a second. Light is 1.0 at
    /// `white_cd_m2`, by default the scene's own white; what is brighter exceeds 1.
    ///
    /// # Errors
    /// [`Kind::Usage`] for no readouts, a white that is not positive, or readouts beyond the drive.
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
            return Err(Error::new(Kind::Usage, "drive")
                .found(format_args!("{readouts} readouts, white at {white} cd/m2"))
                .expected("at least one readout and a positive luminance"));
        }
        let last = (readouts - 1) as f64 / rate.hz();
        let plan = scene.keyframes(0.0, last, rate.hz(), threads)?;
        if plan.readouts.len() as u64 != readouts {
            return Err(Error::new(Kind::Usage, "drive")
                .found(format_args!("{} instants", plan.readouts.len()))
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
            following: None,
            ready: Vec::new(),
            ready_from: 0,
            next: 0,
        })
    }

    /// The scene.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Instants and key frames.
    #[must_use]
    pub const fn plan(&self) -> &KeyPlan {
        &self.plan
    }

    /// The luminance of full scale.
    #[must_use]
    pub const fn white_cd_m2(&self) -> f32 {
        self.white_cd_m2
    }

    /// The light of one readout, rendered for it, in units of the white luminance.
    ///
    /// # Errors
    /// [`Kind::Usage`] beyond the last readout; as [`Scene::render`].
    pub fn light(&self, readout: u64) -> Result<Frame> {
        let at =
            usize::try_from(readout).ok().filter(|&r| r < self.plan.readouts.len()).ok_or_else(|| {
                Error::new(Kind::Usage, format_args!("readout {readout}"))
                    .expected(format_args!("less than {}", self.plan.readouts.len()))
            })?;
        let scale = 1.0 / self.white_cd_m2;
        let light = self.render(at)?.light.into_iter().map(|v| v * scale).collect();
        Frame::new(self.geometry, OwnedSamples::F32(light))
    }

    /// Exposes all light by `factor`, which is positive: full scale then is a luminance so much higher.
    pub(super) fn expose(&mut self, factor: f32) {
        self.white_cd_m2 /= factor;
    }

    fn render(&self, readout: usize) -> Result<Rendered> {
        self.scene.render(self.plan.readouts[readout], self.samples, self.threads)
    }

    /// Prepares the readouts from `from` on, up to the end of its span.
    fn stretch(&mut self, from: usize) -> Result<()> {
        let first = match self.following.take() {
            Some(first) => first,
            None => self.render(from)?,
        };
        self.ready_from = from;
        let steps = self.plan.readouts.len() - 1 - from;
        if steps == 0 {
            self.ready = vec![first.light];
            return Ok(());
        }
        // Spans of about equal length, so that none is short at the end.
        let to = from + steps.div_ceil(steps.div_ceil(self.longest()));
        let span = self.scene.span(first, &self.plan.readouts[from..=to], self.samples, self.threads);
        self.ready = span.light;
        self.following = Some(span.last);
        Ok(())
    }

    /// Steps of the longest span: lights change even where nothing moves, and memory ends.
    fn longest(&self) -> usize {
        let most = LONGEST_BYTES / (size_of::<f32>() * self.geometry.pixels());
        ((LONGEST_S * self.rate.hz()) as usize).min(most).max(1)
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
        if self.next >= self.plan.readouts.len() {
            return Ok(false);
        }
        if self.next >= self.ready_from + self.ready.len() {
            self.stretch(self.next)?;
        }
        let light = std::mem::take(&mut self.ready[self.next - self.ready_from]);
        let scale = 1.0 / self.white_cd_m2;
        *into = Frame::new(self.geometry, OwnedSamples::F32(light.into_iter().map(|v| v * scale).collect()))?;
        self.next += 1;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        Some(self.rate)
    }

    fn describe(&self) -> String {
        format!(
            "driving scene {} ({}), {} readouts, up to {:.3} px per readout",
            self.scene.seed(),
            self.scene.lighting().name(),
            self.plan.readouts.len(),
            self.plan.max_px_per_readout
        )
    }
}
