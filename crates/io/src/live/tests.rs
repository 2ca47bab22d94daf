//! The pace on a clock of our own, and every sink.

use std::io::Read as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::*;
use crate::formats::{Codec, Layout};
use crate::light::{Chart, Insertion, Rate, Timeline};
use crate::simulate::{Readouts, Run};
use spikelane::{Camera, Error, Geometry, Kind, Result, Seeds, effects, presets};

const HZ: f64 = 1000.0;
const READOUTS: u64 = 100;

/// A clock that jumps to where it is waited for.
#[derive(Clone, Default)]
struct Hand(Arc<Mutex<Duration>>);

impl Clock for Hand {
    fn now(&self) -> Duration {
        *self.0.lock().unwrap()
    }

    fn wait_until(&mut self, moment: Duration, at_most: Duration) {
        let mut now = self.0.lock().unwrap();
        *now = moment.min(*now + at_most);
    }
}

/// What came, and when.
struct Seen {
    clock: Hand,
    takes: Duration,
    bytes: Vec<u8>,
    at: Vec<Duration>,
    answer: Box<dyn FnMut(usize) -> Delivery + Send>,
    finished: bool,
}

impl Seen {
    fn new(takes: Duration, answer: impl FnMut(usize) -> Delivery + Send + 'static) -> Self {
        let (bytes, at, answer) = (Vec::new(), Vec::new(), Box::new(answer));
        Self { clock: Hand::default(), takes, bytes, at, answer, finished: false }
    }
}

impl Sink for Seen {
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery> {
        self.at.push(self.clock.now());
        *self.clock.0.lock().unwrap() += self.takes;
        self.bytes.extend_from_slice(frames);
        Ok((self.answer)(self.at.len()))
    }

    fn finish(&mut self) -> Result<()> {
        self.finished = true;
        Ok(())
    }
}

fn camera() -> Camera {
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(20, 18).unwrap();
    camera.sensor.readout_hz = HZ;
    camera
}

fn job(camera: Camera) -> (Run, Chart, Codec) {
    let chart = Chart::new(camera.sensor.geometry, Rate::new(50, 1).unwrap(), None).unwrap();
    let codec = Codec::new(Layout::Dat, camera.sensor.geometry).unwrap();
    let timeline = Timeline::per_frame(20, Insertion::Linear).unwrap();
    (Run { readouts: Some(READOUTS), ..Run::new(camera, Seeds::default(), timeline) }, chart, codec)
}

fn live(camera: Camera, burst: usize, sink: &mut Seen, stop: &Stop) -> Report {
    let (job, mut chart, codec) = job(camera);
    let mut readouts = Readouts::new(&job, &mut chart).unwrap();
    let (clock, pace) = (sink.clock.clone(), Pace { readout_hz: HZ, burst, ahead: 50 });
    run(&mut readouts, &codec, pace, sink, || clock, stop, &mut |_| Ok(())).unwrap()
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

#[test]
fn live_readouts_are_the_bytes_of_the_file_that_simulate_writes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.dat");
    let (job, mut chart, _) = job(camera());
    crate::simulate::run(&job, &mut chart, &path, None, &mut |_, _| Ok(())).unwrap();
    for burst in [1, 7, 8, 200] {
        let mut sink = Seen::new(Duration::ZERO, |_| Delivery::Taken);
        let report = live(camera(), burst, &mut sink, &Stop::default());
        assert_eq!(sink.bytes, std::fs::read(&path).unwrap(), "bursts of {burst}");
        assert_eq!((report.readouts, report.delivered, report.dropped), (READOUTS, READOUTS, 0));
        assert!(sink.finished && !report.left);
    }
}

#[test]
fn a_burst_comes_when_its_last_readout_is_due() {
    let mut sink = Seen::new(Duration::ZERO, |_| Delivery::Taken);
    let report = live(camera(), 4, &mut sink, &Stop::default());
    let due: Vec<Duration> = (1..=25).map(|k| ms(4 * k)).collect();
    assert_eq!(sink.at, due);
    // The four of a burst are 3, 2, 1 and 0 ms late.
    assert_eq!((report.lateness.total(), report.lateness.max()), (READOUTS, ms(3)));
    assert!(report.lateness.quantile(0.25) < Duration::from_micros(1));
}

#[test]
fn a_slow_sink_makes_everything_after_it_late_and_loses_nothing() {
    let mut sink = Seen::new(ms(6), |_| Delivery::Taken);
    let report = live(camera(), 4, &mut sink, &Stop::default());
    assert_eq!(report.delivered, READOUTS);
    // Each of 25 bursts takes 2 ms more than it has; the first began in time, 4 ms after the start.
    assert_eq!(report.elapsed, ms(4 + 25 * 6));
    assert_eq!(report.lateness.max(), ms(4 + 25 * 6 - 97));
}

