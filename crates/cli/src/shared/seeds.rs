//! The three seeds, each with one name and one default in every command.

use spikelane::unstable::draws::Seeds;

/// Which noise and which camera of its kind.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct SeedArgs {
    /// Seed of the temporal noise and the start charge
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub seed: u64,
    #[command(flatten)]
    camera: CameraSeed,
}

/// Which camera of its kind.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct CameraSeed {
    /// Seed of the fixed pattern: which camera of its kind it is
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub camera_seed: u64,
}

/// Which scene.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct SceneSeed {
    /// Seed of what is drawn: the scene, its light and its traffic
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
