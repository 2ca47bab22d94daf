//! The catalog of effects. It contains the effects of this library and the effects that other crates add.

use crate::error::{Error, Result, bail, error};

use super::ALL;
use super::definition::{Definition, Param, ParamKind};

/// A list of effects that can be found by name.
///
/// A catalog contains the effects of this library ([`ALL`]) first, then the added effects in the order of addition.
/// Functions that read cameras require a catalog, for example [`Catalog::load`]. The diagnosis of sensors also requires a
/// catalog. The simulation of a camera requires no catalog.
///
/// # Examples
/// ```
/// use spikelane::effects::{self, Catalog, Definition};
/// static GLOW: Definition = Definition::new("glow", "Electronics shine on the pixels.", "an example", &[]);
/// let catalog = Catalog::new().with_definition(&GLOW)?;
/// assert_eq!(catalog.find("glow")?.summary, "Electronics shine on the pixels.");
/// assert_eq!(catalog.all().count(), effects::ALL.len() + 1);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Catalog {
    extra_definitions: Vec<&'static Definition>,
}

impl Catalog {
    /// Returns a catalog with the effects of this library only.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::{self, Catalog};
    /// assert!(Catalog::new().all().eq(effects::ALL.iter().copied()));
    /// ```
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns this catalog with `definition` added. A catalog that already contains `definition` is unchanged.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::{Catalog, Definition};
    /// static SECOND_PRNU: Definition = Definition::new("prnu", "A name that the library uses.", "an example", &[]);
    /// let error = Catalog::new().with_definition(&SECOND_PRNU).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Config);
    /// assert_eq!(error.parts().remedy, "rename your effect");
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if another effect has the same name, or if the definition contradicts itself. A
    /// contradiction is a name that a camera file cannot contain, a repeated parameter key, or a neutral, typical or
    /// search value outside its range.
    pub fn with_definition(mut self, definition: &'static Definition) -> Result<Self> {
        if self.all().any(|d| d == definition) {
            return Ok(self);
        }
        if self.all().any(|d| d.name == definition.name) {
            return Err(name_clash_error(definition.name));
        }
        check_definition(definition)
            .map_err(|e| e.with_context(format_args!("effect {}", definition.name)))?;
        self.extra_definitions.push(definition);
        Ok(self)
    }

    /// Returns all effects. The effects of the library are first.
    pub fn all(&self) -> impl Iterator<Item = &'static Definition> + '_ {
        ALL.iter().chain(&self.extra_definitions).copied()
    }

    /// Returns the effect called `name`.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if no effect is called `name`. The error lists the names of all effects.
    pub fn find(&self, name: &str) -> Result<&'static Definition> {
        self.all().find(|d| d.name == name).ok_or_else(|| {
            let names: Vec<_> = self.all().map(|d| d.name).collect();
            error!(Config, "effect"; found "\"{name}\""; expected "one of {}", names.join(", "))
                .with_suggestion(name, names)
        })
    }
}

/// Returns the error for two effects with the same name.
pub(super) fn name_clash_error(name: &str) -> Error {
    error!(Config, "effect {name}"; found "two effects with this name";
        expected "a different name for each effect"; remedy "rename your effect")
}

fn check_definition(definition: &Definition) -> Result<()> {
    let is_plain = |name: &str| {
        let letters = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        !name.is_empty() && name.chars().all(letters)
    };
    for (i, param) in definition.params.iter().enumerate() {
        if !is_plain(param.key) || definition.params[..i].iter().any(|p| p.key == param.key) {
            bail!(Config, "parameter"; found "\"{}\"", param.key;
                expected "lowercase letters, digits and _, each key once");
        }
        check_values(param).map_err(|e| e.with_context(param.key))?;
    }
    if is_plain(definition.name) {
        return Ok(());
    }
    Err(error!(Config, "name"; found "\"{}\"", definition.name; expected "lowercase letters, digits and _"))
}

fn check_values(param: &Param) -> Result<()> {
    param.check(param.neutral)?;
    param.check(param.typical)?;
    let Some(tried) = param.search else { return Ok(()) };
    if let ParamKind::Choice(_) = param.kind {
        bail!(Config, "search range"; found "a parameter with a choice of words";
            expected "a numeric parameter");
    }
    let (low, high) = tried.range;
    let inside = |value: &f64| (low..=high).contains(value) && param.check(*value).is_ok();
    if tried.values.iter().all(inside) && low.is_finite() && high.is_finite() {
        return Ok(());
    }
    let values: Vec<String> = tried.values.iter().map(f64::to_string).collect();
    Err(error!(Config, "search range"; found "{} in {low} to {high}", values.join(", ");
        expected "values in a finite range, within {}", param.range()))
}

/// Returns the effect of this library called `name`.
///
/// # Examples
/// ```
/// use spikelane::effects;
/// assert_eq!(effects::find("flicker")?.params.len(), 3);
///
/// let error = effects::find("fliker").unwrap_err();
/// assert_eq!(error.parts().remedy, "did you mean flicker?");
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if no effect is called `name`. The error lists the names of all effects.
pub fn find(name: &str) -> Result<&'static Definition> {
    Catalog::new().find(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;
    use crate::effects::definition::SearchSpec;
    use crate::units::Unit;

    const SHARE: Param = Param::number("share", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.1, "share");

    #[test]
    fn every_effect_of_the_library_could_be_brought_from_outside() {
        for definition in ALL {
            check_definition(definition).unwrap_or_else(|e| panic!("{}: {e}", definition.name));
        }
    }

    #[test]
    fn every_ambiguity_group_has_several_effects() {
        for group in ALL.iter().flat_map(|definition| definition.ambiguity_groups) {
            let members = ALL.iter().filter(|definition| definition.ambiguity_groups.contains(group));
            assert!(members.count() > 1, "{group:?}");
        }
    }

    #[test]
    fn a_name_that_is_taken_is_refused() {
        static LEAK: Definition = Definition::new("leak", "", "", &[]);
        static NEW: Definition = Definition::new("new", "", "", &[]);
        static NEWER: Definition = Definition::new("new", "", "", &[]);
        assert_eq!(Catalog::new().with_definition(&LEAK).unwrap_err().kind(), ErrorKind::Config);
        let one = Catalog::new().with_definition(&NEW).unwrap();
        assert_eq!(one.clone().with_definition(&NEW).unwrap(), one, "the same again");
        assert!(one.with_definition(&NEWER).unwrap_err().to_string().contains("effect new"));
    }

    #[test]
    fn a_definition_that_contradicts_itself_is_refused() {
        static SPACED: Definition = Definition::new("two words", "", "", &[]);
        static TWICE: Definition = Definition::new("twice", "", "", &[SHARE, SHARE]);
        static NEUTRAL: [Param; 1] =
            [Param::number("share", Unit::Dimensionless, (0.5, 1.0), 0.0, 0.6, "share")];
        static OUTSIDE: Definition = Definition::new("outside", "", "", &NEUTRAL);
        static BEYOND: [Param; 1] = [SHARE.with_search(SearchSpec::amplitude((0.0, 2.0), &[1.5]))];
        static TRIED: Definition = Definition::new("tried", "", "", &BEYOND);
        for definition in [&SPACED, &TWICE, &OUTSIDE, &TRIED] {
            let error = Catalog::new().with_definition(definition).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Config, "{}", definition.name);
        }
    }
}