#[test]
fn refused_bursts_are_counted_and_have_no_lateness() {
    let mut sink =
        Seen::new(Duration::ZERO, |k| if k % 5 == 0 { Delivery::Dropped } else { Delivery::Taken });
    let report = live(camera(), 4, &mut sink, &Stop::default());
    assert_eq!((report.delivered, report.dropped, report.lateness.total()), (80, 20, 80));
}

#[test]
fn readouts_that_the_camera_drops_take_their_time_and_do_not_come() {
    let dropping =
        camera().with(effects::find("dropped_readouts").unwrap().neutral().with("probability", 0.2).unwrap());
    let mut sink = Seen::new(Duration::ZERO, |_| Delivery::Taken);
    let report = live(dropping, 1, &mut sink, &Stop::default());
    assert_eq!(report.readouts, READOUTS);
    assert!((60..95).contains(&report.delivered), "{}", report.delivered);
    assert_eq!(report.lateness.max(), Duration::ZERO);
    assert_eq!(report.elapsed, ms(READOUTS));
}

#[test]
fn a_consumer_that_leaves_and_a_request_to_stop_end_the_run() {
    let mut sink = Seen::new(Duration::ZERO, |k| if k == 3 { Delivery::Gone } else { Delivery::Taken });
    let report = live(camera(), 4, &mut sink, &Stop::default());
    assert_eq!((report.readouts, report.left, sink.finished), (8, true, true));
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    let mut sink = Seen::new(Duration::ZERO, move |k| {
        raised.store(k == 3, Ordering::Relaxed);
        Delivery::Taken
    });
    let report = live(camera(), 4, &mut sink, &Stop::of(flag));
    assert_eq!((report.readouts, report.left, sink.finished), (12, false, true));
}

/// A writer that is told when to go on.
struct Gate(std::io::PipeWriter, std::sync::mpsc::Receiver<()>);

impl std::io::Write for Gate {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        // Without anybody who could say it, it goes on.
        let _ = self.1.recv();
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_pipe_that_drops_loses_whole_bursts_and_keeps_the_order() {
    let (mut reader, writer) = std::io::pipe().unwrap();
    let (open, gate) = std::sync::mpsc::channel();
    let mut pipe = Pipe::new(Box::new(Gate(writer, gate)), "test", 2, Policy::Drop, Stop::default()).unwrap();
    let taken = (0..20u8).filter(|&k| pipe.deliver(&[k; 10]).unwrap() == Delivery::Taken);
    let taken: Vec<u8> = taken.collect();
    // Two wait, and the thread may have taken one or two more.
    assert!((2..=4).contains(&taken.len()), "{taken:?}");
    drop(open);
    pipe.finish().unwrap();
    let mut read = Vec::new();
    reader.read_to_end(&mut read).unwrap();
    assert_eq!(read, taken.iter().flat_map(|k| [*k; 10]).collect::<Vec<u8>>());
}

#[test]
fn a_pipe_that_blocks_loses_nothing() {
    let (mut reader, writer) = std::io::pipe().unwrap();
    let mut pipe = Pipe::new(Box::new(writer), "test", 2, Policy::Block, Stop::default()).unwrap();
    let reads = std::thread::spawn(move || {
        let (mut all, mut some) = (Vec::new(), [0; 1000]);
        while let Ok(n @ 1..) = reader.read(&mut some) {
            std::thread::sleep(Duration::from_micros(300));
            all.extend_from_slice(&some[..n]);
        }
        all
    });
    for k in 0..200u8 {
        assert_eq!(pipe.deliver(&[k; 1000]).unwrap(), Delivery::Taken);
    }
    pipe.finish().unwrap();
    drop(pipe);
    assert_eq!(reads.join().unwrap(), (0..200u8).flat_map(|k| [k; 1000]).collect::<Vec<u8>>());
}

#[test]
fn a_reader_that_leaves_is_seen_and_a_stop_ends_a_wait() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut pipe = Pipe::new(Box::new(writer), "test", 1, Policy::Block, Stop::default()).unwrap();
    assert!((0..100).any(|_| pipe.deliver(&[1; 100_000]).unwrap() == Delivery::Gone));
    pipe.finish().unwrap();
    let (_reader, writer) = std::io::pipe().unwrap();
    let flag = Arc::new(AtomicBool::new(true));
    let mut pipe = Pipe::new(Box::new(writer), "test", 1, Policy::Block, Stop::of(flag)).unwrap();
    assert!((0..100).any(|_| pipe.deliver(&[1; 100_000]).unwrap() == Delivery::Gone));
    pipe.finish().unwrap();
}

fn ring(folder: &tempfile::TempDir, slots: u64, policy: Policy) -> (Ring, std::path::PathBuf, usize) {
    let codec = Codec::new(Layout::Dat, Geometry::new(20, 18).unwrap()).unwrap();
    let path = folder.path().join("ring");
    let ring = Ring::create(&path, &codec, HZ, slots, policy, Stop::default()).unwrap();
    (ring, path, codec.frame_bytes())
}

