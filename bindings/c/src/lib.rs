//! The C library of spikelane: `include/spikelane.h` as Rust.
//!
//! This file holds all that is unsafe. A door checks pointers, hands slices and references to the safe files beside
//! it, and turns errors and panics into a status.
#![allow(
    unsafe_op_in_unsafe_fn,
    reason = "a door passes its caller's obligations on to the helpers at the end of this file; a block around each call \
              would say so a hundred times"
)]

mod camera;
mod error;
mod handle;
mod simulator;
mod types;
mod writer;

use std::ffi::{CStr, c_char};
use std::path::Path;

use spikelane::{Geometry, Result, Seeds, presets, spikes};
use spikelane_io::simulate::{FrameRef, Samples};

use camera::Camera;
use error::{door, usage, utf8};
use handle::{Content, Held, MAGIC, Shell};
use simulator::{Simulator, seeds};
pub use types::*;
use writer::Writer;

/// The ABI of the library: SPL_ABI_VERSION of the header that it was made with. Another number than the one of the header that a
/// program was compiled with means another library.
#[unsafe(no_mangle)]
pub extern "C" fn spl_abi_version() -> u32 {
    SPL_ABI_VERSION
}

/// The version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn spl_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// The status of the last call of this thread that failed; SPL_OK when none has. A call that succeeds leaves it.
#[unsafe(no_mangle)]
pub extern "C" fn spl_last_status() -> spl_status {
    error::last_status()
}

/// What the last call of this thread that failed had to say: SPL_MESSAGE is all of it, SPL_SUBJECT, SPL_FOUND, SPL_EXPECTED
/// and SPL_REMEDY are its parts. Empty for what it did not say; never NULL. Valid until the next call of this
/// thread that fails, or its end.
#[unsafe(no_mangle)]
pub extern "C" fn spl_last_error(part: u32) -> *const c_char {
    error::last_text(part)
}

/// Makes the built-in camera `name` ("physical", "scsim-code", ...; `spikelane preset list` shows them): 400x250 pixels at 20 kHz.
///
/// # Safety
/// `name` is NULL or a string; `camera` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_preset(name: *const c_char, camera: *mut *mut spl_camera) -> spl_status {
    door(|| make(camera, || Ok(Content::Camera(Box::new(Camera(presets::builtin(text(name, "name")?)?))))))
}

/// Makes the camera that `toml`, the text of a camera file, describes. Maps that it names are looked for in `folder`;
/// NULL for a camera without maps.
///
/// # Safety
/// `toml` and `folder` are NULL or strings; `camera` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_parse(
    toml: *const c_char,
    folder: *const c_char,
    camera: *mut *mut spl_camera,
) -> spl_status {
    door(|| {
        make(camera, || {
            let folder = if folder.is_null() { None } else { Some(Path::new(text(folder, "folder")?)) };
            presets::parse(text(toml, "toml")?, folder).map(|c| Content::Camera(Box::new(Camera(c))))
        })
    })
}

/// Makes the camera of the file `path` (.toml), with the maps beside it.
///
/// # Safety
/// `path` is NULL or a string; `camera` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_load(path: *const c_char, camera: *mut *mut spl_camera) -> spl_status {
    door(|| make(camera, || Ok(Content::Camera(Box::new(Camera::load(text(path, "path")?)?)))))
}

/// Makes a camera without imperfections that starts with empty pixels: `width` x `height` pixels, `readout_hz`
/// readouts per second.
///
/// # Safety
/// `camera` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_ideal(
    width: u32,
    height: u32,
    readout_hz: f64,
    camera: *mut *mut spl_camera,
) -> spl_status {
    door(|| make(camera, || Ok(Content::Camera(Box::new(Camera::ideal(width, height, readout_hz)?)))))
}

/// Makes a copy of a camera.
///
/// # Safety
/// `camera` is NULL or a handle; `copy` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_copy(
    camera: *const spl_camera,
    copy: *mut *mut spl_camera,
) -> spl_status {
    door(|| make(copy, || read(camera, |c: &Camera| Ok(Content::Camera(Box::new(c.clone()))))))
}

/// Makes the noise-free twin of a camera: the same sensor, clamp and start phase, and no other effect.
///
/// # Safety
/// `camera` is NULL or a handle; `twin` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_clean_twin(
    camera: *const spl_camera,
    twin: *mut *mut spl_camera,
) -> spl_status {
    door(|| make(twin, || read(camera, |c: &Camera| Ok(Content::Camera(Box::new(Camera(c.0.clean_twin())))))))
}

