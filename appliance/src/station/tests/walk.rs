//! A seeded random walk: whatever happens in whatever order, the promises to the PLC hold.

use std::sync::Arc;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use super::{good, recipe, settings};
use crate::station::control;
use crate::station::event::MAX_EFFECTS;
use crate::station::results::MAX_BUFFERED;
use crate::station::snapshot::status;
use crate::station::*;

const EVENTS: u32 = 100_000;

/// The choices of the walk.
struct Random(SplitMix64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0.next_u64() % n
    }

    fn word(&mut self, n: u64) -> u16 {
        u16::try_from(self.below(n)).unwrap_or(0)
    }
}

fn plc_write(random: &mut Random, edges: &mut ConnectionEdges) -> Event {
    let mut write = ControlWrite::default();
    if random.below(2) == 0 {
        // Mostly online, so that the walk reaches all states.
        let online = u16::from(random.below(8) != 0);
        write.control = Masked::<u16>::all((random.word(256) & !1) | online);
    }
    if random.below(2) == 0 {
        write.token = Some(random.word(20));
    }
    if random.below(4) == 0 {
        // Mostly 0, so that the walk measures; else one that may or may not be active.
        write.recipe_select = Some(random.word(4) * u16::from(random.below(4) == 0));
    }
    if random.below(4) == 0 {
        write.plc_heartbeat = Some(random.word(9));
    }
    if random.below(50) == 0 {
        *edges = ConnectionEdges::default();
    }
    write
        .check()
        .expect("the walk writes only what may be written");
    let rising = edges.rise(write.control);
    Event::Write {
        write,
        rising,
        client: edges.client(),
    }
}

fn any_event(random: &mut Random, edges: &mut ConnectionEdges, last: JobId) -> Event {
    let job = if random.below(10) == 0 {
        JobId(last.0.wrapping_sub(1))
    } else {
        last
    };
    let words: Arc<str> = "w".into();
    let number = random.word(9) + 1;
    match random.below(43) {
        0..10 => plc_write(random, edges),
        10..14 => Event::ExposureDone { job },
        14..20 => Event::Finished {
            job,
            inspection: good(),
        },
        20 => Event::MeasureFailed {
            job,
            error_code: random.word(900),
            message: words,
        },
        21..24 => Event::RecipeLoaded {
            job,
            recipe: recipe(number),
        },
        24 => Event::LoadFailed {
            job,
            result: RecipeResult::Unknown,
            message: words,
        },
        25 => Event::Progress {
            job,
            fraction: 0.3,
            words,
        },
        26 | 27 => Event::Taught {
            job,
            recipe: recipe(number),
        },
        28 => Event::TeachFailed {
            job,
            error_code: 201,
            message: words,
        },
        29 if random.below(20) == 0 => Event::Faulted {
            error_code: 101,
            cause: words.clone(),
            remedy: words,
        },
        30 => Event::Recovered {
            recipe: (random.below(3) != 0).then(|| recipe(number)),
        },
        40 => Event::Surveyed(System {
            free_storage_mib: Some(if random.below(50) == 0 { 0 } else { 1000 }),
            ..System::default()
        }),
        41 => Event::Paced(Pace {
            dropped: 1,
            ..Pace::default()
        }),
        31 if random.below(4) == 0 => Event::Request(Request::Load(RecipeKey::Number(number))),
        32 if random.below(9) == 0 => Event::Request(Request::Teach(Teaching {
            keep_gauges: number.is_multiple_of(2),
            ..Teaching::of(number)
        })),
        32 if random.below(12) == 0 => Event::Request(Request::Commission),
        36 => Event::Commissioned {
            job,
            recipe: Some(recipe(number)),
        },
        33 => Event::Started,
        34 => Event::Condition(Condition::default()),
        35 => Event::Alive,
        _ => Event::Tick {
            utc_us: Some(random.below(1 << 50)),
        },
    }
}

/// Whether the active recipe is the selected one and no load has failed since it became active.
fn asked_for(after: &Snapshot) -> bool {
    let (select, active) = (after.control.recipe_select, after.active());
    (select == 0 || Some(select) == active) && after.recipe_result == RecipeResult::Ok
}

