//! A macro for builder methods of option types.

/// `with_methods!(Options { with_seed: seed: u64 })` defines `Options::with_seed(self, seed: u64) -> Self`.
#[doc(hidden)]
#[macro_export]
macro_rules! with_methods {
    ($owner:ty { $($method:ident: $field:ident: $kind:ty),+ $(,)? }) => {
        impl $owner {
            $(
                #[doc = concat!("Sets [`", stringify!($field), "`](Self::", stringify!($field), ").")]
                #[must_use]
                pub fn $method(mut self, $field: $kind) -> Self {
                    self.$field = $field;
                    self
                }
            )+
        }
    };
}

pub use with_methods;
