//! Methods that set one public field each, for options that others may grow by.

/// `with_methods!(Options { with_seed: seed: u64 })` gives `Options::with_seed(self, u64) -> Self`.
#[macro_export]
macro_rules! with_methods {
    ($owner:ty { $($method:ident: $field:ident: $kind:ty),+ $(,)? }) => {
        impl $owner {
            $(
                #[doc = concat!("The same with another [`", stringify!($field), "`](Self::", stringify!($field), ").")]
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
