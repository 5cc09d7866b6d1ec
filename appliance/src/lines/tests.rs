//! The lines with a start line and lamps of this process, and a real station.

use super::*;
use crate::station::snapshot::reject::OTHER_RECIPE;
use crate::station::{
    ActiveRecipe, ConnectionEdges, Effect, GaugeValue, Identity, Inspection, JobId, Limits,
    Measured, Micros, RecipeKey, Request, ResultRecord, Settings, Station, Unit, Verdict,
};
use hal::lines::OutputLine;
use rustix::io::{read, write};
use rustix::pipe::{PipeFlags, pipe_with};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Far more than anything here takes.
const PATIENCE: Duration = Duration::from_secs(20);

pub(super) fn settings() -> Settings {
    Settings {
        next_seq: 41,
        buffered: Default::default(),
        boot_id: 7,
        teach_allowed: false,
        identity: Arc::new(Identity {
            vendor: "v".into(),
            product: "p".into(),
            serial: "s".into(),
            version: "1".into(),
        }),
        limits: Limits::default(),
    }
}

/// A start line that is a pipe: each byte is a start.
struct Button(OwnedFd);

impl AsFd for Button {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl StartLine for Button {
    fn poll_start(&mut self) -> Result<Option<Timestamp>, Error> {
        Ok(read(&self.0, &mut [0; 1])
            .is_ok_and(|n| n == 1)
            .then(monotonic))
    }

