//! The token of AVX-512, and index tables that `avx512` and `avx512_counts` use.

/// Proof that the CPU has the instructions; only [`Avx512::detect`] creates one.
#[derive(Clone, Copy, Debug)]
pub(in crate::kernels) struct Avx512(());

impl Avx512 {
    /// Returns the token if this CPU has AVX-512 F, BW and VBMI.
    pub(crate) fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512vbmi");
        has.then_some(Self(()))
    }
}

const fn words(start: i16) -> [i16; 32] {
    let mut index = [0; 32];
    let mut i = 0;
    while i < 32 {
        index[i] = start + 2 * i as i16;
        i += 1;
    }
    index
}

/// Indices of the even words and of the odd words of two vectors.
pub(in crate::kernels) static EVEN_WORDS: [i16; 32] = words(0);
pub(in crate::kernels) static ODD_WORDS: [i16; 32] = words(1);
