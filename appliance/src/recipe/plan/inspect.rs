//! Judging a part by a plan: levels are decoded as their frames arrive, the rest follows once the
//! last frame is there.

use super::light::Light;
use super::run::Run;
use super::{Plan, judge};
use crate::head::seam;
use crate::recipe::{Demands, FeatureView, Refusal};
use crate::station::error_code::WRONG_FRAMES;
use crate::station::result::flag::{JUDGES_NOTHING, SIMULATED};
use crate::station::{Inspection, Stage, Stages, Verdict};
use algo::flicker::Steadiness;
use algo::frame::FrameView;
use algo::inspect::{Drawing, Findings, Input, Maps, PairPlaced, Signal, Strips};
use algo::pattern::{MAX_FRAMES, MAX_SHIFTS};
use algo::phase::{Arrived, DecodeError};
use algo::pipeline::{arrive, arrive_rest};
use hal::frame::Frame;
use std::sync::{MutexGuard, PoisonError};
use std::time::Instant;

/// Measures how long stages take, each from the end of the one before.
pub(super) struct Laps {
    pub stages: Stages,
    since: Instant,
}

impl Laps {
    pub fn since(since: Instant) -> Self {
        let stages = Stages::default();
        Self { stages, since }
    }

    pub fn now() -> Self {
        Self::since(Instant::now())
    }

    pub fn end(&mut self, stage: Stage) {
        let now = Instant::now();
        let us = (now - self.since).as_micros();
        self.stages
            .add(stage, u32::try_from(us).unwrap_or(u32::MAX));
        self.since = now;
    }
}

/// The decoded levels of a sequence that is being exposed.
#[derive(Debug)]
pub struct Arriving {
    sequence: usize,
    /// `None` if the recipe has no such sequence, or its frames do not fit it.
    arrived: Option<Arrived>,
    /// What all frames tell of their light, once that was asked.
    light: Option<Steadiness>,
}

/// What was found in the frames of a sequence.
pub(super) struct Found {
    pub findings: Findings,
    /// Of two frames how much the picture is like golden's.
    pub likeness: Option<f64>,
    pub light: Steadiness,
}

impl From<Findings> for Found {
    /// In steady light.
    fn from(findings: Findings) -> Self {
        Self {
            findings,
            likeness: None,
            light: Steadiness::Steady,
        }
    }
}

impl Arriving {
    /// The index of the sequence.
    pub(super) fn sequence(&self) -> usize {
        self.sequence
    }
}

impl Plan {
    /// Begins a measurement with a sequence.
    pub fn arriving(&self, sequence: usize) -> Arriving {
        Arriving {
            sequence,
            arrived: self.runs.get(sequence).map(Run::room),
            light: None,
        }
    }

    /// Whether the light of the frames, which are all, changed so much that they must be taken again.
    pub fn is_light_broken(&self, arriving: &mut Arriving, frames: &[Frame]) -> bool {
        let places: heapless::Vec<usize, MAX_FRAMES> = (0..frames.len().min(MAX_FRAMES)).collect();
        if let (Some(run), Some(views)) = (
            self.runs.get(arriving.sequence),
            views::<MAX_FRAMES>(&places, frames),
        ) {
            arriving.light = run.light(&views).ok();
        }
        matches!(arriving.light, Some(Steadiness::Broken(_)))
    }

    /// Whether the frames so far complete a level that can be decoded now.
    pub fn can_arrive(&self, arriving: &Arriving, frames: usize) -> bool {
        let (Some(run), Some(arrived)) = (self.runs.get(arriving.sequence), &arriving.arrived)
        else {
            return false;
        };
        let places = run.coarser().nth(arrived.levels());
        places.is_some_and(|places| places.iter().all(|&at| at < frames))
    }

    /// Decodes the level that the frames so far complete.
    pub fn arrive(&self, arriving: &mut Arriving, frames: &[Frame]) {
        let (Some(run), Some(arrived)) = (self.runs.get(arriving.sequence), &mut arriving.arrived)
        else {
            return;
        };
        let decoder = run.production.decoder();
        let places = run.coarser().nth(arrived.levels()).unwrap_or(&[]);
        let views: Option<heapless::Vec<_, MAX_SHIFTS>> = views(places, frames);
        // Frames that do not fit are reported when all of them are inspected.
        if views.is_none_or(|views| arrive(decoder, &views, arrived).is_err()) {
            arriving.arrived = None;
        }
    }
}

