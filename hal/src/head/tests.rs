//! The head against devices that misbehave on purpose.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use super::*;
use crate::error::ErrorKind;
use crate::frame::Pixels;

const FORMAT: FrameFormat = FrameFormat {
    width: 2,
    height: 1,
    stride: 2,
    bit_depth: 8,
};
const TIMEOUT: Duration = Duration::from_millis(100);

#[derive(Default)]
struct Log {
    running: bool,
    shown: Option<usize>,
    frames: VecDeque<u64>,
}

struct Fake(Arc<Mutex<Log>>);

impl Camera for Fake {
    fn format(&self) -> FrameFormat {
        FORMAT
    }

    fn start(&mut self) -> Result<(), Error> {
        self.0.lock().unwrap().running = true;
        Ok(())
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, Error> {
        let time = self.0.lock().unwrap().frames.pop_front();
        let time = time.ok_or_else(|| Error::timeout("waiting for a frame", timeout, "none"))?;
        Frame::new(
            FORMAT,
            Arc::new(Pixels::zeroed(&FORMAT)),
            Timestamp(time),
            time,
        )
    }

    fn stop(&mut self) -> Result<(), Error> {
        self.0.lock().unwrap().running = false;
        Ok(())
    }
}

/// Flips to pattern n at time 100 n.
impl Projector for Fake {
    fn size(&self) -> (u32, u32) {
        (1, 1)
    }

    fn refresh(&self) -> Duration {
        Duration::from_nanos(100)
    }

    fn load(&mut self, _: Vec<Raster>) -> Result<(), Error> {
        Ok(())
    }

    fn show(&mut self, index: usize, _: Duration) -> Result<Flip, Error> {
        self.0.lock().unwrap().shown = Some(index);
        Ok(Flip {
            timestamp: Timestamp(index as u64 * 100),
            sequence: index as u64,
        })
    }

    fn blank(&mut self) -> Result<(), Error> {
        self.0.lock().unwrap().shown = None;
        Ok(())
    }
}

impl Trigger for Fake {
    fn fire(&mut self, _: Duration) -> Result<Timestamp, Error> {
        Ok(Timestamp(0))
    }
}

fn head(frames: &[u64]) -> (Head<Fake, Fake, Fake>, Arc<Mutex<Log>>) {
    let log = Arc::new(Mutex::new(Log {
        frames: frames.iter().copied().collect(),
        ..Log::default()
    }));
    let fake = || Fake(Arc::clone(&log));
    (Head::new(fake(), fake(), fake()), log)
}

#[test]
fn frames_exposed_before_their_pattern_was_in_view_are_discarded() {
    let (mut head, _) = head(&[10, 99, 100, 150, 199, 230]);
    let mut seen = Vec::new();
    let exposure = head
        .acquire(&[1, 2], TIMEOUT, &mut |index, frame| {
            seen.push((index, frame.sequence()))
        })
        .unwrap();
    assert_eq!(seen, [(1, 100), (2, 230)]);
    assert_eq!(
        exposure,
        Exposure {
            started: Timestamp(100),
            done: Timestamp(230),
            stale: 4,
            // The fake camera counts by its frames' times: 10, 99, 100, 150, 199, 230.
            dropped: 88 + 49 + 48 + 30,
            missed_flips: 0,
            lag: Duration::from_nanos(30),
        }
    );
}

#[test]
fn a_camera_that_gives_only_stale_frames_ends_in_a_protocol_error() {
    let (mut head, log) = head(&[5; 50]);
    let error = head.acquire(&[1], TIMEOUT, &mut |_, _| ()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Protocol);
    assert!(
        log.lock().unwrap().frames.len() >= 50 - 20,
        "the number of tries is bounded"
    );
}

#[test]
fn the_camera_is_stopped_and_the_projector_blank_also_after_an_error() {
    let (mut head, log) = head(&[100]);
    let error = head.acquire(&[1, 2], TIMEOUT, &mut |_, _| ()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Timeout);
    let log = log.lock().unwrap();
    assert!(!log.running && log.shown.is_none());
}

#[test]
fn a_sequence_ends_early_when_nobody_wants_the_rest_and_the_head_is_left_as_always() {
    let (mut head, log) = head(&[100, 200, 300]);
    let mut seen = 0;
    let mut first = |_, _| {
        seen += 1;
        false
    };
    let exposure = head.acquire_while(&[1, 2, 3], TIMEOUT, &mut first).unwrap();
    assert_eq!((seen, exposure.done), (1, Timestamp(100)));
    let log = log.lock().unwrap();
    assert_eq!((log.frames.len(), log.running, log.shown), (2, false, None));
}
