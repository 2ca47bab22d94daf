//! The C library of spikelane: the Rust side of `include/spikelane.h`.
//!
//! This file contains all unsafe code. Each C function checks its pointers, calls the safe modules with slices and
//! references, and converts errors and panics to a status.
#![allow(
    unsafe_op_in_unsafe_fn,
    reason = "each function passes the obligations of its caller on to the helpers at the end of this file; a block around \
              each call would repeat that"
)]

mod camera;
mod error;
mod handle;
mod simulator;
mod types;
mod writer;

use std::ffi::{CStr, c_char};
use std::path::Path;

use spikelane::unstable::Count;
use spikelane::{Geometry, Result, Seeds, presets, spikes};
use spikelane_io::light::full_scale::narrow_codes;
use spikelane_io::simulate::{FrameRef, Samples};

use camera::Camera;
use error::{ffi_guard, usage, utf8};
use handle::{Content, Handle, HandleContent, MAGIC};
use simulator::{LightSequence, Simulator, to_seeds};
pub use types::*;
use writer::Writer;

/// Returns the ABI version of the library. It equals SPL_ABI_VERSION of the library's own header.
///
/// Compare the returned version with SPL_ABI_VERSION of the header that the program was compiled with. If they differ,
/// the program must not use the library.
#[unsafe(no_mangle)]
pub extern "C" fn spl_abi_version() -> u32 {
    SPL_ABI_VERSION
}

/// Returns the version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn spl_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// Returns the status of the last failed call of this thread, or SPL_OK if no call failed. A successful call does not
/// change this status.
#[unsafe(no_mangle)]
pub extern "C" fn spl_last_status() -> spl_status {
    error::last_status()
}

/// Returns a part of the message of the last failed call of this thread.
///
/// SPL_ERROR_MESSAGE is the whole message. SPL_ERROR_SUBJECT, SPL_ERROR_FOUND, SPL_ERROR_EXPECTED and SPL_ERROR_REMEDY
/// are parts of the message. A missing part is an empty string, never NULL. The string is valid until the next failed
/// call of this thread or until the end of this thread.
#[unsafe(no_mangle)]
pub extern "C" fn spl_last_error(part: u32) -> *const c_char {
    error::last_error_part(part)
}

/// Creates the built-in camera `name` ("physical", "scsim-code", ...) with 400x250 pixels at 20 kHz. `spikelane preset list`
/// lists the names.
///
/// # Safety
/// `name` is NULL or a string; `camera` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_preset(name: *const c_char, camera: *mut *mut spl_camera) -> spl_status {
    ffi_guard(|| {
        make_handle(camera, || {
            Ok(Content::Camera(Box::new(Camera(presets::builtin(read_text(name, "name")?)?))))
        })
    })
}

/// Creates a camera from `toml`, the text of a camera file.
///
/// The maps of the camera are read from `folder`. For a camera without maps, `folder` may be NULL.
///
/// # Safety
/// `toml` and `folder` are NULL or strings; `camera` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_from_toml(
    toml: *const c_char,
    folder: *const c_char,
    camera: *mut *mut spl_camera,
) -> spl_status {
    ffi_guard(|| {
        make_handle(camera, || {
            let folder = if folder.is_null() { None } else { Some(Path::new(read_text(folder, "folder")?)) };
            presets::from_toml(read_text(toml, "toml")?, folder).map(|c| Content::Camera(Box::new(Camera(c))))
        })
    })
}

/// Creates the camera that the file `path` (.toml) describes. Maps are read from the folder of the file.
///
/// # Safety
/// `path` is NULL or a string; `camera` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_load(path: *const c_char, camera: *mut *mut spl_camera) -> spl_status {
    ffi_guard(|| {
        make_handle(camera, || Ok(Content::Camera(Box::new(Camera::load(read_text(path, "path")?)?))))
    })
}

/// Creates a camera without imperfections. Its pixels start without charge.
///
/// The camera has `width` x `height` pixels and `readout_hz` readouts per second.
///
/// # Safety
/// `camera` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_ideal(
    width: u32,
    height: u32,
    readout_hz: f64,
    camera: *mut *mut spl_camera,
) -> spl_status {
    ffi_guard(|| {
        make_handle(camera, || Ok(Content::Camera(Box::new(Camera::ideal(width, height, readout_hz)?))))
    })
}

