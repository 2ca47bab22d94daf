//! The kinds of city districts.

/// The character of a district.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum District {
    /// Closed rows of brick and plaster facades with pitched roofs.
    OldTown,
    /// Tall buildings of concrete and glass.
    Downtown,
    /// Detached houses in gardens.
    Suburb,
}