/// Makes the camera that is a rectangle of another, `width` x `height` pixels from column `col` and row `row` on, with the
/// pixels, columns and rows of that place.
///
/// # Safety
/// `camera` is NULL or a handle; `window` is NULL or can be written.
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
    door(|| make(window, || read(camera, part)))
}

/// Gives a camera another number of pixels; its fixed pattern is drawn anew. Refused for a window and for a camera with
/// maps.
///
/// # Safety
/// `camera` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_resize(camera: *mut spl_camera, width: u32, height: u32) -> spl_status {
    door(|| write(camera, |c: &mut Camera| c.resize(width, height)))
}

/// Sets the parameter `key` of the effect `effect` to `value`, a text as in camera files: "0.02", "6.36 mV". An effect that
/// the camera lacks is added, its other parameters neutral. `spikelane effects` lists names, keys and units.
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
    door(|| {
        let (effect, key, value) = (text(effect, "effect")?, text(key, "key")?, text(value, "value")?);
        write(camera, |c: &mut Camera| c.set_effect(effect, |e| e.with_text(key, value)))
    })
}

/// As spl_camera_set_effect, with a number in the parameter's own unit.
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
    door(|| {
        let (effect, key) = (text(effect, "effect")?, text(key, "key")?);
        write(camera, |c: &mut Camera| c.set_effect(effect, |e| e.with(key, value)))
    })
}

/// Takes an effect from a camera; one that it lacks changes nothing.
///
/// # Safety
/// `camera` is NULL or a handle; `effect` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_without(camera: *mut spl_camera, effect: *const c_char) -> spl_status {
    door(|| {
        let effect = text(effect, "effect")?;
        write(camera, |c: &mut Camera| c.without(effect))
    })
}

/// Sets a number of the circuit: "readout_hz" (readouts per second), "capacitance_ff" (fF), "swing_v" (V), or
/// "thresholds_at_full_scale" (nominal thresholds that full-scale light adds per readout: the exposure).
///
/// # Safety
/// `camera` is NULL or a handle; `key` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_set_sensor(
    camera: *mut spl_camera,
    key: *const c_char,
    value: f64,
) -> spl_status {
    door(|| {
        let key = text(key, "key")?;
        write(camera, |c: &mut Camera| c.set_sensor(key, value))
    })
}

/// Gives a camera a measured map in place of what effects would draw: "gain" (relative to the nominal one), "dark_pa" (pA),
/// "capacitance_ff" (fF) or "swing_v" (V); `count` values, one per pixel of the whole sensor, row by row.
///
/// # Safety
/// `camera` is NULL or a handle; `map` is NULL or a string; `values` is NULL or has `count` values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_set_map(
    camera: *mut spl_camera,
    map: *const c_char,
    values: *const f64,
    count: usize,
) -> spl_status {
    door(|| {
        let (map, values) = (text(map, "map")?, slice(values, count, "values")?);
        write(camera, |c: &mut Camera| c.set_map(map, values))
    })
}

/// Says how many pixels a camera has, and how many readouts per second; NULL for what nobody asks.
///
/// # Safety
/// `camera` is NULL or a handle; `width`, `height` and `readout_hz` are NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_size(
    camera: *const spl_camera,
    width: *mut u32,
    height: *mut u32,
    readout_hz: *mut f64,
) -> spl_status {
    door(|| {
        let sensor = read(camera, |c: &Camera| Ok(c.0.sensor))?;
        let (w, h) = (sensor.geometry.width() as u32, sensor.geometry.height() as u32);
        if !width.is_null() {
            *place(width, "width")? = w;
        }
        if !height.is_null() {
            *place(height, "height")? = h;
        }
        if !readout_hz.is_null() {
            *place(readout_hz, "readout_hz")? = sensor.readout_hz;
        }
        Ok(())
    })
}

/// Frees a camera; simulators made from it go on. NULL is SPL_OK.
///
/// # Safety
/// `camera` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_camera_free(camera: *mut spl_camera) -> spl_status {
    door(|| free::<Camera, _>(camera))
}