/// Creates a copy of a camera.
///
/// # Safety
/// `camera` is NULL or a handle; `copy` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_copy(
    camera: *const spl_camera,
    copy: *mut *mut spl_camera,
) -> spl_status {
    ffi_guard(|| make_handle(copy, || read(camera, |c: &Camera| Ok(Content::Camera(Box::new(c.clone()))))))
}

/// Creates the noise-free twin of a camera. It has the same sensor, saturation clamp and start phase, but no other
/// effect.
///
/// # Safety
/// `camera` is NULL or a handle; `twin` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_clean_twin(
    camera: *const spl_camera,
    twin: *mut *mut spl_camera,
) -> spl_status {
    ffi_guard(|| {
        make_handle(twin, || {
            read(camera, |c: &Camera| Ok(Content::Camera(Box::new(Camera(c.0.clean_twin())))))
        })
    })
}

/// Creates a camera for a rectangle of another camera. The rectangle has `width` x `height` pixels and starts at column
/// `col` and row `row`.
///
/// The fixed pattern of the new camera equals the fixed pattern of the rectangle.
///
/// # Safety
/// `camera` is NULL or a handle; `window` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_window(
    camera: *const spl_camera,
    col: u32,
    row: u32,
    width: u32,
    height: u32,
    window: *mut *mut spl_camera,
) -> spl_status {
    let part = |c: &Camera| Ok(Content::Camera(Box::new(c.window(col, row, width, height)?)));
    ffi_guard(|| make_handle(window, || read(camera, part)))
}

/// Changes the number of pixels of a camera. The fixed pattern is drawn again.
///
/// The call fails for a window and for a camera with maps.
///
/// # Safety
/// `camera` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_resize(camera: *mut spl_camera, width: u32, height: u32) -> spl_status {
    ffi_guard(|| write(camera, |c: &mut Camera| c.resize(width, height)))
}

/// Sets parameter `key` of effect `effect` to `value`. The value is text as in camera files, such as "0.02" or "6.36 mV".
///
/// If the camera lacks the effect, the effect is added with neutral values of its other parameters. `spikelane effects`
/// lists names, keys and units.
///
/// # Safety
/// `camera` is NULL or a handle; `effect`, `key` and `value` are NULL or strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_set_effect(
    camera: *mut spl_camera,
    effect: *const c_char,
    key: *const c_char,
    value: *const c_char,
) -> spl_status {
    ffi_guard(|| {
        let (effect, key, value) =
            (read_text(effect, "effect")?, read_text(key, "key")?, read_text(value, "value")?);
        write(camera, |c: &mut Camera| c.set_effect(effect, |e| e.with_text(key, value)))
    })
}

/// Does the same as spl_camera_set_effect, but `value` is a number in the unit of the parameter.
///
/// # Safety
/// `camera` is NULL or a handle; `effect` and `key` are NULL or strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_set_effect_number(
    camera: *mut spl_camera,
    effect: *const c_char,
    key: *const c_char,
    value: f64,
) -> spl_status {
    ffi_guard(|| {
        let (effect, key) = (read_text(effect, "effect")?, read_text(key, "key")?);
        write(camera, |c: &mut Camera| c.set_effect(effect, |e| e.with_value(key, value)))
    })
}

/// Removes an effect from a camera. If the camera lacks the effect, nothing changes.
///
/// # Safety
/// `camera` is NULL or a handle; `effect` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_remove_effect(
    camera: *mut spl_camera,
    effect: *const c_char,
) -> spl_status {
    ffi_guard(|| {
        let effect = read_text(effect, "effect")?;
        write(camera, |c: &mut Camera| c.remove_effect(effect))
    })
}

/// Sets a property of the sensor.
///
/// `key` is one of these: "readout_hz" (readouts per second), "capacitance_ff" (fF), "swing_v" (V), or
/// "thresholds_at_full_scale" (the exposure: nominal thresholds that full-scale light adds per readout).
///
/// # Safety
/// `camera` is NULL or a handle; `key` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_set_sensor(
    camera: *mut spl_camera,
    key: *const c_char,
    value: f64,
) -> spl_status {
    ffi_guard(|| {
        let key = read_text(key, "key")?;
        write(camera, |c: &mut Camera| c.set_sensor(key, value))
    })
}

