//! Instructions on values and on memory, in methods of tokens that prove the CPU to have them.

/// An instruction on values.
macro_rules! proven {
    ($e:expr) => {{
        // SAFETY: `self` exists only where the CPU has the instructions; they touch no memory.
        unsafe { $e }
    }};
}
/// The same expression for both vectors of a pair. (A closure given to `map`
/// might be compiled apart, without the instructions of its caller.)
macro_rules! both {
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

/// The same expression for both positions of a pair.
macro_rules! both_of {
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

/// An instruction on the memory of a slice that has just been cut to size.
macro_rules! memory {
    ($e:expr) => {{
        // SAFETY: `self` exists only where the CPU has the instructions; the pointer comes from a
        // slice of exactly the bytes that the unaligned instruction touches.
        unsafe { $e }
    }};
}

pub(in crate::kernels) use {both, both_of, memory, proven};