/// Makes a simulator of a camera: all that cannot be simulated is refused here. `seeds` fix the noise; NULL for zeros.
/// Light beyond `greatest_light` full scales, which only SPL_F32 holds, is cut; 1.0 is usual. `threads` of its own share the
/// work, from 1 (the caller's) to 4096.
///
/// # Safety
/// `camera` is NULL or a handle; `seeds` is NULL or can be read; `simulator` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_new(
    camera: *const spl_camera,
    seeds: *const spl_seeds,
    greatest_light: f64,
    threads: u32,
    simulator: *mut *mut spl_simulator,
) -> spl_status {
    door(|| {
        make(simulator, || {
            let seeds = seeds_of(seeds)?;
            read(camera, |c: &Camera| {
                let made = Simulator::new(c, seeds, greatest_light, threads)?;
                Ok(Content::Simulator(Box::new(made)))
            })
        })
    })
}

/// Makes a copy of a simulator that goes on from the same readout on its own; its threads are shared.
///
/// # Safety
/// `simulator` is NULL or a handle; `copy` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_copy(
    simulator: *const spl_simulator,
    copy: *mut *mut spl_simulator,
) -> spl_status {
    door(|| make(copy, || read(simulator, |s: &Simulator| Ok(Content::Simulator(Box::new(s.clone()))))))
}

/// Asks for an instruction set: "reference", "portable", "sse4.1", "avx2", "avx512", or "auto" for the fastest. The bits stay the same.
///
/// # Safety
/// `simulator` is NULL or a handle; `backend` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_set_backend(
    simulator: *mut spl_simulator,
    backend: *const c_char,
) -> spl_status {
    door(|| {
        let backend = text(backend, "backend")?;
        write(simulator, |s: &mut Simulator| s.set_backend(backend))
    })
}

/// Says which instruction set is used: one of the names of spl_simulator_set_backend, a string that is never freed.
///
/// # Safety
/// `simulator` is NULL or a handle; `backend` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_backend(
    simulator: *const spl_simulator,
    backend: *mut *const c_char,
) -> spl_status {
    door(|| {
        let place = place(backend, "backend")?;
        let name = read(simulator, |s: &Simulator| Ok(s.backend()))?;
        let names = [c"reference", c"portable", c"sse4.1", c"avx2", c"avx512"];
        let found = names.into_iter().find(|n| n.to_bytes() == name.as_bytes());
        *place = found.ok_or_else(|| usage("backend", name, "a known one", "report it"))?.as_ptr();
        Ok(())
    })
}

/// Says how many bytes a packed readout has.
///
/// # Safety
/// `simulator` is NULL or a handle; `bytes` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_frame_bytes(
    simulator: *const spl_simulator,
    bytes: *mut usize,
) -> spl_status {
    door(|| {
        let place = place(bytes, "bytes")?;
        *place = read(simulator, |s: &Simulator| Ok(s.geometry().frame_bytes()))?;
        Ok(())
    })
}

/// Says which readout comes next, counted from 0.
///
/// # Safety
/// `simulator` is NULL or a handle; `readout` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_readout(
    simulator: *const spl_simulator,
    readout: *mut u64,
) -> spl_status {
    door(|| {
        let place = place(readout, "readout")?;
        *place = read(simulator, |s: &Simulator| Ok(s.readout()))?;
        Ok(())
    })
}

/// Begins another recording of the same camera at readout 0: far quicker than a new simulator. `seeds->camera` has to
/// be that of spl_simulator_new; NULL for zeros.
///
/// # Safety
/// `simulator` is NULL or a handle; `seeds` is NULL or can be read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_restart(
    simulator: *mut spl_simulator,
    seeds: *const spl_seeds,
) -> spl_status {
    door(|| {
        let seeds = seeds_of(seeds)?;
        write(simulator, |s: &mut Simulator| s.restart(seeds))
    })
}

/// Frees a simulator. NULL is SPL_OK.
///
/// # Safety
/// `simulator` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_simulator_free(simulator: *mut spl_simulator) -> spl_status {
    door(|| free::<Simulator, _>(simulator))
}