/// Sets a measured map of a camera. The map replaces the fixed pattern that an effect draws for the same quantity.
///
/// `map` is "gain" (relative to the nominal gain), "dark_pa" (pA), "capacitance_ff" (fF) or "swing_v" (V). `values`
/// contains `count` values, one per pixel of the whole sensor in row-major order.
///
/// # Safety
/// `camera` is NULL or a handle; `map` is NULL or a string; `values` is NULL or points to `count` readable values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_set_map(
    camera: *mut spl_camera,
    map: *const c_char,
    values: *const f64,
    count: usize,
) -> spl_status {
    ffi_guard(|| {
        let (map, values) = (read_text(map, "map")?, slice(values, count, "values")?);
        write(camera, |c: &mut Camera| c.set_map(map, values))
    })
}

/// Gets the width, the height and the readouts per second of a camera. `width`, `height` and `readout_hz` may each be
/// NULL.
///
/// # Safety
/// `camera` is NULL or a handle; `width`, `height` and `readout_hz` are NULL or point to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_size(
    camera: *const spl_camera,
    width: *mut u32,
    height: *mut u32,
    readout_hz: *mut f64,
) -> spl_status {
    ffi_guard(|| {
        let sensor = read(camera, |c: &Camera| Ok(c.0.sensor))?;
        let (w, h) = (sensor.geometry.width() as u32, sensor.geometry.height() as u32);
        if !width.is_null() {
            *out_ref(width, "width")? = w;
        }
        if !height.is_null() {
            *out_ref(height, "height")? = h;
        }
        if !readout_hz.is_null() {
            *out_ref(readout_hz, "readout_hz")? = sensor.readout_hz;
        }
        Ok(())
    })
}

/// Frees a camera. Simulators that were created from the camera remain valid. For NULL, the call does nothing and returns
/// SPL_OK.
///
/// # Safety
/// `camera` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_free(camera: *mut spl_camera) -> spl_status {
    ffi_guard(|| free_handle::<Camera, _>(camera))
}

/// Creates a simulator of a camera. The call fails if the camera cannot be simulated.
///
/// `seeds` determines the noise, and NULL means that all seeds are 0. Light is clamped to `max_light` full scales. The
/// usual value is 1.0, and only SPL_F32 samples can exceed 1.0. `threads` is the number of threads, 1 to 4096. With 1,
/// the calling thread does all work.
///
/// # Safety
/// `camera` is NULL or a handle; `seeds` is NULL or points to readable memory; `simulator` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_new(
    camera: *const spl_camera,
    seeds: *const spl_seeds,
    max_light: f64,
    threads: u32,
    simulator: *mut *mut spl_simulator,
) -> spl_status {
    ffi_guard(|| {
        make_handle(simulator, || {
            let seeds = read_seeds(seeds)?;
            read(camera, |c: &Camera| {
                let made = Simulator::new(c, seeds, max_light, threads)?;
                Ok(Content::Simulator(Box::new(made)))
            })
        })
    })
}

/// Creates a copy of a simulator. The copy continues independently from the next readout. The copy and the original share
/// threads.
///
/// # Safety
/// `simulator` is NULL or a handle; `copy` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_copy(
    simulator: *const spl_simulator,
    copy: *mut *mut spl_simulator,
) -> spl_status {
    ffi_guard(|| {
        make_handle(copy, || read(simulator, |s: &Simulator| Ok(Content::Simulator(Box::new(s.clone())))))
    })
}

/// Selects an instruction set: "reference", "portable", "sse4.1", "avx2", "avx512", or "auto" for the fastest.
///
/// The simulated bits do not depend on the instruction set.
///
/// # Safety
/// `simulator` is NULL or a handle; `backend` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_set_backend(
    simulator: *mut spl_simulator,
    backend: *const c_char,
) -> spl_status {
    ffi_guard(|| {
        let backend = read_text(backend, "backend")?;
        write(simulator, |s: &mut Simulator| s.set_backend(backend))
    })
}

