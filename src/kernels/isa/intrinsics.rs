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

pub(in crate::kernels) use {for_pair, for_pair_index, intrinsic, memory_intrinsic};