/// Holds `frame` for `readouts` readouts and writes them, packed, to `out`: `out_bytes` is `readouts` times
/// spl_simulator_frame_bytes. Many readouts a call are faster than one: 128 make a batch. A camera that drops readouts holds
/// the light until `out` is full; spl_expose_frames lets the scene go on instead.
///
/// # Safety
/// `simulator` is NULL or a handle; `frame` is NULL or says the truth; `out` is NULL or has `out_bytes` bytes that can be
/// written. Memory of the frame that overlaps `out` is refused. No other thread changes either during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_push(
    simulator: *mut spl_simulator,
    frame: *const spl_frame,
    readouts: usize,
    out: *mut u8,
    out_bytes: usize,
) -> spl_status {
    door(|| {
        let out = slice_mut(out, out_bytes, "out")?;
        write(simulator, |s: &mut Simulator| {
            let frame = light(frame, "frame", s.geometry(), out)?;
            s.push(frame, readouts, out)
        })
    })
}

/// Goes from one frame to another in a straight line: readout i of `readouts` sees `from` + (`to` - `from`) * i /
/// `readouts`. To go on, the next call's `from` is this call's `to`. Otherwise as spl_push.
///
/// # Safety
/// As spl_push, for both frames.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_push_between(
    simulator: *mut spl_simulator,
    from: *const spl_frame,
    to: *const spl_frame,
    readouts: usize,
    out: *mut u8,
    out_bytes: usize,
) -> spl_status {
    door(|| {
        let out = slice_mut(out, out_bytes, "out")?;
        write(simulator, |s: &mut Simulator| {
            let frames = [light(from, "from", s.geometry(), out)?, light(to, "to", s.geometry(), out)?];
            s.push_frames(&frames, readouts as u64, SPL_LINEAR, readouts, out)
        })
    })
}

/// Runs `count` frames, each of which lasts `readouts_per_frame` readouts, for `readouts` readouts, at most as many as
/// they last. `insertion` says what the light does between two of them: SPL_HOLD, SPL_LINEAR or SPL_FLOW; the last frame stays. With a
/// new frame at every readout this is several times faster than a call for each. Otherwise as spl_push.
///
/// # Safety
/// As spl_push; `frames` is NULL or has `count` frames that say the truth.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_push_frames(
    simulator: *mut spl_simulator,
    frames: *const spl_frame,
    count: usize,
    readouts_per_frame: u64,
    insertion: u32,
    readouts: usize,
    out: *mut u8,
    out_bytes: usize,
) -> spl_status {
    door(|| {
        let out = slice_mut(out, out_bytes, "out")?;
        write(simulator, |s: &mut Simulator| {
            let frames = lights(frames, count, s.geometry(), out)?;
            s.push_frames(&frames, readouts_per_frame, insertion, readouts, out)
        })
    })
}

/// As spl_push_frames, but readouts that the camera drops (effect "dropped_readouts") are missing: `*written` says how many
/// readouts at the start of `out` are filled.
///
/// # Safety
/// As spl_push_frames; `written` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_expose_frames(
    simulator: *mut spl_simulator,
    frames: *const spl_frame,
    count: usize,
    readouts_per_frame: u64,
    insertion: u32,
    readouts: usize,
    out: *mut u8,
    out_bytes: usize,
    written: *mut usize,
) -> spl_status {
    door(|| {
        let out = slice_mut(out, out_bytes, "out")?;
        apart(written, 1, "written", out, "out")?;
        let written = place(written, "written")?;
        *written = write(simulator, |s: &mut Simulator| {
            let frames = lights(frames, count, s.geometry(), out)?;
            s.expose_frames(&frames, readouts_per_frame, insertion, readouts, out)
        })?;
        Ok(())
    })
}

/// Says how many bytes spl_state_save writes.
///
/// # Safety
/// `simulator` is NULL or a handle; `bytes` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_state_bytes(simulator: *const spl_simulator, bytes: *mut usize) -> spl_status {
    door(|| {
        let place = place(bytes, "bytes")?;
        *place = read(simulator, |s: &Simulator| Ok(s.state().len()))?;
        Ok(())
    })
}

/// Writes all that a camera remembers, and what it belongs to, to `state`; `state_bytes` is what spl_state_bytes says.
/// Python's `Simulator.restore` reads it too.
///
/// # Safety
/// `simulator` is NULL or a handle; `state` is NULL or has `state_bytes` bytes that can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_state_save(
    simulator: *const spl_simulator,
    state: *mut u8,
    state_bytes: usize,
) -> spl_status {
    door(|| {
        let out = slice_mut(state, state_bytes, "state")?;
        let saved = read(simulator, |s: &Simulator| Ok(s.state()))?;
        if saved.len() != out.len() {
            let expected = format!("{} bytes", saved.len());
            return Err(usage("state_bytes", out.len(), expected, "ask spl_state_bytes"));
        }
        out.copy_from_slice(&saved);
        Ok(())
    })
}