/// Gets the name of the instruction set, as a static string. The names are those of spl_simulator_set_backend.
///
/// # Safety
/// `simulator` is NULL or a handle; `backend` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_backend(
    simulator: *const spl_simulator,
    backend: *mut *const c_char,
) -> spl_status {
    ffi_guard(|| {
        let place = out_ref(backend, "backend")?;
        let name = read(simulator, |s: &Simulator| Ok(s.backend()))?;
        let names = [c"reference", c"portable", c"sse4.1", c"avx2", c"avx512"];
        let found = names.into_iter().find(|n| n.to_bytes() == name.as_bytes());
        *place = found.ok_or_else(|| usage("backend", name, "a known one", "report it"))?.as_ptr();
        Ok(())
    })
}

/// Gets the number of bytes of a packed readout.
///
/// # Safety
/// `simulator` is NULL or a handle; `bytes` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_frame_bytes(
    simulator: *const spl_simulator,
    bytes: *mut usize,
) -> spl_status {
    ffi_guard(|| {
        let place = out_ref(bytes, "bytes")?;
        *place = read(simulator, |s: &Simulator| Ok(s.geometry().frame_bytes()))?;
        Ok(())
    })
}

/// Gets the index of the next readout. The first readout has index 0.
///
/// # Safety
/// `simulator` is NULL or a handle; `readout` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_readout(
    simulator: *const spl_simulator,
    readout: *mut u64,
) -> spl_status {
    ffi_guard(|| {
        let place = out_ref(readout, "readout")?;
        *place = read(simulator, |s: &Simulator| Ok(s.readout()))?;
        Ok(())
    })
}

/// Gets the code of white of 16-bit samples that probably have fewer bits: 255, 1023 or 4095. 0 means that a sample is above
/// 4095 or that all samples are 0.
///
/// A simulator reads 65535 as full scale. If the samples are such codes, multiply them by 65535 and divide them by `*white`. A
/// dark scene can have the same samples, so the result is a reason for a warning and not for an error.
///
/// # Safety
/// `samples` is NULL or points to `count` samples; `white` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_light_narrow_codes(
    samples: *const u16,
    count: usize,
    white: *mut u32,
) -> spl_status {
    ffi_guard(|| {
        let samples = slice(samples, count, "samples")?;
        let place = out_ref(white, "white")?;
        *place = narrow_codes(samples.iter().copied().max().unwrap_or(0)).map_or(0, |(_, white)| white);
        Ok(())
    })
}

/// Starts another recording of the same camera at readout 0. This is much faster than creating another simulator.
///
/// `seeds->camera` must equal the camera seed that was passed to spl_simulator_new. NULL means that all seeds are 0.
///
/// # Safety
/// `simulator` is NULL or a handle; `seeds` is NULL or points to readable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_restart(
    simulator: *mut spl_simulator,
    seeds: *const spl_seeds,
) -> spl_status {
    ffi_guard(|| {
        let seeds = read_seeds(seeds)?;
        write(simulator, |s: &mut Simulator| s.restart(seeds))
    })
}

/// Frees a simulator. For NULL, the call does nothing and returns SPL_OK.
///
/// # Safety
/// `simulator` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_free(simulator: *mut spl_simulator) -> spl_status {
    ffi_guard(|| free_handle::<Simulator, _>(simulator))
}

/// Simulates `light` and writes exactly `readouts` packed readouts to `packed`.
///
/// `packed_bytes` is `readouts` times the number from spl_simulator_frame_bytes. One call with many readouts is faster than
/// many calls with one readout. If the camera drops readouts, the last light continues until `packed` is full.
/// spl_simulator_advance writes fewer readouts instead.
///
/// The call rejects floats that are probably codes in the light of the first readout: one of them is above 32, and most are above
/// 1. A simulator whose `max_light` is above 32 accepts them.
///
/// # Safety
/// `simulator` is NULL or a handle. `light` is NULL or points to readable memory. `frames` of the light is NULL or points to
/// `count` readable frames. `samples` of each frame is NULL or points to `samples_bytes` readable bytes. `packed` is NULL or
/// points to `packed_bytes` writable bytes. The call rejects a light, a frame or samples that overlap `packed`. During the
/// call, no other thread may change any of this memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_run(
    simulator: *mut spl_simulator,
    light: *const spl_light,
    readouts: usize,
    packed: *mut u8,
    packed_bytes: usize,
) -> spl_status {
    ffi_guard(|| {
        let packed = slice_mut(packed, packed_bytes, "packed")?;
        write(simulator, |s: &mut Simulator| {
            let light = read_light(light, s.geometry(), packed)?;
            s.run(&light, readouts, packed)
        })
    })
}

