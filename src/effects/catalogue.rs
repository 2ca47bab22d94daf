//! The effects that there are: those of this library, and what others bring.

use crate::error::{Error, Kind, Result};

use super::ALL;
use super::definition::{Definition, Form, Param};

/// Effects by their names: all of this library ([`ALL`]), then further ones in the order in which they came.
///
/// What reads cameras and what diagnoses sensors takes one of these: [`crate::presets::load_with`],
/// `crate::diagnose::DiagnoseOptions`. A camera that has an effect already needs none to be simulated.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Catalogue {
    further: Vec<&'static Definition>,
}

impl Catalogue {
    /// The effects of this library.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// These effects and `definition`; nothing changes if it is one of them.
    ///
    /// # Errors
    /// [`Kind::Config`] when another effect has its name, or when it contradicts itself: a name that a camera file cannot hold,
    /// a parameter twice, a neutral, typical or tried value outside its range.
    pub fn with(mut self, definition: &'static Definition) -> Result<Self> {
        if self.all().any(|d| d == definition) {
            return Ok(self);
        }
        if self.all().any(|d| d.name == definition.name) {
            return Err(clash(definition.name));
        }
        check(definition).map_err(|e| e.within(format_args!("effect {}", definition.name)))?;
        self.further.push(definition);
        Ok(self)
    }

    /// All effects.
    pub fn all(&self) -> impl Iterator<Item = &'static Definition> + '_ {
        ALL.iter().chain(&self.further).copied()
    }

    /// The effect called `name`.
    ///
    /// # Errors
    /// When there is none; the error lists those there are.
    pub fn find(&self, name: &str) -> Result<&'static Definition> {
        self.all().find(|d| d.name == name).ok_or_else(|| {
            let names: Vec<_> = self.all().map(|d| d.name).collect();
            Error::new(Kind::Config, "effect")
                .found(format_args!("\"{name}\""))
                .expected(format_args!("one of {}", names.join(", ")))
                .or_nearest(name, names)
        })
    }
}

/// Two effects of one name.
pub(super) fn clash(name: &str) -> Error {
    Error::new(Kind::Config, format_args!("effect {name}"))
        .found("another effect of this name")
        .expected("names that no other effect has")
        .remedy("rename the one that is brought")
}

fn check(definition: &Definition) -> Result<()> {
    let plain = |name: &str| {
        let letters = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        !name.is_empty() && name.chars().all(letters)
    };
    for (i, param) in definition.params.iter().enumerate() {
        if !plain(param.key) || definition.params[..i].iter().any(|p| p.key == param.key) {
            return Err(Error::new(Kind::Config, "parameter")
                .found(format_args!("\"{}\"", param.key))
                .expected("small letters, digits and _, each key once"));
        }
        check_values(param).map_err(|e| e.within(param.key))?;
    }
    if plain(definition.name) {
        return Ok(());
    }
    Err(Error::new(Kind::Config, "name")
        .found(format_args!("\"{}\"", definition.name))
        .expected("small letters, digits and _"))
}

fn check_values(param: &Param) -> Result<()> {
    param.check(param.neutral)?;
    param.check(param.typical)?;
    let Some(tried) = param.tried else { return Ok(()) };
    if let Form::Choice(_) = param.form {
        return Err(Error::new(Kind::Config, "tried").found("a choice of words").expected("a number"));
    }
    let (low, high) = tried.range;
    let inside = |value: &f64| (low..=high).contains(value) && param.check(*value).is_ok();
    if tried.values.iter().all(inside) && low.is_finite() && high.is_finite() {
        return Ok(());
    }
    Err(Error::new(Kind::Config, "tried")
        .found(format_args!("{:?} in {low} to {high}", tried.values))
        .expected(format_args!("values in a finite range, within {}", param.range())))
}

/// The effect of this library that is called `name`.
///
/// # Errors
/// When there is none; the error lists those there are.
pub fn find(name: &str) -> Result<&'static Definition> {
    Catalogue::new().find(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::definition::Tried;
    use crate::units::Unit;

    const SHARE: Param = Param::number("share", Unit::One, (0.0, 1.0), 0.0, 0.1, "share");

    #[test]
    fn every_effect_of_the_library_could_be_brought_from_outside() {
        for definition in ALL {
            check(definition).unwrap_or_else(|e| panic!("{}: {e}", definition.name));
        }
    }

    #[test]
    fn a_name_that_is_taken_is_refused() {
        static LEAK: Definition = Definition::new("leak", "", "", &[]);
        static NEW: Definition = Definition::new("new", "", "", &[]);
        static NEWER: Definition = Definition::new("new", "", "", &[]);
        assert_eq!(Catalogue::new().with(&LEAK).unwrap_err().kind(), Kind::Config);
        let one = Catalogue::new().with(&NEW).unwrap();
        assert_eq!(one.clone().with(&NEW).unwrap(), one, "the same again");
        assert!(one.with(&NEWER).unwrap_err().to_string().contains("effect new"));
    }

    #[test]
    fn a_definition_that_contradicts_itself_is_refused() {
        static SPACED: Definition = Definition::new("two words", "", "", &[]);
        static TWICE: Definition = Definition::new("twice", "", "", &[SHARE, SHARE]);
        static NEUTRAL: [Param; 1] = [Param::number("share", Unit::One, (0.5, 1.0), 0.0, 0.6, "share")];
        static OUTSIDE: Definition = Definition::new("outside", "", "", &NEUTRAL);
        static BEYOND: [Param; 1] = [SHARE.tried(Tried::amplitude((0.0, 2.0), &[1.5]))];
        static TRIED: Definition = Definition::new("tried", "", "", &BEYOND);
        for definition in [&SPACED, &TWICE, &OUTSIDE, &TRIED] {
            let error = Catalogue::new().with(definition).unwrap_err();
            assert_eq!(error.kind(), Kind::Config, "{}", definition.name);
        }
    }
}
