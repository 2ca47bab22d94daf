//! Compares the throughput of calls to the shared library with the throughput of Rust calls. The calls alternate in one
//! process.
//!
//! `cargo run -p spikelane-c --example c-throughput -- target/debug/libspikelane_c.so` prints a table of pixel-readouts
//! per second of processor time: for C, for Rust, and the ratio of C to Rust. Each speed is the best of several rounds.
//! The program runs on Linux only, because it reads the processor time of a thread.

use std::error::Error;
use std::ffi::{CString, c_char, c_int, c_void};
use std::time::Duration;

use spikelane::{Geometry, Seeds, Simulator, presets};
use spikelane_io::light::{Interpolation, Timeline};
use spikelane_io::simulate::FrameRef;

const MEASUREMENTS: usize = 25;
const READOUTS: usize = 1280;

unsafe extern "C" {
    fn dlopen(path: *const c_char, flags: c_int) -> *mut c_void;
    fn dlsym(library: *mut c_void, name: *const c_char) -> *mut c_void;
    fn clock_gettime(clock: c_int, time: *mut [i64; 2]) -> c_int;
}

/// Returns the processor time of this thread. Unlike elapsed time, it does not depend on other work on the machine.
fn processor_time() -> Duration {
    let mut time = [0; 2];
    // SAFETY: 3 is CLOCK_THREAD_CPUTIME_ID, and the time is two words on 64-bit Linux: seconds and nanoseconds.
    unsafe { clock_gettime(3, &raw mut time) };
    Duration::new(time[0] as u64, time[1] as u32)
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Frame {
    samples: *const c_void,
    samples_bytes: usize,
    stride: usize,
    sample_type: u32,
}

#[repr(C)]
struct Light {
    frames: *const Frame,
    count: usize,
    readouts_per_frame: u32,
    interpolation: u32,
}

type Preset = unsafe extern "C" fn(*const c_char, *mut *mut c_void) -> i32;
type New = unsafe extern "C" fn(*const c_void, *const c_void, f64, u32, *mut *mut c_void) -> i32;
type Run = unsafe extern "C" fn(*mut c_void, *const Light, usize, *mut u8, usize) -> i32;

/// The functions of the library, and a simulator of `physical` that they created.
struct Library {
    run: Run,
    simulator: *mut c_void,
}

impl Library {
    fn open(path: &str) -> Result<Self, Box<dyn Error>> {
        let path = CString::new(path)?;
        // SAFETY: the path ends in NUL; 2 is RTLD_NOW.
        let library = unsafe { dlopen(path.as_ptr(), 2) };
        if library.is_null() {
            return Err(
                format!("{path:?}: found no library that can be loaded, expected libspikelane_c.so").into()
            );
        }
        let find = |name: &str| -> Result<*mut c_void, Box<dyn Error>> {
            let name = CString::new(name)?;
            // SAFETY: the library is open and the name ends in NUL.
            let symbol = unsafe { dlsym(library, name.as_ptr()) };
            if symbol.is_null() { Err(format!("no symbol {name:?}").into()) } else { Ok(symbol) }
        };
        let (preset, new, run) =
            (find("spl_camera_preset")?, find("spl_simulator_new")?, find("spl_simulator_run")?);
        // SAFETY: these are the types of the functions in the header.
        let (preset, new, run) = unsafe {
            (
                std::mem::transmute::<*mut c_void, Preset>(preset),
                std::mem::transmute::<*mut c_void, New>(new),
                std::mem::transmute::<*mut c_void, Run>(run),
            )
        };
        let (mut camera, mut simulator) = (std::ptr::null_mut(), std::ptr::null_mut());
        // SAFETY: the string ends in NUL, the pointers can be written to, and `preset` created the handle `camera`.
        let status = unsafe {
            preset(c"physical".as_ptr(), &raw mut camera)
                + new(camera, std::ptr::null(), 1.0, 1, &raw mut simulator)
        };
        if status != 0 {
            return Err(format!("status {status}").into());
        }
        Ok(Self { run, simulator })
    }

    fn run(&self, frames: &[&[u8]], per_frame: u32, out: &mut [u8]) {
        let frames: Vec<Frame> = frames
            .iter()
            .map(|f| Frame { samples: f.as_ptr().cast(), samples_bytes: f.len(), stride: 0, sample_type: 0 })
            .collect();
        let readouts = per_frame as usize * frames.len();
        let light = Light {
            frames: frames.as_ptr(),
            count: frames.len(),
            readouts_per_frame: per_frame,
            interpolation: 0,
        };
        // SAFETY: the handle is live, and the frames and the buffer have the given sizes.
        let status =
            unsafe { (self.run)(self.simulator, &raw const light, readouts, out.as_mut_ptr(), out.len()) };
        assert_eq!(status, 0, "spl_simulator_run");
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("give the path of libspikelane_c.so")?;
    let library = Library::open(&path)?;
    let camera = presets::builtin("physical")?;
    let geometry = camera.sensor.geometry;
    let mut rust = Simulator::new(&camera, Seeds::default())?;
    let ramp = |k: usize| (0..geometry.pixels()).map(|p| (p + 37 * k) as u8).collect::<Vec<u8>>();
    let pictures: Vec<Vec<u8>> = (0..64).map(ramp).collect();
    println!("{} on {}, one thread, {geometry}", camera.name, rust.backend());
    println!("readouts a call, of a frame | Rust Gpx/s | C Gpx/s | C / Rust");
    for (count, per_frame) in [(1, 128), (1, 20), (64, 2), (1, 1)] {
        let frames: Vec<&[u8]> = pictures[..count].iter().map(Vec::as_slice).collect();
        let best = compare(&library, &mut rust, &frames, per_frame, geometry)?;
        let readouts = count as u32 * per_frame;
        let ratio = best[1] / best[0];
        println!("{readouts:>4}, {per_frame:>3} | {:.3} | {:.3} | {ratio:.3}", best[0], best[1]);
    }
    Ok(())
}

/// Returns the best rates of Rust and C in Gpx/s, measured alternately. The bits of C must equal the bits of Rust.
fn compare(
    library: &Library,
    rust: &mut Simulator,
    frames: &[&[u8]],
    per_frame: u32,
    geometry: Geometry,
) -> Result<[f64; 2], Box<dyn Error>> {
    let readouts = per_frame as usize * frames.len();
    let calls = (READOUTS / readouts).max(1);
    let mut out = [0, 1].map(|_| vec![0u8; readouts * geometry.frame_bytes()]);
    let mut best = [0.0f64; 2];
    let timeline = Timeline::from_readouts_per_frame(per_frame.into(), Interpolation::Hold)?;
    let borrowed: Vec<FrameRef<'_>> = frames.iter().map(|f| FrameRef::new(*f)).collect();
    for _ in 0..MEASUREMENTS {
        for (variant, rate) in best.iter_mut().enumerate() {
            let start = processor_time();
            for _ in 0..calls {
                if variant == 0 {
                    rust.fill(spikelane::Light::sequence(&borrowed, &timeline), &mut out[0])?;
                } else {
                    library.run(frames, per_frame, &mut out[1]);
                }
            }
            let work = (calls * readouts * geometry.pixels()) as f64;
            *rate = rate.max(work / (processor_time() - start).as_secs_f64() / 1e9);
        }
        assert_eq!(out[0], out[1], "C and Rust differ");
    }
    Ok(best)
}
