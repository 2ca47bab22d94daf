//! A driving scene as light: one frame per readout.

use crate::error::{Error, Kind, Result};
use crate::light::{Frame, OwnedSamples, Rate, Source};
use crate::scene::{self, KeyPlan, Rendered, Scene, Warp};
use crate::spikes::Geometry;

/// The light of a scene at every readout, in units of a white luminance.
///
/// Key frames are rendered; readouts between two of them are warped, on all threads at once.
/// Memory holds two key frames and the readouts between them.
pub struct Drive {
    scene: Scene,
    plan: KeyPlan,
    white_cd_m2: f32,
    geometry: Geometry,
    rate: Rate,
    samples: scene::SamplesPerPixel,
    threads: usize,
    keys: Option<(usize, Rendered, Rendered)>,
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
            keys: None,
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

    /// Prepares the readouts from key frame `k` up to the next one.
    fn stretch(&mut self, k: usize) -> Result<()> {
        let from = self.plan.keys[k];
        self.ready_from = from;
        let Some(&to) = self.plan.keys.get(k + 1) else {
            // The last key frame is the last readout.
            let light = match self.keys.take() {
                Some((key, _, late)) if key + 1 == k => late.light,
                _ => self.render(from)?.light,
            };
            self.ready = vec![light];
            return Ok(());
        };
        let early = match self.keys.take() {
            Some((key, _, late)) if key + 1 == k => late,
            _ => self.render(from)?,
        };
        let late = self.render(to)?;
        self.ready = warped(&self.scene, &early, &late, &self.plan.readouts[from..to], self.threads)?;
        self.keys = Some((k, early, late));
        Ok(())
    }
}

/// Light at `times`, shared between threads in runs of neighbours.
fn warped(
    scene: &Scene,
    early: &Rendered,
    late: &Rendered,
    times: &[f64],
    threads: usize,
) -> Result<Vec<Vec<f32>>> {
    let warp = Warp::new(scene, early, late)?;
    let each = times.len().div_ceil(threads).max(1);
    let one = |part: &[f64]| part.iter().map(|&t| warp.light(t)).collect::<Result<Vec<_>>>();
    if threads == 1 || times.len() == 1 {
        return one(times);
    }
    std::thread::scope(|scope| {
        let parts: Vec<_> = times.chunks(each).map(|part| scope.spawn(move || one(part))).collect();
        let mut all = Vec::with_capacity(times.len());
        for part in parts {
            let part = part.join().map_err(|_| Error::new(Kind::Io, "a thread that warps light"))?;
            all.extend(part?);
        }
        Ok(all)
    })
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
            let k = self.plan.keys.partition_point(|&key| key <= self.next) - 1;
            self.stretch(k)?;
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
            "driving scene {} ({}), {} readouts, {} key frames, up to {:.3} px per readout",
            self.scene.seed(),
            self.scene.lighting().name(),
            self.plan.readouts.len(),
            self.plan.keys.len(),
            self.plan.max_px_per_readout
        )
    }
}
