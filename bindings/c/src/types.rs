//! Types and constants that callers of the library use.
#![allow(non_camel_case_types, reason = "these are the names of the header")]

use std::ffi::c_void;

/// Version of the ABI. It changes if a program that was compiled with an earlier header could fail.
pub const SPL_ABI_VERSION: u32 = 1;

/// The status of a call. The numbers are the exit codes of the program `spikelane`.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum spl_status {
    /// Success.
    SPL_OK = 0,
    /// An argument or a combination of arguments is invalid.
    SPL_USAGE = 2,
    /// A preset or camera file describes something impossible.
    SPL_CONFIG = 3,
    /// The bytes of an input do not have the declared format.
    SPL_INPUT = 4,
    /// The operating system cannot read or write.
    SPL_IO = 5,
    /// The result does not fit on the disk.
    SPL_SPACE = 6,
    /// The output exists and overwriting is not allowed.
    SPL_EXISTS = 7,
    /// A required program is missing or failed.
    SPL_TOOL = 8,
    /// Bytes do not match their stored digest.
    SPL_CORRUPT = 9,
    /// Another process is writing this output.
    SPL_BUSY = 10,
    /// The system cannot allocate an amount of memory that an input or an argument requires.
    SPL_MEMORY = 11,
    /// A defect of the library; please report it. Afterward, the handles of the call can only be freed.
    SPL_PANIC = 101,
    /// The user requested a stop.
    SPL_INTERRUPTED = 130,
}

/// Part of an error: the whole message in one line.
pub const SPL_ERROR_MESSAGE: u32 = 0;
/// Part of an error: its subject, such as an argument, a key or a file.
pub const SPL_ERROR_SUBJECT: u32 = 1;
/// Part of an error: the found value.
pub const SPL_ERROR_FOUND: u32 = 2;
/// Part of an error: the expected value.
pub const SPL_ERROR_EXPECTED: u32 = 3;
/// Part of an error: the action that solves the problem.
pub const SPL_ERROR_REMEDY: u32 = 4;

/// Samples of uint8_t. Full scale is 255.
pub const SPL_U8: u32 = 0;
/// Samples of uint16_t in the byte order of the machine. Full scale is 65535.
pub const SPL_U16: u32 = 1;
/// Samples of float, finite and not negative. Full scale is 1.0.
pub const SPL_F32: u32 = 2;

/// Between two frames, the light equals the light of the first frame.
pub const SPL_INTERPOLATION_HOLD: u32 = 0;
/// Between two frames, the light is interpolated linearly.
pub const SPL_INTERPOLATION_LINEAR: u32 = 1;
/// Between two frames, the light is interpolated along the estimated motion.
pub const SPL_INTERPOLATION_FLOW: u32 = 2;

/// A camera: a sensor with its effects and measured maps.
pub struct spl_camera;

/// A simulated camera. Its pixels keep their charge between calls.
pub struct spl_simulator;

/// A stream of readouts that is being written to a file.
pub struct spl_writer;

/// The seeds of the noise.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct spl_seeds {
    /// Seed of the fixed pattern. It identifies an individual camera.
    pub camera: u64,
    /// Seed of the temporal noise and the start charge.
    pub shot: u64,
    /// Number of the recording. Recordings with equal seeds and different numbers have independent noise.
    pub sequence: u64,
}

/// A frame of linear light. A call reads the frame and keeps no pointer to it.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct spl_frame {
    /// Pointer to the first sample of the top row, aligned for the sample type.
    pub samples: *const c_void,
    /// Number of readable bytes at `samples`.
    pub samples_bytes: usize,
    /// Distance in samples between the starts of two rows. 0 means that rows have no gaps.
    pub stride: usize,
    /// SPL_U8, SPL_U16 or SPL_F32.
    pub sample_type: u32,
}

/// The light of a call. The call reads the light and keeps no pointer to it.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct spl_light {
    /// The first of `count` frames.
    pub frames: *const spl_frame,
    /// Number of frames, at least 1.
    pub count: usize,
    /// Number of readouts that each frame lasts. A call simulates at most `count` * `readouts_per_frame` readouts. 0 is
    /// allowed only for a single frame, which then lasts for all readouts of the call.
    pub readouts_per_frame: u32,
    /// Interpolation between two frames: SPL_INTERPOLATION_HOLD, SPL_INTERPOLATION_LINEAR or SPL_INTERPOLATION_FLOW. The light
    /// remains constant after the last frame. To continue a scene, pass the last frame of a call as the first frame of the next
    /// call.
    pub interpolation: u32,
}