/// Simulates exactly `readouts` readouts of `light`, and writes all readouts except those that the camera drops (effect
/// "dropped_readouts").
///
/// The light also advances during a dropped readout. `*written` is the number of written readouts, which are at the start
/// of `packed`. `packed_bytes` has the same value as for spl_simulator_run.
///
/// # Safety
/// The arguments must meet the conditions of spl_simulator_run. In addition, `written` is NULL or points to writable
/// memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_advance(
    simulator: *mut spl_simulator,
    light: *const spl_light,
    readouts: usize,
    packed: *mut u8,
    packed_bytes: usize,
    written: *mut usize,
) -> spl_status {
    ffi_guard(|| {
        let packed = slice_mut(packed, packed_bytes, "packed")?;
        check_no_overlap(written, 1, "written", packed, "packed")?;
        let written = out_ref(written, "written")?;
        *written = write(simulator, |s: &mut Simulator| {
            let light = read_light(light, s.geometry(), packed)?;
            s.advance(&light, readouts, packed)
        })?;
        Ok(())
    })
}

/// Gets the number of bytes that spl_simulator_state_save requires.
///
/// # Safety
/// `simulator` is NULL or a handle; `bytes` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_state_bytes(
    simulator: *const spl_simulator,
    bytes: *mut usize,
) -> spl_status {
    ffi_guard(|| {
        let place = out_ref(bytes, "bytes")?;
        *place = read(simulator, |s: &Simulator| Ok(s.state().len()))?;
        Ok(())
    })
}

/// Writes the state of all pixels and a fingerprint of the camera to `state`.
///
/// `state_bytes` is the number from spl_simulator_state_bytes. Python's `Simulator.restore` also reads this format.
///
/// # Safety
/// `simulator` is NULL or a handle; `state` is NULL or points to `state_bytes` writable bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_state_save(
    simulator: *const spl_simulator,
    state: *mut u8,
    state_bytes: usize,
) -> spl_status {
    ffi_guard(|| {
        let out = slice_mut(state, state_bytes, "state")?;
        let saved = read(simulator, |s: &Simulator| Ok(s.state()))?;
        if saved.len() != out.len() {
            let expected = Count(saved.len(), "byte").to_string();
            return Err(usage(
                "state_bytes",
                out.len(),
                expected,
                "call spl_simulator_state_bytes for the size",
            ));
        }
        out.copy_from_slice(&saved);
        Ok(())
    })
}

/// Restores a saved state. The following readouts have the bits that the saved simulator would have produced.
///
/// The camera, the seeds and `max_light` of this simulator must equal those of the saved simulator.
///
/// # Safety
/// `simulator` is NULL or a handle; `state` is NULL or points to `state_bytes` readable bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_state_restore(
    simulator: *mut spl_simulator,
    state: *const u8,
    state_bytes: usize,
) -> spl_status {
    ffi_guard(|| {
        let state = slice(state, state_bytes, "state")?;
        write(simulator, |s: &mut Simulator| s.restore(state))
    })
}

/// Unpacks packed readouts of `width` x `height` pixels. Each bit becomes a byte of 0 or 1.
///
/// `bits_bytes` is `width` * `height` times the number of readouts.
///
/// # Safety
/// `packed` is NULL or points to `packed_bytes` readable bytes; `bits` is NULL or points to `bits_bytes` writable bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_unpack(
    width: u32,
    height: u32,
    packed: *const u8,
    packed_bytes: usize,
    bits: *mut u8,
    bits_bytes: usize,
) -> spl_status {
    ffi_guard(|| {
        let bits = slice_mut(bits, bits_bytes, "bits")?;
        check_no_overlap(packed, packed_bytes, "packed", bits, "bits")?;
        let packed = slice(packed, packed_bytes, "packed")?;
        spikes::unpack(Geometry::new(width, height)?, packed, bits)
    })
}

