use crate::error::Result;
use crate::variants::named_variants;

/// An implementation of the kernels. All backends return equal bits, but their speed differs.
///
/// # Examples
/// ```
/// use spikelane::{Backend, Camera, Sensor, SimulatorOptions};
/// assert_eq!("portable".parse::<Backend>()?, Backend::Portable);
/// assert_eq!(Backend::Sse41.to_string(), "sse4.1");
///
/// // The bits do not depend on the instruction set.
/// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
/// let record = |backend| SimulatorOptions::new().backend(backend).build(&camera)?.run(&[40u8; 32 * 24], 10);
/// for backend in Backend::ALL.into_iter().filter(|backend| backend.is_available()) {
///     assert_eq!(record(backend)?, record(Backend::Reference)?);
/// }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Backend {
    /// Plain scalar loops, used as the reference in tests of the other backends.
    Reference,
    /// Vectors of the `wide` crate. They use the instructions that this build was compiled for.
    Portable,
    /// 128-bit vectors of x86-64 CPUs from 2008 on.
    Sse41,
    /// 256-bit vectors of x86-64 CPUs from 2013 on.
    Avx2,
    /// 512-bit vectors (AVX-512 F, BW and VBMI).
    Avx512,
}

/// Name of the environment variable that selects a backend. The variable has no effect if the CPU cannot run the backend.
pub(super) const BACKEND_ENV_VAR: &str = "SPIKELANE_BACKEND";

named_variants!(Backend, "backend" {
    Reference = "reference", Portable = "portable", Sse41 = "sse4.1", Avx2 = "avx2", Avx512 = "avx512",
});

impl Backend {
    /// Returns whether this CPU can run the backend.
    #[must_use]
    pub fn is_available(self) -> bool {
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

    /// Returns the backend that the environment variable `SPIKELANE_BACKEND` names, or `None` if the variable is not set.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Backend;
    /// if let Some(backend) = Backend::from_environment()?
    ///     && backend.is_available()
    /// {
    ///     assert_eq!(Backend::best(), backend);
    /// }
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if no backend has this name.
    pub fn from_environment() -> Result<Option<Self>> {
        let Some(name) = std::env::var_os(BACKEND_ENV_VAR) else { return Ok(None) };
        name.to_string_lossy().parse::<Self>().map(Some).map_err(|e| e.with_context(BACKEND_ENV_VAR))
    }

    /// Returns the backend that the environment variable `SPIKELANE_BACKEND` names, if the CPU can run this backend.
    /// Otherwise returns the fastest backend of this CPU.
    ///
    /// # Examples
    /// ```
    /// assert!(spikelane::Backend::best().is_available());
    /// ```
    #[must_use]
    pub fn best() -> Self {
        let forced = Self::from_environment().ok().flatten().filter(|b| b.is_available());
        forced.unwrap_or_else(|| {
            let fastest = Self::ALL.into_iter().rev().find(|b| b.is_available());
            fastest.unwrap_or(Self::Portable)
        })
    }
}
