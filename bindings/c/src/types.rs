//! What both sides of the border know.
#![allow(non_camel_case_types, reason = "these are the names of the header")]

use std::ffi::c_void;

/// Changes when a program that was compiled with an older header could go wrong.
pub const SPL_ABI_VERSION: u32 = 1;

/// What came of a call. The numbers are the exit codes of the program `spikelane`.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum spl_status {
    /// Done.
    SPL_OK = 0,
    /// An argument, or a combination of arguments, makes no sense.
    SPL_USAGE = 2,
    /// A preset or camera file describes something impossible.
    SPL_CONFIG = 3,
    /// The bytes of an input are not what they claim to be.
    SPL_INPUT = 4,
    /// The system refused to read or write.
    SPL_IO = 5,
    /// The disk cannot hold the result.
    SPL_SPACE = 6,
    /// The output exists and nobody allowed overwriting it.
    SPL_EXISTS = 7,
    /// A program that is needed is missing or failed.
    SPL_TOOL = 8,
    /// Bytes do not match their digest.
    SPL_CORRUPT = 9,
    /// Another process writes this output.
    SPL_BUSY = 10,
    /// The system has no memory for a size that an input or an argument requires.
    SPL_MEMORY = 11,
    /// A fault of the library. The handles of the call answer nothing more but their _free; please report it.
    SPL_PANIC = 101,
    /// The user asked to stop.
    SPL_INTERRUPTED = 130,
}

/// Part of an error: all of it in one line.
pub const SPL_MESSAGE: u32 = 0;
/// Part of an error: the thing that it is about, such as an argument, a key or a file.
pub const SPL_SUBJECT: u32 = 1;
/// Part of an error: what was found there.
pub const SPL_FOUND: u32 = 2;
/// Part of an error: what was expected instead.
pub const SPL_EXPECTED: u32 = 3;
/// Part of an error: what to do about it.
pub const SPL_REMEDY: u32 = 4;

/// Samples of uint8_t; full scale is 255.
pub const SPL_U8: u32 = 0;
/// Samples of uint16_t in the machine's byte order; full scale is 65535.
pub const SPL_U16: u32 = 1;
/// Samples of float, finite and not negative; full scale is 1.0.
pub const SPL_F32: u32 = 2;

/// Between two frames the light stays what the first was.
pub const SPL_HOLD: u32 = 0;
/// Between two frames the light goes in a straight line.
pub const SPL_LINEAR: u32 = 1;
/// Between two frames the light moves along an estimated motion.
pub const SPL_FLOW: u32 = 2;

/// A camera: sensor, imperfections, measured maps.
pub struct spl_camera;

/// A camera at work: it remembers its charge from call to call.
pub struct spl_simulator;

/// A stream of readouts on its way into a file.
pub struct spl_writer;

/// What fixes the noise.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct spl_seeds {
    /// Which camera of its kind: the fixed pattern.
    pub camera: u64,
    /// Temporal noise and start charge.
    pub shot: u64,
    /// Which recording; sequences of one seed share no noise.
    pub sequence: u64,
}

/// A frame of linear light that is read during a call, and not kept.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct spl_frame {
    /// The first sample of the top row, aligned as its type asks.
    pub samples: *const c_void,
    /// Bytes from there on that may be read.
    pub samples_bytes: usize,
    /// Samples from the start of a row to the start of the next; 0 for rows without a gap.
    pub stride: usize,
    /// SPL_U8, SPL_U16 or SPL_F32.
    pub sample_type: u32,
}
