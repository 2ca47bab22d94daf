//! The value of `--lighting`, with the same names in every command.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use spikelane_scene::Lighting;

const RANDOM: &str = "random";

/// The lighting of a drawn scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LightingArg {
    /// The scene seed selects the lighting.
    Random,
    /// The same lighting for every seed.
    Fixed(Lighting),
}

impl LightingArg {
    /// Returns the parser of the flag.
    pub(crate) fn parser() -> impl TypedValueParser<Value = Self> {
        let names = Lighting::ALL.map(Lighting::name).into_iter().chain([RANDOM]);
        PossibleValuesParser::new(names)
            .map(|name| Lighting::from_name(&name).map_or(Self::Random, Self::Fixed))
    }

    /// Returns the lighting, or `None` if the scene seed selects it.
    pub(crate) const fn fixed(self) -> Option<Lighting> {
        match self {
            Self::Random => None,
            Self::Fixed(lighting) => Some(lighting),
        }
    }
}