impl Run {
    /// The frames of all levels but the finest.
    fn coarser(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        let levels = self.production.decoder().levels();
        let coarser = levels.len().saturating_sub(1);
        levels.take(coarser)
    }

    /// The decoded levels of a sequence, all but the finest, and the views of that. The levels that
    /// have not arrived yet are decoded.
    pub(super) fn complete<'a>(
        &self,
        arriving: Arriving,
        frames: &[FrameView<'a>],
    ) -> Result<(Arrived, heapless::Vec<FrameView<'a>, MAX_SHIFTS>), DecodeError> {
        self.production.check(frames)?;
        let mut arrived = arriving.arrived.unwrap_or_else(|| self.room());
        let finest = arrive_rest(self.production.decoder(), frames, &mut arrived)?;
        Ok((arrived, finest))
    }

    /// What the frames of the sequence tell of their light.
    fn light(&self, frames: &[FrameView<'_>]) -> Result<Steadiness, DecodeError> {
        self.production.check(frames)?;
        Ok(self.watch.look(frames))
    }

    /// Keeps the memory of decoded levels for the next measurement.
    pub(super) fn keep(&self, arrived: Arrived) {
        *self.arrived.lock().unwrap_or_else(PoisonError::into_inner) = Some(arrived);
    }

    /// Memory for decoded levels.
    fn room(&self) -> Arrived {
        let mut kept = self.arrived.lock().unwrap_or_else(PoisonError::into_inner);
        let production = &self.production;
        let (width, height) = (
            production.cubics().surface().width,
            production.window().len(),
        );
        let room = kept.take();
        let mut room = room.unwrap_or_else(|| production.decoder().arrived(width, height));
        room.restart();
        room
    }
}

/// Views of some of the frames; `None` if a frame is missing or inconsistent.
fn views<'a, const MOST: usize>(
    places: &[usize],
    frames: &'a [Frame],
) -> Option<heapless::Vec<FrameView<'a>, MOST>> {
    let view = |&at: &usize| seam::view(frames.get(at)?).ok();
    places.iter().map(view).collect()
}

impl Plan {
    /// Judges a part from the frames of a sequence; the times of its stages begin at `exposed`. A
    /// part that cannot be measured is INVALID with a reason.
    pub fn inspect(&self, sequence: usize, frames: &[Frame], exposed: Instant) -> Inspection {
        self.inspect_arrived(frames, self.arriving(sequence), exposed)
    }

    /// As [`Self::inspect`], with the levels that were decoded on arrival.
    pub fn inspect_arrived(
        &self,
        frames: &[Frame],
        arriving: Arriving,
        exposed: Instant,
    ) -> Inspection {
        let sequence = arriving.sequence();
        let mut laps = Laps::since(exposed);
        let of = (arriving, frames);
        let found = self.run(&mut self.strips(), of, Maps::default(), &mut laps);
        self.judged((sequence, frames), found, &mut laps)
    }

    /// The inspection by the findings of the frames of a sequence, or by why there are none.
    pub(super) fn judged(
        &self,
        (sequence, frames): (usize, &[Frame]),
        found: Result<Found, Refusal>,
        laps: &mut Laps,
    ) -> Inspection {
        let simulated = if self.simulated { SIMULATED } else { 0 };
        let nothing = match self.demands.judges_nothing {
            true => JUDGES_NOTHING,
            false => 0,
        };
        let kind = self.runs.get(sequence).map(|run| run.kind);
        let mut inspection = Inspection {
            flags: kind.map_or(0, judge::sequence_flag) | simulated | nothing,
            ..Inspection::default()
        };
        match found {
            Ok(Found {
                findings,
                likeness,
                light,
            }) => {
                self.demands.judge(&findings, &mut inspection);
                if sequence + 1 < self.runs.len() {
                    let unlike = likeness.is_some_and(|likeness| likeness < judge::ALIKE);
                    inspection.step_up = match unlike {
                        true => Some("the frames differ from those of the part that was taught"),
                        false => self.demands.step_up(&findings, &inspection),
                    };
                }
                if inspection.step_up.is_none() && Demands::doubts_the_light(&inspection) {
                    let light = self.light(sequence, frames);
                    self.demands.explain(light, &mut inspection);
                }
                self.tell_changes(light, frames, &mut inspection);
            }
            Err(reason) => {
                inspection.judged = Verdict::Invalid;
                let words = format!("{}: set the camera as it was, or teach again", reason.words);
                inspection.reason = Some(words.into());
                inspection.error_code = WRONG_FRAMES;
            }
        }
        laps.end(Stage::Judgement);
        inspection.stages = laps.stages.clone();
        inspection
    }