/// Creates a writer for a stream of readouts of `width` x `height` pixels.
///
/// `path` is the file of the stream. `layout` is NULL for "dat", or another name that `spikelane convert --help` lists.
/// If the file exists, a nonzero `force` replaces the file. With `force` = 0, the call fails with SPL_EXISTS. The file
/// appears at `path` only after spl_writer_finish.
/// # Safety
/// `path` and `layout` are NULL or strings; `writer` is NULL or points to writable memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_create(
    path: *const c_char,
    width: u32,
    height: u32,
    layout: *const c_char,
    force: i32,
    writer: *mut *mut spl_writer,
) -> spl_status {
    ffi_guard(|| {
        make_handle(writer, || {
            let layout = if layout.is_null() { "dat" } else { read_text(layout, "layout")? };
            let made = Writer::create(read_text(path, "path")?, width, height, layout, force != 0)?;
            Ok(Content::Writer(Box::new(made)))
        })
    })
}

/// Appends packed readouts to a stream.
///
/// # Safety
/// `writer` is NULL or a handle; `packed` is NULL or points to `packed_bytes` readable bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_write(
    writer: *mut spl_writer,
    packed: *const u8,
    packed_bytes: usize,
) -> spl_status {
    ffi_guard(|| {
        let packed = slice(packed, packed_bytes, "packed")?;
        write(writer, |w: &mut Writer| w.write(packed))
    })
}

/// Flushes the stream to the disk and renames the file to its final path.
///
/// If the stream has no readouts, or if this call fails, no file remains. After this call, the handle accepts no
/// readouts, but it must still be freed.
///
/// # Safety
/// `writer` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_finish(writer: *mut spl_writer) -> spl_status {
    ffi_guard(|| write(writer, Writer::finish))
}

/// Frees a writer. The file of an unfinished stream is deleted. For NULL, the call does nothing and returns SPL_OK.
///
/// # Safety
/// `writer` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_free(writer: *mut spl_writer) -> spl_status {
    ffi_guard(|| free_handle::<Writer, _>(writer))
}

/// Returns the object to which a handle points. `T` is one of the opaque types of the header.
unsafe fn handle_ref<'a, T>(handle: *const T) -> Result<&'a Handle> {
    let found = if handle.is_null() {
        "NULL"
    } else if !handle.cast::<Handle>().is_aligned() || handle.cast::<u64>().read() != MAGIC {
        // A handle starts with the magic number. Any other object that a caller may pass has at least one readable word
        // at its address.
        "a pointer that is no handle"
    } else {
        return Ok(&*handle.cast::<Handle>());
    };
    Err(usage("handle", found, "one that a function of this library made", "look where it was made"))
}

unsafe fn read<T, H: HandleContent, R>(handle: *const T, work: impl FnOnce(&H) -> Result<R>) -> Result<R> {
    handle_ref(handle)?.read(work)
}

unsafe fn write<T, H: HandleContent, R>(handle: *mut T, work: impl FnOnce(&mut H) -> Result<R>) -> Result<R> {
    handle_ref(handle.cast_const())?.write(work)
}

/// Writes a handle for the result of `content` to `place`. If `content` fails, writes NULL.
unsafe fn make_handle<T>(place: *mut *mut T, content: impl FnOnce() -> Result<Content>) -> Result<()> {
    let place = self::out_ref(place, "place for the handle")?;
    *place = std::ptr::null_mut();
    *place = Box::into_raw(Handle::new(content()?)).cast();
    Ok(())
}

unsafe fn free_handle<H: HandleContent, T>(handle: *mut T) -> Result<()> {
    if handle.is_null() {
        return Ok(());
    }
    handle_ref(handle.cast_const())?.check_idle::<H>()?;
    // `make_handle` leaked this box, and the caller must free each handle only once.
    drop(Box::from_raw(handle.cast::<Handle>()));
    Ok(())
}

unsafe fn read_text<'a>(text: *const c_char, name: &str) -> Result<&'a str> {
    if text.is_null() {
        return Err(null_error(name, "a string"));
    }
    utf8(CStr::from_ptr(text), name)
}

/// Returns a reference to the memory in which the caller expects a result.
unsafe fn out_ref<'a, T>(place: *mut T, name: &str) -> Result<&'a mut T> {
    if place.is_null() {
        return Err(null_error(name, "a place to write to"));
    }
    check_memory_range(place.cast_const(), 1, name)?;
    Ok(&mut *place)
}