    fn settles(&self) -> Option<Timestamp> {
        None
    }
}

/// What was put on the lines, in turn.
#[derive(Clone, Default)]
struct Panel {
    told: Arc<Mutex<Vec<(&'static str, bool)>>>,
    broken: Arc<AtomicBool>,
}

struct Lamp(&'static str, Panel);

impl OutputLine for Lamp {
    fn set(&mut self, on: bool) -> Result<(), Error> {
        if self.1.broken.load(Ordering::Relaxed) {
            return Err(Error::disconnected(hal::error::DeviceKind::Lines, "a lamp"));
        }
        self.1.told.lock().unwrap().push((self.0, on));
        Ok(())
    }
}

impl Panel {
    fn wires(&self) -> Wires {
        let lamp =
            |name| -> Option<Box<dyn OutputLine>> { Some(Box::new(Lamp(name, self.clone()))) };
        Wires {
            start: None,
            busy: lamp("busy"),
            ok: lamp("ok"),
            fault: lamp("fault"),
        }
    }

    /// The changes of the lamps that come before `last`, all off at first, as "+busy -busy +ok".
    fn until(&self, last: &str) -> String {
        let begun = Instant::now();
        loop {
            let mut lit = [("busy", false), ("ok", false), ("fault", false)];
            let mut words = Vec::new();
            for (name, on) in self.told.lock().unwrap().iter() {
                let lamp = lit.iter_mut().find(|lamp| lamp.0 == *name).unwrap();
                if std::mem::replace(&mut lamp.1, *on) != *on {
                    words.push(format!("{}{name}", if *on { '+' } else { '-' }));
                }
            }
            let words = words.join(" ");
            if words.ends_with(last) || begun.elapsed() > PATIENCE {
                return words;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// A station that is ready, and the orders to its worker.
fn ready() -> (StationHandle, Receiver<JobId>) {
    let (told, orders) = channel();
    let station = Station::new(settings(), Micros(0));
    let station = StationHandle::new(station, Instant::now(), move |effect| match effect {
        Effect::Load { job, .. } => Some(Event::RecipeLoaded {
            job,
            recipe: ActiveRecipe {
                number: 1,
                crc: 1,
                part_number: "PART-1".into(),
                name: "part".into(),
            },
        }),
        Effect::Measure(job) => {
            told.send(job.job).unwrap();
            None
        }
        Effect::PersistSeq(seq) => Some(Event::Stored { seq, failed: None }),
        _ => None,
    });
    station.event(Event::Started);
    station.event(Event::Request(Request::Load(RecipeKey::Number(1))));
    (station, orders)
}

fn good() -> Arc<Inspection> {
    let limits = (Some(-1.0), Some(1.0));
    let gauge = GaugeValue::judged(
        1,
        "height",
        Unit::Length,
        Measured::new(Some(0.1), Some(0.01)),
        limits,
    );
    Arc::new(Inspection {
        judged: Verdict::Pass,
        gauges: [gauge].into_iter().collect(),
        ..Inspection::default()
    })
}

/// Serves `wires` while `course` runs.
fn serving(wires: Wires, open: Reopen, station: &StationHandle, course: impl FnOnce()) {
    let (stop, stopped) = watch::channel(false);
    std::thread::scope(|scope| {
        let served = scope.spawn(|| serve(wires, &open, station, &Progress::new(true), stopped));
        course();
        stop.send(true).unwrap();
        served.join().unwrap().unwrap();
    });
}

/// A start line and the end at which it is pressed.
fn button() -> (Option<Box<dyn StartLine>>, OwnedFd) {
    let (line, finger) = pipe_with(PipeFlags::NONBLOCK).unwrap();
    (Some(Box::new(Button(line))), finger)
}

/// Waits until a trigger was missed.
fn missed(station: &StationHandle) {
    let begun = Instant::now();
    while station.snapshot().missed == 0 && begun.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn never() -> Reopen {
    Box::new(|| panic!("nothing is to be opened again"))
}

#[test]
fn a_start_by_wire_measures_one_part_and_the_lamps_follow() {
    let (station, orders) = ready();
    let panel = Panel::default();
    let (start, finger) = button();
    let wires = Wires {
        start,
        ..panel.wires()
    };
    serving(wires, never(), &station, || {
        write(&finger, b"!").unwrap();
        let job = orders.recv_timeout(PATIENCE).unwrap();
        assert_eq!(panel.until("+busy"), "+busy");
        station.event(Event::Finished {
            job,
            inspection: good(),
        });
        // Ok is on before busy goes off.
        assert_eq!(panel.until("-busy"), "+busy +ok -busy");
        write(&finger, b"!").unwrap();
        orders.recv_timeout(PATIENCE).unwrap();
        assert_eq!(panel.until("+busy"), "+busy +ok -busy -ok +busy");
    });
    assert_eq!(station.snapshot().triggers, 2);
}

#[test]
fn a_start_while_busy_is_counted_as_missed() {
    let (station, orders) = ready();
    let (start, finger) = button();
    let wires = Wires {
        start,
        ..Wires::default()
    };
    serving(wires, never(), &station, || {
        write(&finger, b"!!").unwrap();
        orders.recv_timeout(PATIENCE).unwrap();
        missed(&station);
    });
    let snapshot = station.snapshot();
    assert_eq!((snapshot.triggers, snapshot.missed), (1, 1));
}

#[test]
fn a_start_while_another_recipe_is_selected_measures_nothing_and_ok_goes_off() {
    let (station, orders) = ready();
    let panel = Panel::default();
    let (start, finger) = button();
    let wires = Wires {
        start,
        ..panel.wires()
    };
    serving(wires, never(), &station, || {
        write(&finger, b"!").unwrap();
        let job = orders.recv_timeout(PATIENCE).unwrap();
        station.event(Event::Finished {
            job,
            inspection: good(),
        });
        assert!(panel.until("-busy").ends_with("+ok -busy"));
        let select = ControlWrite {
            recipe_select: Some(77),
            ..ControlWrite::default()
        };
        station
            .write(&mut ConnectionEdges::default(), select)
            .unwrap();
        assert!(panel.until("+fault").ends_with("-ok +fault"));
        write(&finger, b"!").unwrap();
        missed(&station);
    });
    let snapshot = station.snapshot();
    assert_eq!((snapshot.triggers, snapshot.missed), (1, 1));
    assert_eq!(snapshot.reject_reason, OTHER_RECIPE);
}

#[test]
fn lines_that_went_are_opened_again_and_say_what_is_true_then() {
    let (station, _orders) = ready();
    let (panel, again) = (Panel::default(), Panel::default());
    let found = again.clone();
    let open: Reopen = Box::new(move || Ok(found.wires()));
    serving(panel.wires(), open, &station, || {
        panel.broken.store(true, Ordering::Relaxed);
        let message = "on purpose".into();
        station.event(Event::Faulted {
            error_code: 101,
            cause: message,
            remedy: "none".into(),
        });
        assert_eq!(again.until("+fault"), "+fault");
    });
}

const READY: (u16, u16) = (1, status::READY);
const ACQUIRING: (u16, u16) = (2, 0);
const LOADING: (u16, u16) = (4, 0);
const FAULT: (u16, u16) = (7, 0);

const BUSY: Signals = signals(true, false, false);
const OK: Signals = signals(false, true, false);
const NOT_OK: Signals = signals(false, false, false);

const fn signals(busy: bool, ok: bool, fault: bool) -> Signals {
    Signals { busy, ok, fault }
}

/// A station in this state, with the result of this number and so many missed triggers.
fn snapshot((state, status): (u16, u16), seq: u32, verdict: Verdict, missed: u32) -> Snapshot {
    let record = ResultRecord {
        seq,
        verdict,
        ..ResultRecord::default()
    };
    Snapshot {
        state,
        status,
        result_seq: seq,
        result: Some(Arc::new(record)),
        missed,
        ..Station::new(settings(), Micros(0)).snapshot()
    }
}

/// What is said after each of these snapshots, by a station that has just become ready.
fn said(snapshots: &[Snapshot]) -> Vec<Signals> {
    let (mut follower, first) = Follower::new(&snapshot(READY, 7, Verdict::Pass, 0));
    assert_eq!(first, NOT_OK, "an earlier result does not count");
    let said = snapshots
        .iter()
        .flat_map(|snapshot| follower.follow(snapshot).collect::<Vec<_>>());
    said.collect()
}

#[test]
fn a_part_that_passes_is_busy_then_ok_until_the_next_start() {
    let cycle = [
        snapshot(ACQUIRING, 7, Verdict::Pass, 0),
        snapshot(READY, 8, Verdict::Pass, 0),
        snapshot(READY, 8, Verdict::Pass, 0),
        snapshot(ACQUIRING, 8, Verdict::Pass, 0),
    ];
    assert_eq!(said(&cycle), [BUSY, OK, BUSY]);
}

#[test]
fn a_part_that_fails_or_could_not_be_measured_is_not_ok() {
    for verdict in [Verdict::Fail, Verdict::Invalid, Verdict::None] {
        let cycle = [
            snapshot(ACQUIRING, 7, Verdict::Pass, 0),
            snapshot(READY, 8, verdict, 0),
        ];
        assert_eq!(said(&cycle), [BUSY, NOT_OK]);
    }
}

#[test]
fn a_cycle_between_two_looks_is_busy_all_the_same() {
    let passed = snapshot(READY, 8, Verdict::Pass, 0);
    assert_eq!(said(&[passed]), [BUSY, OK]);
}

#[test]
fn a_missed_start_takes_ok_away() {
    let missed = [
        snapshot(READY, 8, Verdict::Pass, 0),
        snapshot(READY, 8, Verdict::Pass, 1),
    ];
    assert_eq!(said(&missed), [BUSY, OK, NOT_OK]);
}

#[test]
fn ok_does_not_come_back_after_a_fault_or_another_recipe() {
    for (between, shown) in [(FAULT, signals(false, false, true)), (LOADING, BUSY)] {
        let course = [
            snapshot(READY, 8, Verdict::Pass, 0),
            snapshot(between, 8, Verdict::Pass, 0),
            snapshot(READY, 8, Verdict::Pass, 0),
        ];
        assert_eq!(said(&course), [BUSY, OK, shown, NOT_OK]);
    }
}

#[test]
fn ok_does_not_come_back_where_the_end_of_the_cycle_and_the_change_of_recipe_were_one_look() {
    let course = [
        snapshot(LOADING, 8, Verdict::Pass, 0),
        snapshot(READY, 8, Verdict::Pass, 0),
    ];
    assert_eq!(said(&course), [BUSY, BUSY, NOT_OK]);
}

#[test]
fn a_station_that_waits_for_something_else_than_a_start_says_fault() {
    // Offline; and ready without a recipe.
    for state in [(6, 0), (1, 0), (7, 0)] {
        let waits = [snapshot(state, 7, Verdict::Pass, 0)];
        assert_eq!(said(&waits), [signals(false, false, true)]);
    }
}