/// Goes on from a saved state with the same bits. The simulator has to be of the same camera, seeds and greatest light.
///
/// # Safety
/// `simulator` is NULL or a handle; `state` is NULL or has `state_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_state_restore(
    simulator: *mut spl_simulator,
    state: *const u8,
    state_bytes: usize,
) -> spl_status {
    door(|| {
        let state = slice(state, state_bytes, "state")?;
        write(simulator, |s: &mut Simulator| s.restore(state))
    })
}

/// Makes of every bit of packed readouts of `width` x `height` pixels a byte of 0 or 1: `bits_bytes` is `width` * `height`
/// for each readout.
///
/// # Safety
/// `packed` is NULL or has `packed_bytes` bytes; `bits` is NULL or has `bits_bytes` bytes that can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_unpack(
    width: u32,
    height: u32,
    packed: *const u8,
    packed_bytes: usize,
    bits: *mut u8,
    bits_bytes: usize,
) -> spl_status {
    door(|| {
        let bits = slice_mut(bits, bits_bytes, "bits")?;
        apart(packed, packed_bytes, "packed", bits, "bits")?;
        let packed = slice(packed, packed_bytes, "packed")?;
        spikes::unpack(Geometry::new(width, height)?, packed, bits)
    })
}

/// Begins a stream of readouts of `width` x `height` pixels that will be the file `path`. `layout` is NULL for "dat", or
/// another of the names that `spikelane convert --help` lists. A file of that name is replaced if `force` is not 0, and otherwise
/// refused with SPL_EXISTS. The file gets its name from spl_writer_finish.
///
/// # Safety
/// `path` and `layout` are NULL or strings; `writer` is NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_create(
    path: *const c_char,
    width: u32,
    height: u32,
    layout: *const c_char,
    force: i32,
    writer: *mut *mut spl_writer,
) -> spl_status {
    door(|| {
        make(writer, || {
            let layout = if layout.is_null() { "dat" } else { text(layout, "layout")? };
            let made = Writer::create(text(path, "path")?, width, height, layout, force != 0)?;
            Ok(Content::Writer(Box::new(made)))
        })
    })
}

/// Appends packed readouts.
///
/// # Safety
/// `writer` is NULL or a handle; `packed` is NULL or has `packed_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_write(
    writer: *mut spl_writer,
    packed: *const u8,
    packed_bytes: usize,
) -> spl_status {
    door(|| {
        let packed = slice(packed, packed_bytes, "packed")?;
        write(writer, |w: &mut Writer| w.write(packed))
    })
}

/// Brings the stream to the disk and gives the file its name. A stream without readouts, or one that fails here, leaves no file.
/// Nothing can be written any more; the handle is still to be freed.
///
/// # Safety
/// `writer` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_finish(writer: *mut spl_writer) -> spl_status {
    door(|| write(writer, Writer::finish))
}

/// Frees a writer; a stream that was not finished leaves no file. NULL is SPL_OK.
///
/// # Safety
/// `writer` is NULL or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn spl_writer_free(writer: *mut spl_writer) -> spl_status {
    door(|| free::<Writer, _>(writer))
}

/// The shell that a handle points at; `T` is an opaque type of the header.
unsafe fn shell<'a, T>(handle: *const T) -> Result<&'a Shell> {
    let found = if handle.is_null() {
        "NULL"
    } else if !handle.cast::<Shell>().is_aligned() || handle.cast::<u64>().read() != MAGIC {
        // A shell starts with the magic; what else a caller may point at has a word there at least.
        "a pointer that is no handle"
    } else {
        return Ok(&*handle.cast::<Shell>());
    };
    Err(usage("handle", found, "one that a function of this library made", "look where it was made"))
}

unsafe fn read<T, H: Held, R>(handle: *const T, work: impl FnOnce(&H) -> Result<R>) -> Result<R> {
    shell(handle)?.read(work)
}

unsafe fn write<T, H: Held, R>(handle: *mut T, work: impl FnOnce(&mut H) -> Result<R>) -> Result<R> {
    shell(handle.cast_const())?.write(work)
}