unsafe fn slice<'a, T>(values: *const T, count: usize, name: &str) -> Result<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check_memory_range(values, count, name)?;
    Ok(std::slice::from_raw_parts(values, count))
}

unsafe fn slice_mut<'a, T>(values: *mut T, count: usize, name: &str) -> Result<&'a mut [T]> {
    if count == 0 {
        return Ok(&mut []);
    }
    check_memory_range(values.cast_const(), count, name)?;
    Ok(std::slice::from_raw_parts_mut(values, count))
}

/// Rejects `count` values if they overlap the memory `written` that a call writes. Call this function before you create
/// a slice of the values.
fn check_no_overlap<T>(
    values: *const T,
    count: usize,
    name: &str,
    written: &[u8],
    its_name: &str,
) -> Result<()> {
    let (start, bytes) = (values as usize, count.saturating_mul(size_of::<T>()));
    let other = written.as_ptr() as usize;
    let is_apart = start.saturating_add(bytes) <= other || other.saturating_add(written.len()) <= start;
    if count == 0 || written.is_empty() || is_apart {
        return Ok(());
    }
    let expected = format!("memory apart from {its_name}, which the call writes");
    Err(usage(name, format_args!("memory that overlaps {its_name}"), expected, "give another buffer"))
}

/// Checks that the address and the size are valid for `count` values.
fn check_memory_range<T>(values: *const T, count: usize, name: &str) -> Result<()> {
    if values.is_null() {
        return Err(null_error(name, "a buffer"));
    }
    if !values.is_aligned() {
        let expected = format!("an address that is a multiple of {}", align_of::<T>());
        return Err(usage(name, format_args!("{values:p}"), expected, "align the buffer"));
    }
    let bytes = count.checked_mul(size_of::<T>()).filter(|bytes| *bytes <= isize::MAX as usize);
    if bytes.and_then(|bytes| (values as usize).checked_add(bytes)).is_none() {
        return Err(usage(name, Count(count, "value"), "what memory can hold", "check the size"));
    }
    Ok(())
}

fn null_error(name: &str, expected: &str) -> spikelane::Error {
    usage(name, "NULL", expected, "give one")
}

unsafe fn read_seeds(given: *const spl_seeds) -> Result<Seeds> {
    if given.is_null() {
        return Ok(Seeds::default());
    }
    check_memory_range(given, 1, "seeds")?;
    Ok(to_seeds(*given))
}

/// Returns a light of the caller for a call that writes `packed`.
unsafe fn read_light<'a>(
    light: *const spl_light,
    geometry: Geometry,
    packed: &[u8],
) -> Result<LightSequence<'a>> {
    if light.is_null() {
        return Err(null_error("light", "a light"));
    }
    check_memory_range(light, 1, "light")?;
    check_no_overlap(light, 1, "light", packed, "packed")?;
    let spl_light { frames, count, readouts_per_frame, interpolation } = *light;
    check_no_overlap(frames, count, "frames", packed, "packed")?;
    let frames = slice(frames, count, "frames")?;
    let read = |(i, frame): (usize, &spl_frame)| read_frame(frame, &format!("frame {i}"), geometry, packed);
    let frames = frames.iter().enumerate().map(read).collect::<Result<_>>()?;
    LightSequence::new(frames, readouts_per_frame, interpolation)
}

/// Returns the caller's frame for a call that writes to `packed`.
unsafe fn read_frame<'a>(
    frame: &spl_frame,
    name: &str,
    geometry: Geometry,
    packed: &[u8],
) -> Result<FrameRef<'a>> {
    let spl_frame { samples, samples_bytes: bytes, stride, sample_type } = *frame;
    check_no_overlap(samples.cast::<u8>(), bytes, name, packed, "packed")?;
    let samples = match sample_type {
        SPL_U8 => Samples::U8(slice(samples.cast(), bytes, name)?),
        SPL_U16 => Samples::U16(slice(samples.cast(), bytes / 2, name)?),
        SPL_F32 => Samples::F32(slice(samples.cast(), bytes / 4, name)?),
        other => {
            let found = format!("sample_type {other}");
            return Err(usage(name, found, "SPL_U8, SPL_U16 or SPL_F32", "set it"));
        }
    };
    let stride = if stride == 0 { geometry.width() } else { stride };
    Ok(FrameRef::with_stride(samples, stride))
}
