//! Macros that execute instructions on values and on memory. Only the methods of tokens use these macros, because a
//! token proves that the CPU has the instructions.

/// Evaluates an instruction on values.
macro_rules! intrinsic {
    ($e:expr) => {{
        // SAFETY: `self` exists only if the CPU has the instructions, and these instructions access no memory.
        unsafe { $e }
    }};
}
/// Evaluates an expression for each vector of a pair.
///
/// The macro replaces `map`, because a closure might be compiled separately, without the instructions of its caller.
macro_rules! for_pair {
    ($v:ident => $e:expr) => {{
        let [first, second] = $v;
        [
            {
                let $v = first;
                $e
            },
            {
                let $v = second;
                $e
            },
        ]
    }};
}

/// Evaluates an expression for each index of a pair.
macro_rules! for_pair_index {
    ($i:ident => $e:expr) => {
        [
            {
                let $i = 0;
                $e
            },
            {
                let $i = 1;
                $e
            },
        ]
    };
}

/// Evaluates an instruction on the memory of a slice that has exactly the required length.
macro_rules! memory_intrinsic {
    ($e:expr) => {{
        // SAFETY: `self` exists only if the CPU has the instructions. The pointer comes from a slice that has exactly
        // the bytes that the instruction accesses. The instruction accepts any alignment.
        unsafe { $e }
    }};
}

/// Defines the methods of [`Lanes`](super::lanes::Lanes) that load, store, repeat and shift, from the instructions of a
/// vector.
macro_rules! vector_methods {
    (load $load:ident, store $store:ident, splat $splat_16:ident $splat_32:ident $splat_f:ident, shift $shift:ident) => {
        #[inline(always)]
        fn load(self, from: &[i16], at: usize) -> Self::Half {
            let from = &from[at..at + const { Self::N }];
            memory_intrinsic!($load(from.as_ptr().cast()))
        }
        #[inline(always)]
        fn store(self, to: &mut [i16], at: usize, v: Self::Half) {
            let to = &mut to[at..at + const { Self::N }];
            memory_intrinsic!($store(to.as_mut_ptr().cast(), v));
        }
        #[inline(always)]
        fn load_pairs(self, from: &[u32], at: usize) -> Self::Half {
            let from = &from[at..at + const { Self::N / 2 }];
            memory_intrinsic!($load(from.as_ptr().cast()))
        }
        #[inline(always)]
        fn splat(self, v: i16) -> Self::Half {
            intrinsic!($splat_16(v))
        }
        #[inline(always)]
        fn splat_pair(self, v: u32) -> Self::Half {
            intrinsic!($splat_32(v as i32))
        }
        #[inline(always)]
        fn splat_w(self, v: u32) -> Self::Word {
            [self.splat_pair(v); 2]
        }
        #[inline(always)]
        fn splat_f(self, v: f32) -> Self::Float {
            [intrinsic!($splat_f(v)); 2]
        }
        #[inline(always)]
        fn shr_pairs<const BITS: u32>(self, a: Self::Half) -> Self::Half {
            intrinsic!($shift(a, _mm_cvtsi32_si128(const { BITS as i32 })))
        }
        #[inline(always)]
        fn shr_w<const BITS: u32>(self, a: Self::Word) -> Self::Word {
            for_pair!(a => self.shr_pairs::<BITS>(a))
        }
        #[inline(always)]
        fn prefetch(self, line: *const u8) {
            // A prefetch does not access memory, and the CPU ignores an invalid address.
            intrinsic!(_mm_prefetch::<_MM_HINT_T0>(line.cast()));
        }
    };
}