#[test]
fn a_ring_gives_back_what_went_in_and_then_ends() {
    let folder = tempfile::tempdir().unwrap();
    let (mut ring, path, size) = ring(&folder, 8, Policy::Drop);
    let mut reader = RingReader::open(&path).unwrap();
    assert_eq!((reader.geometry(), reader.layout()), (Geometry::new(20, 18).unwrap(), Layout::Dat));
    let mut frame = vec![0; size];
    assert_eq!(reader.next(&mut frame).unwrap(), Slot::Wait);
    for k in 0..3u8 {
        ring.deliver(&[vec![2 * k; size], vec![2 * k + 1; size]].concat()).unwrap();
    }
    ring.finish().unwrap();
    drop(ring);
    assert!(!path.exists());
    for k in 0..6u8 {
        assert_eq!(reader.next(&mut frame).unwrap(), Slot::Readout(k.into()));
        assert_eq!(frame, vec![k; size]);
    }
    assert_eq!(reader.next(&mut frame).unwrap(), Slot::Ended);
    assert_eq!(reader.next(&mut frame[1..]).unwrap_err().kind(), Kind::Usage);
}

#[test]
fn an_overrun_reader_goes_on_at_what_is_still_there() {
    let folder = tempfile::tempdir().unwrap();
    let (mut ring, path, size) = ring(&folder, 8, Policy::Drop);
    let mut reader = RingReader::open(&path).unwrap();
    for k in 0..20u8 {
        ring.deliver(&vec![k; size]).unwrap();
    }
    let mut frame = vec![0; size];
    assert_eq!(reader.next(&mut frame).unwrap(), Slot::Readout(12));
    assert_eq!(frame, vec![12; size]);
}

#[test]
fn readers_beside_a_writer_never_see_a_torn_readout() {
    let folder = tempfile::tempdir().unwrap();
    for policy in [Policy::Drop, Policy::Block] {
        let (mut ring, path, size) = ring(&folder, 3, policy);
        let mut reader = RingReader::open(&path).unwrap();
        let reads = std::thread::spawn(move || {
            let (mut frame, mut seen) = (vec![0; size], Vec::new());
            loop {
                match reader.next(&mut frame).unwrap() {
                    Slot::Readout(k) => {
                        assert!(frame.iter().all(|b| *b == k as u8), "readout {k}: {frame:?}");
                        seen.push(k);
                    }
                    Slot::Wait => std::thread::yield_now(),
                    Slot::Ended => return seen,
                }
            }
        });
        for k in 0..2000u64 {
            ring.deliver(&vec![k as u8; size]).unwrap();
        }
        ring.finish().unwrap();
        let seen = reads.join().unwrap();
        assert!(seen.is_sorted() && seen.last() == Some(&1999));
        if policy == Policy::Block {
            assert_eq!(seen, (0..2000).collect::<Vec<u64>>());
        }
    }
}

#[cfg(unix)]
#[test]
fn a_ring_that_is_shortened_ends_both_sides_with_an_error() {
    let folder = tempfile::tempdir().unwrap();
    for policy in [Policy::Drop, Policy::Block] {
        let (mut ring, path, size) = ring(&folder, 3, policy);
        let mut reader = RingReader::open(&path).unwrap();
        ring.deliver(&vec![1; size]).unwrap();
        std::fs::File::create(&path).unwrap();
        let error = ring.deliver(&vec![2; 4 * size]).unwrap_err();
        assert_eq!(error.kind(), Kind::Io);
        assert!(error.to_string().contains("shortened"), "{error}");
        assert_eq!(reader.next(&mut vec![0; size]).unwrap_err().kind(), Kind::Io);
        drop(ring);
        assert!(!path.exists());
    }
}

#[test]
fn other_files_are_no_ring() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other");
    for bytes in [vec![0; 8], vec![0; 4096], b"SPKRING1".to_vec(), [&b"SPKRING1"[..], &[0; 600]].concat()] {
        std::fs::write(&path, bytes).unwrap();
        assert!(RingReader::open(&path).is_err());
    }
}

#[test]
fn a_pace_that_is_none_is_refused() {
    let (job, mut chart, codec) = job(camera());
    let mut readouts = Readouts::new(&job, &mut chart).unwrap();
    for (readout_hz, burst) in [(0.0, 1), (f64::NAN, 1), (HZ, 0)] {
        let pace = Pace { readout_hz, burst, ahead: 0 };
        let mut sink = Seen::new(Duration::ZERO, |_| Delivery::Taken);
        let ran =
            run(&mut readouts, &codec, pace, &mut sink, Hand::default, &Stop::default(), &mut |_| Ok(()));
        assert_eq!(ran.map_err(|e: Error| e.kind()).unwrap_err(), Kind::Usage);
    }
}
