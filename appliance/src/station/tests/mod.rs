//! One named test for each rule of the station.

mod faults;
mod other_recipe;
mod recipes;
mod results;
mod table;
mod triggers;
mod walk;

use std::sync::Arc;

use super::control::{self, BY_PART_NUMBER};
use super::error_code;
use super::snapshot::reject;
use super::snapshot::{status, warning};
use super::*;

/// A station under test with its own clock and one PLC connection.
pub(super) struct Bench {
    pub(super) station: Station,
    pub(super) now: Micros,
    pub(super) effects: Vec<Effect>,
    edges: ConnectionEdges,
}

pub(super) fn settings() -> Settings {
    let identity = Identity {
        vendor: "v".into(),
        product: "p".into(),
        serial: "s".into(),
        version: "1".into(),
    };
    Settings {
        next_seq: 41,
        buffered: Default::default(),
        boot_id: 7,
        teach_allowed: false,
        identity: Arc::new(identity),
        limits: Limits::default(),
    }
}

pub(super) fn recipe(number: u16) -> ActiveRecipe {
    ActiveRecipe {
        number,
        crc: u32::from(number) << 16,
        part_number: format!("PART-{number}").into(),
        name: "part".into(),
    }
}

pub(super) fn good() -> Arc<Inspection> {
    let gauge = GaugeValue::judged(
        1,
        "height",
        Unit::Length,
        Measured::new(Some(0.1), Some(0.01)),
        (Some(-1.0), Some(1.0)),
    );
    Arc::new(Inspection {
        judged: Verdict::Pass,
        gauges: [gauge].into_iter().collect(),
        ..Default::default()
    })
}

impl Bench {
    pub(super) fn booting_with(settings: Settings) -> Self {
        let station = Station::new(settings, Micros(0));
        Self {
            station,
            now: Micros(0),
            effects: Vec::new(),
            edges: ConnectionEdges::default(),
        }
    }

    /// Ready with recipe 1; the PLC's first write of CONTROL has been made.
    pub(super) fn ready_with(settings: Settings) -> Self {
        let mut bench = Self::booting_with(settings);
        bench.event(Event::Started);
        bench.event(Event::Request(Request::Load(RecipeKey::Number(1))));
        let job = bench.job();
        bench.event(Event::RecipeLoaded {
            job,
            recipe: recipe(1),
        });
        bench.control(control::ONLINE);
        bench.effects.clear();
        bench
    }

    pub(super) fn ready() -> Self {
        Self::ready_with(settings())
    }

    pub(super) fn event(&mut self, event: Event) -> Snapshot {
        self.now = self.now.after(Micros(10));
        let (station, effects) = step(self.station.clone(), event, self.now);
        self.station = station;
        self.effects.extend(effects);
        self.station.snapshot()
    }

    pub(super) fn write(&mut self, write: ControlWrite) -> Snapshot {
        let rising = self.edges.rise(write.control);
        let client = self.edges.client();
        self.event(Event::Write {
            write,
            rising,
            client,
        })
    }

    fn control(&mut self, bits: u16) -> Snapshot {
        self.write(ControlWrite {
            control: Masked::<u16>::all(bits),
            ..Default::default()
        })
    }

    /// Raises one bit and lowers it again; answers with the snapshot while it is up.
    fn pulse(&mut self, bit: u16) -> Snapshot {
        let level = self.station.plc.registers.control & !bit;
        let up = self.control(level | bit);
        self.control(level);
        up
    }

    fn token(&mut self, token: u16) -> Snapshot {
        self.write(ControlWrite {
            token: Some(token),
            ..Default::default()
        })
    }

    fn select(&mut self, recipe: u16) {
        self.write(ControlWrite {
            recipe_select: Some(recipe),
            ..Default::default()
        });
    }

    /// Asks for a recipe as the PLC does, and lets the worker answer.
    fn load(&mut self, number: u16, answer: Result<(), RecipeResult>) -> Snapshot {
        self.select(number);
        self.pulse(control::RECIPE_LOAD);
        let job = self.job();
        self.event(match answer {
            Ok(()) => Event::RecipeLoaded {
                job,
                recipe: recipe(number),
            },
            Err(result) => Event::LoadFailed {
                job,
                result,
                message: "no".into(),
            },
        })
    }

    /// Begins to teach a recipe.
    fn teach(&mut self, number: u16) -> JobId {
        self.event(Event::Request(Request::Teach(Teaching::of(number))));
        self.job()
    }

    pub(super) fn job(&self) -> JobId {
        self.station.worker.last_job
    }

    fn finish(&mut self) -> Snapshot {
        let job = self.job();
        self.event(Event::ExposureDone { job });
        self.event(Event::Finished {
            job,
            inspection: good(),
        })
    }

    fn tick_after(&mut self, ms: u64) -> Snapshot {
        self.now = self.now.after(Micros::from_millis(ms));
        self.event(Event::Tick { utc_us: None })
    }

    pub(super) fn measured(&self) -> usize {
        self.effects
            .iter()
            .filter(|effect| matches!(effect, Effect::Measure(_)))
            .count()
    }
}
