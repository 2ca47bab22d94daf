//! Tests of delivery times with a manual clock, and of all sinks.

use std::io::Read as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::*;
use crate::formats::{Codec, Layout};
use crate::light::{Chart, Interpolation, Rate, Timeline};
use crate::simulate::{ReadoutStream, RunObserver, RunOptions};
use spikelane::{Camera, Error, ErrorKind, Geometry, Result, Seeds, effects, presets};

const HZ: f64 = 1000.0;
const READOUTS: u64 = 100;

/// A clock that never sleeps. A wait sets the clock to the requested instant.
#[derive(Clone, Default)]
struct ManualClock(Arc<Mutex<Duration>>);

impl Clock for ManualClock {
    fn now(&self) -> Duration {
        *self.0.lock().unwrap()
    }

    fn wait_until(&mut self, moment: Duration, at_most: Duration) {
        let mut now = self.0.lock().unwrap();
        *now = moment.min(*now + at_most);
    }
}

/// Records each delivery and its instant.
struct TestSink {
    clock: ManualClock,
    delivery_time: Duration,
    bytes: Vec<u8>,
    delivered_at: Vec<Duration>,
    answer: Box<dyn FnMut(usize) -> Delivery + Send>,
    finished: bool,
}

impl TestSink {
    fn new(takes: Duration, answer: impl FnMut(usize) -> Delivery + Send + 'static) -> Self {
        let (bytes, at, answer) = (Vec::new(), Vec::new(), Box::new(answer));
        Self {
            clock: ManualClock::default(),
            delivery_time: takes,
            bytes,
            delivered_at: at,
            answer,
            finished: false,
        }
    }
}

