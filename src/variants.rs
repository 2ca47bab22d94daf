//! Macros for enums whose variants have names.

/// `variant_names!(Color { Red = "red", Blue = "blue" })` defines `Color::ALL`, `Color::name` and `Display`.
#[doc(hidden)]
#[macro_export]
macro_rules! variant_names {
    ($owner:ident { $($variant:ident = $name:literal),+ $(,)? }) => {
        impl $owner {
            #[doc = concat!("All values: ", $("`", $name, "` "),+)]
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// Returns the name in arguments, files and reports.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),+
                }
            }
        }

        impl std::fmt::Display for $owner {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

/// `named_variants!(Color, "color" { Red = "red", Blue = "blue" })` also defines `FromStr`. Errors are about `color`.
#[doc(hidden)]
#[macro_export]
macro_rules! named_variants {
    ($owner:ident, $subject:literal { $($variants:tt)+ }) => {
        $crate::variant_names!($owner { $($variants)+ });

        impl std::str::FromStr for $owner {
            type Err = $crate::Error;

            /// Returns the value with this name.
            ///
            /// # Errors
            /// An error of the kind `Usage` if no value has this name. The error lists all names.
            fn from_str(name: &str) -> $crate::Result<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name).ok_or_else(|| {
                    let names = Self::ALL.map(Self::name);
                    $crate::error::error!(Usage, $subject; found "`{name}`"; expected "{}", $crate::variants::one_of(&names))
                        .with_suggestion(name, names)
                })
            }
        }
    };
}

pub use {named_variants, variant_names};

/// Returns `a, b or c`.
#[doc(hidden)]
#[must_use]
pub fn one_of(names: &[&str]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => names.concat(),
    }
}
