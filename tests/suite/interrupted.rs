//! Teaching and loading that fail at any stage: the recipe before goes on, and a first teach can be
//! repeated.

use crate::recovery::{ABORT, PASS, start, starting};
use crate::station_plc::{ONLINE, Place, Plc, READY, RECIPE_OK, SMALL_HEAD, Status};
use appliance::service::Daemon;
use appliance::station::{Event, RecipeKey, Request, Snapshot, Teaching};
use hal::error::DeviceKind;
use std::fs;
use std::path::PathBuf;
use tests::until::{PATIENCE, until};

/// What ends a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    Abort,
    Unplugged(DeviceKind),
    /// A directory where the recipe is to be stored.
    Card,
}

const CAUSES: [Cause; 4] = [
    Cause::Abort,
    Cause::Unplugged(DeviceKind::Camera),
    Cause::Unplugged(DeviceKind::Projector),
    Cause::Card,
];

/// A station, and where it would store a recipe.
struct Station<'a> {
    daemon: &'a Daemon,
    plc: Plc,
    file: PathBuf,
}

impl<'a> Station<'a> {
    fn new(daemon: &'a Daemon, place: &Place, number: u16) -> Self {
        let mut plc = Plc::at(daemon.modbus);
        plc.write(0, &[ONLINE]);
        let file = place.path(&format!("state/recipes/{number:04}.recipe"));
        Self { daemon, plc, file }
    }

    /// Waits until so much of the job is done, ends it, and takes the cause away when the station
    /// has noticed.
    fn interrupt(&mut self, share: f32, cause: Cause) {
        let station = &self.daemon.station;
        let done = |snapshot: &Snapshot| {
            // A first start teaches after it has opened the head.
            if snapshot.state_word == "boot" {
                return Some(-1.0);
            }
            let taught = snapshot.teach.as_ref().map(|job| job.fraction);
            taught.or(snapshot.load.as_ref().map(|job| job.fraction))
        };
        until("share", PATIENCE, || match done(&station.snapshot()) {
            Some(reached) if reached < share => Err(reached),
            _ => Ok(()),
        });
        let ended = || {
            until("end of the job", PATIENCE, || match station.snapshot() {
                snapshot if snapshot.is_at_rest() => Ok(()),
                snapshot => Err(snapshot.state_word),
            });
        };
        match cause {
            Cause::Abort => {
                self.plc.write(0, &[ONLINE | ABORT]);
                self.plc.write(0, &[ONLINE]);
            }
            Cause::Unplugged(device) => {
                let stage = self.daemon.stage.as_ref().unwrap();
                stage.unplug(device);
                // Also a station that has ended its job meanwhile notices.
                let lost = || match station.snapshot().fault.clone() {
                    None => Err(()),
                    Some(fault) => Ok(fault),
                };
                until("fault", PATIENCE, lost);
                stage.plug(device);
            }
            Cause::Card => {
                if fs::create_dir(&self.file).is_ok() {
                    ended();
                    fs::remove_dir(&self.file).unwrap();
                }
            }
        }
        ended();
    }

    /// Asks for a recipe, and waits until it is active.
    fn request(&mut self, request: Request, number: u16) {
        self.daemon.station.event(Event::Request(request));
        until("recipe", PATIENCE, || {
            match self.daemon.station.snapshot() {
                snapshot if snapshot.active() == Some(number) && !snapshot.is_working() => Ok(()),
                snapshot => Err(format!("{snapshot:?}")),
            }
        });
    }

    /// Measures as a PLC that comes back, and gives the status before.
    fn measure(&mut self, token: u16) -> (Status, u16) {
        self.plc.write(0, &[ONLINE]);
        let before = self.plc.wait("READY", |of| of.has(READY | RECIPE_OK));
        (before, self.plc.measure(token)[8])
    }
}

fn teach(number: u16) -> Request {
    Request::Teach(Teaching::of(number))
}

fn load(number: u16) -> Request {
    Request::Load(RecipeKey::Number(number))
}

/// Teaches and loads recipe 2 so many times each, which fails at another stage each time.
fn fail(teaches: usize, loads: usize) {
    let place = Place::taught();
    let daemon = start(&place);
    let mut station = Station::new(&daemon, &place, 2);
    let (mut late, mut token) = (0, 0);
    let before = station.plc.status().crc();
    for at in 0..teaches {
        let (share, cause) = (at as f32 / teaches as f32, CAUSES[at % CAUSES.len()]);
        station.daemon.station.event(Event::Request(teach(2)));
        station.interrupt(share, cause);
        token += 1;
        let (after, verdict) = station.measure(token);
        assert_eq!(verdict, PASS, "{cause:?} at {share}");
        if daemon.station.snapshot().active() == Some(2) {
            late += 1;
            station.request(load(1), 1);
            fs::remove_file(&station.file).unwrap();
        } else {
            assert_eq!(after.crc(), before, "{cause:?} at {share}");
            // What was stored before its patterns could be loaded stays stored.
            if station.file.exists() {
                assert!(share > 0.9, "{cause:?} at {share}");
                fs::remove_file(&station.file).unwrap();
            }
        }
    }
    println!("{late} of {teaches} teaches had ended before their failure");
    assert!(2 * late < teaches, "{late}");
    station.request(teach(2), 2);
    let recipe = fs::read(&station.file).unwrap();
    for at in 0..loads {
        station.request(load(1), 1);
        let cause = CAUSES[at % CAUSES.len()];
        if cause == Cause::Card {
            let size = recipe.len() * at / loads;
            fs::write(&station.file, &recipe[..size]).unwrap();
        }
        station.daemon.station.event(Event::Request(load(2)));
        match cause {
            Cause::Card => until("end of the load", PATIENCE, || {
                match daemon.station.snapshot().is_working() {
                    true => Err(()),
                    false => Ok(()),
                }
            }),
            cause => station.interrupt(at as f32 / loads as f32, cause),
        }
        // A PLC asks again for the recipe that it wants.
        let active = daemon.station.snapshot().active();
        let active = active.expect("a recipe is active");
        station.request(load(active), active);
        token += 1;
        let (after, verdict) = station.measure(token);
        assert_eq!(verdict, PASS, "{cause:?}, load {at}");
        if cause == Cause::Card {
            assert_eq!(after.crc(), before, "load {at}");
            fs::write(&station.file, &recipe).unwrap();
        }
    }
    daemon.stop();
}

/// A first teach that fails, so many times: it is repeated without a restart.
fn fail_at_first(times: usize) {
    for at in 0..times {
        let (share, cause) = (at as f32 / times as f32, CAUSES[at % CAUSES.len()]);
        let place = Place::before(SMALL_HEAD);
        let daemon = starting(&place);
        let mut station = Station::new(&daemon, &place, 1);
        fs::create_dir_all(station.file.parent().unwrap()).unwrap();
        station.interrupt(share, cause);
        if daemon.station.snapshot().active().is_none() {
            station.request(teach(1), 1);
        }
        assert_eq!(station.measure(1).1, PASS, "{cause:?} at {share}");
        daemon.stop();
    }
}

#[test]
fn the_recipe_before_goes_on_wherever_a_teach_or_a_load_fails() {
    fail(6, 4);
}

#[test]
fn a_first_teach_that_fails_anywhere_can_be_repeated() {
    fail_at_first(2);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_hundred_failures_at_every_stage_leave_the_station_as_it_was() {
    fail(48, 32);
    fail_at_first(20);
}