impl Sink for TestSink {
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery> {
        self.delivered_at.push(self.clock.now());
        *self.clock.0.lock().unwrap() += self.delivery_time;
        self.bytes.extend_from_slice(frames);
        Ok((self.answer)(self.delivered_at.len()))
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

fn job(camera: Camera) -> (RunOptions, Chart, Codec) {
    let chart = Chart::new(camera.sensor.geometry, Rate::new(50, 1).unwrap(), None).unwrap();
    let codec = Codec::new(Layout::Dat, camera.sensor.geometry).unwrap();
    let timeline = Timeline::from_readouts_per_frame(20, Interpolation::Linear).unwrap();
    (
        RunOptions { readouts: Some(READOUTS), ..RunOptions::new(camera, Seeds::default(), timeline) },
        chart,
        codec,
    )
}

fn live(camera: Camera, burst: usize, sink: &mut TestSink, stop: &StopFlag) -> LiveSummary {
    let (job, mut chart, codec) = job(camera);
    let mut readouts = ReadoutStream::new(&job, &mut chart).unwrap();
    let (clock, pace) =
        (sink.clock.clone(), DeliveryRate { readout_hz: HZ, burst_readouts: burst, readouts_ahead: 50 });
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
    crate::simulate::run(&job, &mut chart, &path, None, RunObserver::default()).unwrap();
    for burst in [1, 7, 8, 200] {
        let mut sink = TestSink::new(Duration::ZERO, |_| Delivery::Accepted);
        let report = live(camera(), burst, &mut sink, &StopFlag::default());
        assert_eq!(sink.bytes, std::fs::read(&path).unwrap(), "bursts of {burst}");
        assert_eq!((report.readouts, report.delivered, report.dropped), (READOUTS, READOUTS, 0));
        assert!(sink.finished && !report.consumer_left);
    }
}

#[test]
fn a_burst_comes_when_its_last_readout_is_due() {
    let mut sink = TestSink::new(Duration::ZERO, |_| Delivery::Accepted);
    let report = live(camera(), 4, &mut sink, &StopFlag::default());
    let due: Vec<Duration> = (1..=25).map(|k| ms(4 * k)).collect();
    assert_eq!(sink.delivered_at, due);
    // The four readouts of a burst end 3, 2, 1 and 0 ms before the delivery, so their delays are 3, 2, 1 and 0 ms.
    assert_eq!((report.lateness.count(), report.lateness.max()), (READOUTS, ms(3)));
    assert!(report.lateness.quantile(0.25) < Duration::from_micros(1));
}

#[test]
fn a_slow_sink_makes_everything_after_it_late_and_loses_nothing() {
    let mut sink = TestSink::new(ms(6), |_| Delivery::Accepted);
    let report = live(camera(), 4, &mut sink, &StopFlag::default());
    assert_eq!(report.delivered, READOUTS);
    // The first burst is due 4 ms after the start. Each of the 25 deliveries lasts 6 ms, which exceeds the 4 ms
    // between two bursts.
    assert_eq!(report.elapsed, ms(4 + 25 * 6));
    assert_eq!(report.lateness.max(), ms(4 + 25 * 6 - 97));
}

#[test]
fn refused_bursts_are_counted_and_have_no_lateness() {
    let mut sink =
        TestSink::new(Duration::ZERO, |k| if k % 5 == 0 { Delivery::Dropped } else { Delivery::Accepted });
    let report = live(camera(), 4, &mut sink, &StopFlag::default());
    assert_eq!((report.delivered, report.dropped, report.lateness.count()), (80, 20, 80));
}

#[test]
fn readouts_that_the_camera_drops_take_their_time_and_do_not_come() {
    let dropping = camera().with_effect(
        effects::find("dropped_readouts").unwrap().neutral().with_value("probability", 0.2).unwrap(),
    );
    let mut sink = TestSink::new(Duration::ZERO, |_| Delivery::Accepted);
    let report = live(dropping, 1, &mut sink, &StopFlag::default());
    assert_eq!(report.readouts, READOUTS);
    assert!((60..95).contains(&report.delivered), "{}", report.delivered);
    assert_eq!(report.lateness.max(), Duration::ZERO);
    assert_eq!(report.elapsed, ms(READOUTS));
}

#[test]
fn a_consumer_that_leaves_and_a_request_to_stop_end_the_run() {
    let mut sink =
        TestSink::new(Duration::ZERO, |k| if k == 3 { Delivery::Closed } else { Delivery::Accepted });
    let report = live(camera(), 4, &mut sink, &StopFlag::default());
    assert_eq!((report.readouts, report.consumer_left, sink.finished), (8, true, true));
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    let mut sink = TestSink::new(Duration::ZERO, move |k| {
        raised.store(k == 3, Ordering::Relaxed);
        Delivery::Accepted
    });
    let report = live(camera(), 4, &mut sink, &StopFlag::from_flag(flag));
    assert_eq!((report.readouts, report.consumer_left, sink.finished), (12, false, true));
}

/// A writer that waits for a message before each write.
struct GatedWriter(std::io::PipeWriter, std::sync::mpsc::Receiver<()>);

impl std::io::Write for GatedWriter {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        // `recv` fails if the sender was dropped. Every write is then permitted.
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
    let mut pipe = PipeSink::new(
        Box::new(GatedWriter(writer, gate)),
        "test",
        2,
        OverflowPolicy::Drop,
        StopFlag::default(),
    )
    .unwrap();
    let accepted = (0..20u8).filter(|&k| pipe.deliver(&[k; 10]).unwrap() == Delivery::Accepted);
    let accepted: Vec<u8> = accepted.collect();
    // The queue contains two bursts. In addition, the writing thread may have received one or two bursts.
    assert!((2..=4).contains(&accepted.len()), "{accepted:?}");
    drop(open);
    pipe.finish().unwrap();
    let mut read = Vec::new();
    reader.read_to_end(&mut read).unwrap();
    assert_eq!(read, accepted.iter().flat_map(|k| [*k; 10]).collect::<Vec<u8>>());
}

#[test]
fn a_pipe_that_blocks_loses_nothing() {
    let (mut reader, writer) = std::io::pipe().unwrap();
    let mut pipe =
        PipeSink::new(Box::new(writer), "test", 2, OverflowPolicy::Block, StopFlag::default()).unwrap();
    let reads = std::thread::spawn(move || {
        let (mut all, mut some) = (Vec::new(), [0; 1000]);
        while let Ok(n @ 1..) = reader.read(&mut some) {
            std::thread::sleep(Duration::from_micros(300));
            all.extend_from_slice(&some[..n]);
        }
        all
    });
    for k in 0..200u8 {
        assert_eq!(pipe.deliver(&[k; 1000]).unwrap(), Delivery::Accepted);
    }
    pipe.finish().unwrap();
    drop(pipe);
    assert_eq!(reads.join().unwrap(), (0..200u8).flat_map(|k| [k; 1000]).collect::<Vec<u8>>());
}

#[test]
fn a_reader_that_leaves_is_seen_and_a_stop_ends_a_wait() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut pipe =
        PipeSink::new(Box::new(writer), "test", 1, OverflowPolicy::Block, StopFlag::default()).unwrap();
    assert!((0..100).any(|_| pipe.deliver(&[1; 100_000]).unwrap() == Delivery::Closed));
    pipe.finish().unwrap();
    let (_reader, writer) = std::io::pipe().unwrap();
    let flag = Arc::new(AtomicBool::new(true));
    let mut pipe =
        PipeSink::new(Box::new(writer), "test", 1, OverflowPolicy::Block, StopFlag::from_flag(flag)).unwrap();
    assert!((0..100).any(|_| pipe.deliver(&[1; 100_000]).unwrap() == Delivery::Closed));
    pipe.finish().unwrap();
}

fn ring(
    folder: &tempfile::TempDir,
    slots: u64,
    policy: OverflowPolicy,
) -> (RingWriter, std::path::PathBuf, usize) {
    let codec = Codec::new(Layout::Dat, Geometry::new(20, 18).unwrap()).unwrap();
    let path = folder.path().join("ring");
    let ring = RingWriter::create(&path, &codec, HZ, slots, policy, StopFlag::default()).unwrap();
    (ring, path, codec.frame_bytes())
}

#[test]
fn a_ring_gives_back_what_went_in_and_then_ends() {
    let folder = tempfile::tempdir().unwrap();
    let (mut ring, path, size) = ring(&folder, 8, OverflowPolicy::Drop);
    let mut reader = RingReader::open(&path).unwrap();
    assert_eq!((reader.geometry(), reader.layout()), (Geometry::new(20, 18).unwrap(), Layout::Dat));
    let mut frame = vec![0; size];
    assert_eq!(reader.next(&mut frame).unwrap(), RingRead::Pending);
    for k in 0..3u8 {
        ring.deliver(&[vec![2 * k; size], vec![2 * k + 1; size]].concat()).unwrap();
    }
    ring.finish().unwrap();
    drop(ring);
    assert!(!path.exists());
    for k in 0..6u8 {
        assert_eq!(reader.next(&mut frame).unwrap(), RingRead::Readout(k.into()));
        assert_eq!(frame, vec![k; size]);
    }
    assert_eq!(reader.next(&mut frame).unwrap(), RingRead::Ended);
    assert_eq!(reader.next(&mut frame[1..]).unwrap_err().kind(), ErrorKind::Usage);
}

#[test]
fn an_overrun_reader_resumes_at_the_oldest_slot() {
    let folder = tempfile::tempdir().unwrap();
    let (mut ring, path, size) = ring(&folder, 8, OverflowPolicy::Drop);
    let mut reader = RingReader::open(&path).unwrap();
    for k in 0..20u8 {
        ring.deliver(&vec![k; size]).unwrap();
    }
    let mut frame = vec![0; size];
    assert_eq!(reader.next(&mut frame).unwrap(), RingRead::Readout(12));
    assert_eq!(frame, vec![12; size]);
}

#[test]
fn readers_beside_a_writer_never_see_a_torn_readout() {
    let folder = tempfile::tempdir().unwrap();
    for policy in [OverflowPolicy::Drop, OverflowPolicy::Block] {
        let (mut ring, path, size) = ring(&folder, 3, policy);
        let mut reader = RingReader::open(&path).unwrap();
        let reads = std::thread::spawn(move || {
            let (mut frame, mut values) = (vec![0; size], Vec::new());
            loop {
                match reader.next(&mut frame).unwrap() {
                    RingRead::Readout(k) => {
                        assert!(frame.iter().all(|b| *b == k as u8), "readout {k}: {frame:?}");
                        values.push(k);
                    }
                    RingRead::Pending => std::thread::yield_now(),
                    RingRead::Ended => return values,
                }
            }
        });
        for k in 0..2000u64 {
            ring.deliver(&vec![k as u8; size]).unwrap();
        }
        ring.finish().unwrap();
        let values = reads.join().unwrap();
        assert!(values.is_sorted() && values.last() == Some(&1999));
        if policy == OverflowPolicy::Block {
            assert_eq!(values, (0..2000).collect::<Vec<u64>>());
        }
    }
}

#[cfg(unix)]
#[test]
fn a_ring_that_is_shortened_ends_both_sides_with_an_error() {
    let folder = tempfile::tempdir().unwrap();
    for policy in [OverflowPolicy::Drop, OverflowPolicy::Block] {
        let (mut ring, path, size) = ring(&folder, 3, policy);
        let mut reader = RingReader::open(&path).unwrap();
        ring.deliver(&vec![1; size]).unwrap();
        std::fs::File::create(&path).unwrap();
        let error = ring.deliver(&vec![2; 4 * size]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.to_string().contains("shortened"), "{error}");
        assert_eq!(reader.next(&mut vec![0; size]).unwrap_err().kind(), ErrorKind::Io);
        drop(ring);
        assert!(!path.exists());
    }
}

#[test]
fn a_file_that_is_not_a_ring_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other");
    for bytes in [vec![0; 8], vec![0; 4096], b"SPKRING1".to_vec(), [&b"SPKRING1"[..], &[0; 600]].concat()] {
        std::fs::write(&path, bytes).unwrap();
        assert!(RingReader::open(&path).is_err());
    }
}

#[test]
fn an_invalid_rate_is_refused() {
    let (job, mut chart, codec) = job(camera());
    let mut readouts = ReadoutStream::new(&job, &mut chart).unwrap();
    for (readout_hz, burst) in [(0.0, 1), (f64::NAN, 1), (HZ, 0)] {
        let pace = DeliveryRate { readout_hz, burst_readouts: burst, readouts_ahead: 0 };
        let mut sink = TestSink::new(Duration::ZERO, |_| Delivery::Accepted);
        let ran = run(
            &mut readouts,
            &codec,
            pace,
            &mut sink,
            ManualClock::default,
            &StopFlag::default(),
            &mut |_| Ok(()),
        );
        assert_eq!(ran.map_err(|e: Error| e.kind()).unwrap_err(), ErrorKind::Usage);
    }
}