/// Defines the methods of [`Lanes`](super::lanes::Lanes) of an instruction set whose masks are vectors and whose 32-bit
/// words are in the order that the unpack instructions produce.
macro_rules! vector_mask_methods {
    (
        select $blend:ident, saturate $subtract:ident, shift $arithmetic:ident $logical:ident,
        pack $signed:ident $unsigned:ident, unpack $low:ident $high:ident,
        greater $greater:ident, and $and:ident, load $load:ident
    ) => {
        #[inline(always)]
        fn select(self, m: Self::Mask, a: Self::Half, b: Self::Half) -> Self::Half {
            intrinsic!($blend(b, a, m))
        }
        #[inline(always)]
        fn sub_where(self, m: Self::Mask, a: Self::Half, b: Self::Half) -> Self::Half {
            self.sub(a, intrinsic!($and(m, b)))
        }
        #[inline(always)]
        fn increment_where(self, m: Self::Mask, a: Self::Half) -> Self::Half {
            intrinsic!($subtract(a, m))
        }
        #[inline(always)]
        fn not(self, m: Self::Mask) -> Self::Mask {
            self.xor(m, self.splat(-1))
        }
        #[inline(always)]
        fn shorts_to_f(self, from: &[u16], at: usize) -> Self::Float {
            let from = &from[at..at + const { Self::N }];
            let shorts = memory_intrinsic!($load(from.as_ptr().cast()));
            self.to_f(self.join(self.splat(0), shorts))
        }
        #[inline(always)]
        fn load_words(self, from: &[u32], at: usize) -> Self::Word {
            self.f_to_bits(self.load_f(bytemuck::cast_slice(from), at))
        }
        #[inline(always)]
        fn select_less_w(self, a: Self::Word, b: Self::Word, x: Self::Word, y: Self::Word) -> Self::Word {
            for_pair_index!(i => intrinsic!($blend(y[i], x[i], $greater(b[i], a[i]))))
        }
        #[inline(always)]
        fn greater_w(self, a: Self::Word, b: Self::Word) -> Self::Mask {
            intrinsic!($signed($greater(a[0], b[0]), $greater(a[1], b[1])))
        }
        #[inline(always)]
        fn select_w(self, m: Self::Mask, a: Self::Word, b: Self::Word) -> Self::Word {
            let m = self.join(m, m);
            for_pair_index!(i => intrinsic!($blend(b[i], a[i], m[i])))
        }
        #[inline(always)]
        fn low(self, a: Self::Word) -> Self::Half {
            let mask = self.splat_pair(0xffff);
            intrinsic!($unsigned($and(a[0], mask), $and(a[1], mask)))
        }
        #[inline(always)]
        fn high(self, a: Self::Word) -> Self::Half {
            intrinsic!($unsigned($logical::<16>(a[0]), $logical::<16>(a[1])))
        }
        #[inline(always)]
        fn join(self, high: Self::Half, low: Self::Half) -> Self::Word {
            intrinsic!([$low(low, high), $high(low, high)])
        }
        #[inline(always)]
        fn widen(self, a: Self::Half) -> Self::Word {
            let doubled = self.join(a, a);
            for_pair!(doubled => intrinsic!($arithmetic::<16>(doubled)))
        }
    };
}

/// Defines the methods of [`Lanes`](super::lanes::Lanes) that are one instruction per vector. The group before a colon
/// states the types of the arguments and of the result.
macro_rules! lane_methods {
    ($($types:ident: $($name:ident $instruction:ident),+;)+) => {
        $($(lane_methods!(@$types $name $instruction);)+)+
    };
    (@halves $name:ident $instruction:ident) => {
        #[inline(always)]
        fn $name(self, a: Self::Half, b: Self::Half) -> Self::Half {
            intrinsic!($instruction(a, b))
        }
    };
    (@words $name:ident $instruction:ident) => {
        lane_methods!(@two $name $instruction Word);
    };
    (@floats $name:ident $instruction:ident) => {
        lane_methods!(@two $name $instruction Float);
    };
    (@floats_to_floats $name:ident $instruction:ident) => {
        lane_methods!(@one $name $instruction Float Float);
    };
    (@floats_to_words $name:ident $instruction:ident) => {
        lane_methods!(@one $name $instruction Float Word);
    };
    (@words_to_floats $name:ident $instruction:ident) => {
        lane_methods!(@one $name $instruction Word Float);
    };
    (@two $name:ident $instruction:ident $pair:ident) => {
        #[inline(always)]
        fn $name(self, a: Self::$pair, b: Self::$pair) -> Self::$pair {
            intrinsic!([$instruction(a[0], b[0]), $instruction(a[1], b[1])])
        }
    };
    (@one $name:ident $instruction:ident $from:ident $to:ident) => {
        #[inline(always)]
        fn $name(self, a: Self::$from) -> Self::$to {
            intrinsic!([$instruction(a[0]), $instruction(a[1])])
        }
    };
}

pub(in crate::kernels) use {
    for_pair, for_pair_index, intrinsic, lane_methods, memory_intrinsic, vector_mask_methods, vector_methods,
};
