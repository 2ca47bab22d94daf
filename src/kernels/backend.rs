use crate::error::{Error, Kind, Result};

/// A way to run a plan. All give the same bits; they differ in speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Backend {
    /// Plain scalar loops: the oracle of the others.
    Reference,
    /// Lanes of the `wide` crate, with the instructions the crate was compiled for.
    Portable,
    /// 128-bit vectors of x86-64 CPUs from 2008 on.
    Sse41,
    /// 256-bit vectors of x86-64 CPUs from 2013 on.
    Avx2,
    /// 512-bit vectors (F, BW, VBMI).
    Avx512,
}

/// Forces a backend, clamped to what the CPU has.
pub(super) const ENVIRONMENT: &str = "SPIKELANE_BACKEND";

impl Backend {
    /// All backends, slowest first.
    pub const ALL: [Self; 5] = [Self::Reference, Self::Portable, Self::Sse41, Self::Avx2, Self::Avx512];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Portable => "portable",
            Self::Sse41 => "sse4.1",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The backend called `name`.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn parse(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|b| b.name() == name).ok_or_else(|| {
            Error::new(Kind::Usage, "backend")
                .found(format_args!("\"{name}\""))
                .expected("one of reference, portable, sse4.1, avx2, avx512")
        })
    }

    /// Whether this CPU can run it.
    #[must_use]
    pub fn available(self) -> bool {
        match self {
            Self::Reference | Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Sse41 => super::isa::sse41::Sse41::detect().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => super::isa::avx2::Avx2::detect().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => super::isa::avx512_token::Avx512::detect().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The backend that the environment variable `SPIKELANE_BACKEND` names, if it is set.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn from_environment() -> Result<Option<Self>> {
        let Some(name) = std::env::var_os(ENVIRONMENT) else { return Ok(None) };
        Self::parse(&name.to_string_lossy()).map(Some).map_err(|e| e.within(ENVIRONMENT))
    }

    /// The fastest backend of this CPU, or the one that the environment
    /// variable `SPIKELANE_BACKEND` names, if the CPU has it.
    #[must_use]
    pub fn best() -> Self {
        let forced = Self::from_environment().ok().flatten().filter(|b| b.available());
        forced.unwrap_or_else(|| {
            let fastest = Self::ALL.into_iter().rev().find(|b| b.available());
            fastest.unwrap_or(Self::Portable)
        })
    }
}

impl std::fmt::Display for Backend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
