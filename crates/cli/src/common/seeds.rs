//! The three seeds, with the same names and defaults in every command.

use spikelane::unstable::draws::Seeds;

/// Seeds of the temporal noise and of the camera's fixed pattern.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct SeedArgs {
    /// Set the seed of the temporal noise
    ///
    /// The seed also selects the start charge of every pixel.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub seed: u64,
    #[command(flatten)]
    camera: CameraSeed,
}

/// Seed of the camera's fixed pattern.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct CameraSeed {
    /// Set the seed of the fixed pattern
    ///
    /// The seed selects one individual camera of this kind.
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub camera_seed: u64,
}

/// Seed of the scene.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct SceneSeed {
    /// Set the seed of the scene
    ///
    /// The seed selects the city, the traffic and, without --lighting, the lighting.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub scene_seed: u64,
}

impl SeedArgs {
    pub(crate) const fn camera_seed(self) -> u64 {
        self.camera.camera_seed
    }

    pub(crate) const fn seeds(self) -> Seeds {
        Seeds { camera: self.camera.camera_seed, shot: self.seed, sequence: 0 }
    }
}