#[test]
fn a_hundred_thousand_random_events_break_no_promise() {
    let mut random = Random(SplitMix64::seed_from_u64(2024));
    let mut edges = ConnectionEdges::default();
    let settings = Settings {
        teach_allowed: true,
        next_seq: u32::MAX - 100,
        ..settings()
    };
    let mut next_seq = settings.next_seq;
    let mut station = Station::new(settings, Micros(0));
    let (mut now, mut measures, mut results, mut most) = (Micros(0), 0_u32, 0_u32, 0);
    // While the storage is broken no number is stored; the answer comes before anything else
    // happens.
    let (mut broken, mut answers) = (false, Vec::new());
    for count in 0..EVENTS {
        // Now and then long enough for a deadline; the silent load or teach goes on then.
        let pause = if random.below(2000) == 0 {
            40_000
        } else {
            random.below(50)
        };
        now = now.after(Micros::from_millis(pause));
        let before = station.snapshot();
        if random.below(if broken { 20 } else { 1000 }) == 0 {
            broken = !broken;
        }
        let event = answers
            .pop()
            .unwrap_or_else(|| any_event(&mut random, &mut edges, station.worker.last_job));
        let (next, effects) = step(station, event.clone(), now);
        station = next;
        let after = station.snapshot();
        most = most.max(effects.len());
        let mut persisted = None;
        for effect in &effects {
            match effect {
                Effect::Measure(job) => {
                    measures += 1;
                    assert!(
                        before.state != 2 && before.state != 3,
                        "{count}: measured twice at once"
                    );
                    assert!(
                        after.recipe.as_ref() == Some(&job.recipe),
                        "{count}: measured with another recipe"
                    );
                    assert!(
                        asked_for(&after),
                        "{count}: measured with a recipe that was not asked for"
                    );
                }
                Effect::PersistSeq(seq) => {
                    persisted = Some(*seq);
                    answers.push(Event::Stored {
                        seq: *seq,
                        failed: broken.then(|| Unstored::Refused("no room".into())),
                    });
                }
                Effect::Publish(record) => {
                    results += 1;
                    assert_eq!(
                        persisted,
                        Some(record.seq),
                        "{count}: SEQ was not stored first"
                    );
                    assert_eq!(record.seq, next_seq, "{count}: SEQ has a gap");
                    assert_ne!(record.verdict, Verdict::None);
                    next_seq = next_seq.wrapping_add(1);
                }
                _ => {}
            }
        }
        let in_flight = u32::from(matches!(after.state, 2 | 3));
        assert_eq!(
            (after.triggers, after.result_seq),
            (measures, next_seq.wrapping_sub(1)),
            "{count}: {event:?}"
        );
        assert_eq!(
            results + in_flight,
            measures,
            "{count}: a trigger without its one result after {event:?}"
        );
        let may = after.state == 1
            && after.recipe.is_some()
            && !station.results.unstored
            && asked_for(&after)
            && after.control.control & control::ONLINE != 0;
        assert_eq!(after.is(status::READY), may, "{count}: READY");
        assert!(
            !after.is(status::RESULT_VALID) || after.result.is_some(),
            "{count}: RESULT_VALID without a result"
        );
        assert!(
            usize::from(after.buffered) <= MAX_BUFFERED
                && (after.buffered == 0) == after.oldest.is_none()
        );
        assert_eq!(after.is(status::ERROR), after.error_code != 0);
        assert_eq!(after.fault.is_some(), after.state == 7);
        assert!(
            !station.results.unstored || !after.is(status::READY),
            "{count}: READY while a result's number is not stored"
        );
        assert!(after.missed >= before.missed && after.triggers >= before.triggers);
    }
    assert!(measures > 2_000, "the walk measured only {measures} times");
    assert!(
        station.requests.missed > 1_000,
        "the walk missed only {} triggers",
        station.requests.missed
    );
    assert!(most < MAX_EFFECTS, "{most} effects of one event");
}