/// Puts a handle to what `content` makes at `place`, or NULL.
unsafe fn make<T>(place: *mut *mut T, content: impl FnOnce() -> Result<Content>) -> Result<()> {
    let place = self::place(place, "place for the handle")?;
    *place = std::ptr::null_mut();
    *place = Box::into_raw(Shell::new(content()?)).cast();
    Ok(())
}

unsafe fn free<H: Held, T>(handle: *mut T) -> Result<()> {
    if handle.is_null() {
        return Ok(());
    }
    shell(handle.cast_const())?.check_idle::<H>()?;
    // `make` gave this box away, and the caller frees each handle once.
    drop(Box::from_raw(handle.cast::<Shell>()));
    Ok(())
}

unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<&'a str> {
    if text.is_null() {
        return Err(null(name, "a string"));
    }
    utf8(CStr::from_ptr(text), name)
}

/// A place to write to.
unsafe fn place<'a, T>(place: *mut T, name: &str) -> Result<&'a mut T> {
    if place.is_null() {
        return Err(null(name, "a place to write to"));
    }
    check(place.cast_const(), 1, name)?;
    Ok(&mut *place)
}

unsafe fn slice<'a, T>(values: *const T, count: usize, name: &str) -> Result<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check(values, count, name)?;
    Ok(std::slice::from_raw_parts(values, count))
}

unsafe fn slice_mut<'a, T>(values: *mut T, count: usize, name: &str) -> Result<&'a mut [T]> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(values.cast_const(), count, name)?;
    Ok(std::slice::from_raw_parts_mut(values, count))
}

/// Refuses `count` values that overlap the bytes that a call writes. Comes before a slice of them is made.
fn apart<T>(values: *const T, count: usize, name: &str, written: &[u8], its_name: &str) -> Result<()> {
    let (start, bytes) = (values as usize, count.saturating_mul(size_of::<T>()));
    let other = written.as_ptr() as usize;
    let is_apart = start.saturating_add(bytes) <= other || other.saturating_add(written.len()) <= start;
    if count == 0 || written.is_empty() || is_apart {
        return Ok(());
    }
    let expected = format!("memory apart from {its_name}, which the call writes");
    Err(usage(name, format_args!("memory that overlaps {its_name}"), expected, "give another buffer"))
}

/// Checks that `count` values can lie there.
fn check<T>(values: *const T, count: usize, name: &str) -> Result<()> {
    if values.is_null() {
        return Err(null(name, "a buffer"));
    }
    if !values.is_aligned() {
        let expected = format!("an address that is a multiple of {}", align_of::<T>());
        return Err(usage(name, format_args!("{values:p}"), expected, "align the buffer"));
    }
    let bytes = count.checked_mul(size_of::<T>()).filter(|bytes| *bytes <= isize::MAX as usize);
    if bytes.and_then(|bytes| (values as usize).checked_add(bytes)).is_none() {
        return Err(usage(name, format_args!("{count} values"), "what memory can hold", "check the size"));
    }
    Ok(())
}

fn null(name: &str, expected: &str) -> spikelane::Error {
    usage(name, "NULL", expected, "give one")
}

unsafe fn seeds_of(given: *const spl_seeds) -> Result<Seeds> {
    if given.is_null() {
        return Ok(Seeds::default());
    }
    check(given, 1, "seeds")?;
    Ok(seeds(*given))
}

/// A frame of the caller's for a call that writes `out`.
unsafe fn light<'a>(
    frame: *const spl_frame,
    name: &str,
    geometry: Geometry,
    out: &[u8],
) -> Result<FrameRef<'a>> {
    if frame.is_null() {
        return Err(null(name, "a frame"));
    }
    check(frame, 1, name)?;
    apart(frame, 1, name, out, "out")?;
    let spl_frame { samples, samples_bytes: bytes, stride, sample_type } = *frame;
    apart(samples.cast::<u8>(), bytes, name, out, "out")?;
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
    Ok(FrameRef::strided(samples, stride))
}

unsafe fn lights<'a>(
    frames: *const spl_frame,
    count: usize,
    geometry: Geometry,
    out: &[u8],
) -> Result<Vec<FrameRef<'a>>> {
    apart(frames, count, "frames", out, "out")?;
    let frames = slice(frames, count, "frames")?;
    let one = |(i, frame): (usize, &spl_frame)| light(frame, &format!("frame {i}"), geometry, out);
    frames.iter().enumerate().map(one).collect()
}