    /// The light of a part from the frames of a sequence; none if the frames do not fit.
    pub(super) fn light(&self, sequence: usize, frames: &[Frame]) -> Option<Light> {
        let full_scale = self.runs.get(sequence)?.production.decoder().full_scale();
        let modulation = self.modulation(sequence, frames)?;
        let views: Result<Vec<FrameView<'_>>, _> = frames.iter().map(seam::view).collect();
        Light::of(&self.golden_light, &views.ok()?, (&modulation, full_scale))
    }

    /// The buffers of an inspection.
    pub(super) fn strips(&self) -> MutexGuard<'_, Strips> {
        // A poisoned lock does no harm: strips are cleared before they are used.
        self.strips.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is found in the frames of a sequence. Where their light changes, it is taken out of them.
    pub(super) fn run(
        &self,
        strips: &mut Strips,
        (mut arriving, frames): (Arriving, &[Frame]),
        maps: Maps<'_>,
        laps: &mut Laps,
    ) -> Result<Found, Refusal> {
        let sequence = arriving.sequence();
        let run = self.runs.get(sequence);
        let run = run.ok_or_else(|| format!("the recipe has no sequence {sequence}"))?;
        // On the stack: a trigger allocates nothing.
        let mut views: heapless::Vec<FrameView<'_>, MAX_FRAMES> = heapless::Vec::new();
        for frame in frames {
            let view = seam::view(frame)?;
            let full = |_| format!("{} frames are more than any sequence has", frames.len());
            views.push(view).map_err(full)?;
        }
        let production = &run.production;
        if let Some(buffers) = &run.pair {
            let mut buffers = buffers.lock().unwrap_or_else(PoisonError::into_inner);
            let placed = production.place_pair(&views, strips, &mut buffers);
            laps.end(Stage::Alignment);
            let findings = placed.and_then(|PairPlaced { found, placed }| {
                let input = (Input::Phases(buffers.phases()), Signal::None);
                let findings = production.inspect_placed(input, strips, placed, maps)?;
                let likeness = Some(found.map_or(0.0, |found| found.likeness));
                Ok(Found {
                    likeness,
                    ..findings.into()
                })
            });
            laps.end(Stage::Strips);
            return Ok(findings?);
        }
        let light = arriving.light.take();
        let light = light.map_or_else(|| run.light(&views), Ok)?;
        let (steady, unsteady) = match &light {
            Steadiness::Flickers(flicker) => {
                (Some(run.watch.steady(&views, flicker)), flicker.left)
            }
            _ => (None, 0.0),
        };
        let mut views = views;
        if let Some(steady) = &steady {
            views = steady.views().collect();
            if let Some(arrived) = &mut arriving.arrived {
                arrived.restart();
            }
        }
        let (arrived, finest) = run.complete(arriving, &views)?;
        let input = Input::Finest(&arrived, &finest);
        let placed = production.place(input, strips);
        laps.end(Stage::Alignment);
        let findings = placed.and_then(|placed| {
            let input = (input, Signal::Frames(&views, unsteady));
            production.inspect_placed(input, strips, placed, maps)
        });
        laps.end(Stage::Strips);
        run.keep(arrived);
        Ok(Found {
            light,
            ..findings?.into()
        })
    }
}

impl Plan {
    /// Judges a part as [`Self::inspect`] does, and says what became of the features that gauges
    /// need.
    pub fn look(&self, sequence: usize, frames: &[Frame]) -> (Inspection, Vec<FeatureView<'_>>) {
        let mut laps = Laps::now();
        let mut strips = self.strips();
        let of = (self.arriving(sequence), frames);
        let found = self.run(&mut strips, of, Maps::default(), &mut laps);
        let inspection = self.judged((sequence, frames), found, &mut laps);
        let seen = self.runs.get(sequence).map(|run| {
            let drawing = Drawing::new(&run.production, &strips);
            self.demands.seen(&inspection, &drawing)
        });
        let seen = seen.unwrap_or_default();
        drop(strips);
        (inspection, seen)
    }
}
