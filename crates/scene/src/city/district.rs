//! What kind of district a city is.

/// The character of a district.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum District {
    /// Closed fronts of brick and plaster with pitched roofs.
    Old,
    /// Tall concrete and glass.
    Downtown,
    /// Detached houses in gardens.
    Suburb,
}
