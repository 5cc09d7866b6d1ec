//! The sequencer: which pattern to show when, when to trigger, and whose each frame is. Decisions only.
//!
//! It gets what happened and the time as arguments ([`Sequencer::flipped`], [`Sequencer::fired`], [`Sequencer::spoiled`],
//! [`Sequencer::frame`]) and answers what to do next ([`Sequencer::act`]); the head's loop carries it out. What comes in one after
//! the other is called so: a *position* is a place in the sequence and has one pattern; a *shot* is one showing of it. A position
//! whose shot gave no frame is shown again, before the positions that come after it. Frames are handed over in the order of the
//! sequence.

use std::collections::VecDeque;

use super::Exposure;
use super::count::FrameCount;
use super::failure::{Blocked, Failure};
use super::identity::{Identity, Views};
use super::pacing::{Pacing, Shot};
use crate::projector::Flip;
use crate::trigger::Spoiled;
use crate::units::Timestamp;

/// Shows of one pattern before the sequence is given up.
const MAX_SHOTS: u32 = 12;
/// Frames that may wait for the flip that decides them.
const MAX_UNDECIDED: usize = 8;
/// Room for shots; more than are ever on their way, as each gives up in time.
const SHOTS: usize = 16;

/// What to do next.
#[derive(Debug)]
pub(super) enum Act<F> {
    /// Queue the pattern of this index.
    Queue(usize),
    /// Fire the trigger and say when it began.
    Fire,
    /// Hand over the frame of the pattern of this index.
    Hand(usize, F),
    /// Wait until then, or until a flip or a frame comes.
    Wait(Timestamp),
    /// All frames were handed over.
    Done,
    /// Give up.
    Fail(Failure),
}

/// A place of the sequence.
#[derive(Debug)]
struct Position<F> {
    index: usize,
    shots: u32,
    frame: Taken<F>,
}

#[derive(Debug)]
enum Taken<F> {
    Not,
    Waits(F),
    Handed,
}

/// A flip that was asked for and has not come.
#[derive(Clone, Copy, Debug)]
struct Queued {
    position: usize,
    /// The count it should come with, where there was one before.
    wanted: Option<u64>,
}

/// A frame that is not decided yet.
#[derive(Debug)]
struct Exposed<F> {
    start: Timestamp,
    count: u64,
    frame: F,
}

/// The state of one sequence. Used again for the next one, so that it allocates nothing in a steady state.
#[derive(Debug)]
pub(super) struct Sequencer<F> {
    pacing: Pacing,
    positions: Vec<Position<F>>,
    /// Positions to be shown, the next one first.
    todo: VecDeque<usize>,
    queued: Option<Queued>,
    /// The count that the next flip is planned to come with.
    planned: Option<u64>,
    /// Shots whose frames are awaited; the last one is the pattern in view, done or not.
    shots: VecDeque<Shot>,
    views: Views,
    undecided: VecDeque<Exposed<F>>,
    count: FrameCount,
    handed: usize,
    exhausted: Option<usize>,
    deadline: Timestamp,
    /// When the light of the first pattern that gave a frame came.
    started: Option<Timestamp>,
    so_far: Exposure,
}

impl<F> Sequencer<F> {
    pub fn new() -> Self {
        Self {
            pacing: Pacing::default(),
            positions: Vec::new(),
            todo: VecDeque::new(),
            queued: None,
            planned: None,
            shots: VecDeque::with_capacity(SHOTS),
            views: Views::new(),
            undecided: VecDeque::with_capacity(MAX_UNDECIDED),
            count: FrameCount::default(),
            handed: 0,
            exhausted: None,
            deadline: Timestamp(0),
            started: None,
            so_far: Exposure::default(),
        }
    }

    /// Begins a sequence of the patterns `indices`, to be done by `deadline`.
    pub fn begin(&mut self, pacing: Pacing, indices: &[usize], deadline: Timestamp) {
        self.pacing = pacing;
        self.positions.clear();
        self.positions.extend(indices.iter().map(|index| Position {
            index: *index,
            shots: 0,
            frame: Taken::Not,
        }));
        self.todo.clear();
        self.todo.extend(0..indices.len());
        (self.queued, self.planned, self.exhausted) = (None, None, None);
        self.shots.clear();
        let p = &self.pacing;
        self.views.restart(p.flip_to_light, p.tolerance, p.refresh);
        self.undecided.clear();
        self.count = FrameCount::default();
        self.handed = 0;
        self.deadline = deadline;
        self.started = None;
        self.so_far = Exposure::default();
    }

    /// What has been reached so far.
    pub fn so_far(&self) -> Exposure {
        Exposure {
            started: self.started.unwrap_or_default(),
            dropped: self.count.missing(),
            ..self.so_far
        }
    }

    /// The queued flip has come. One that nobody queued says nothing.
    pub fn flipped(&mut self, flip: Flip) {
        let Some(queued) = self.queued.take() else {
            return;
        };
        let off = self.views.flipped(queued.position, flip);
        let late = queued
            .wanted
            .map_or(0, |wanted| flip.sequence.saturating_sub(wanted));
        let so_far = &mut self.so_far;
        so_far.sync_error = so_far.sync_error.max(off);
        so_far.missed_flips = so_far
            .missed_flips
            .saturating_add(u32::try_from(late).unwrap_or(u32::MAX));
        // Only the last one may be done and stay: it says when the next flip may come.
        while self.shots.front().is_some_and(|shot| shot.done) {
            self.shots.pop_front();
        }
        self.positions[queued.position].shots += 1;
        self.shots.push_back(Shot {
            position: queued.position,
            flip,
            light: flip.timestamp + self.pacing.flip_to_light,
            fired: None,
            done: false,
        });
    }

    /// The trigger fired at this time.
    pub fn fired(&mut self, at: Timestamp) {
        if let Some(shot) = self.shots.iter_mut().find(|shot| shot.waits_for_trigger()) {
            shot.fired = Some(at);
        }
        self.pacing.fired(at);
    }

    /// This pulse of the trigger was spoiled: to be told before the next question what to do, so that its frame is not decided yet.
    pub fn spoiled(&mut self, pulse: Spoiled) {
        self.pacing.spoiled(pulse);
    }

    /// A frame came whose exposure started then, under this count of the camera.
    pub fn frame(&mut self, start: Timestamp, count: u64, frame: F) {
        if !self.count.see(count) {
            self.so_far.duplicated = self.so_far.duplicated.saturating_add(1);
            return;
        }
        self.pacing.exposed(start);
        if self.undecided.len() == MAX_UNDECIDED {
            self.undecided.pop_front();
            self.so_far.stale = self.so_far.stale.saturating_add(1);
        }
        self.undecided.push_back(Exposed {
            start,
            count,
            frame,
        });
    }

    /// What to do now. Flips and triggers come before frames, so that handing over delays none of them.
    pub fn act(&mut self, now: Timestamp) -> Act<F> {
        self.decide(now);
        self.give_up_overdue(now);
        let fire = self.trigger_due(now);
        let flip = self.flip_due(now);
        if let Some((due, planned)) = flip
            && due <= now
            && let Some(position) = self.todo.pop_front()
        {
            let wanted = self.planned.take().or(planned);
            self.queued = Some(Queued { position, wanted });
            self.views.queue(now);
            return Act::Queue(self.positions[position].index);
        }
        // A flip that comes later than it was planned before its time has been missed.
        self.planned = flip.and_then(|(_, planned)| planned);
        if fire.is_some_and(|due| due <= now) {
            return Act::Fire;
        }
        if let Some(position) = self.positions.get_mut(self.handed)
            && let Taken::Waits(_) = position.frame
            && let Taken::Waits(frame) = std::mem::replace(&mut position.frame, Taken::Handed)
        {
            self.handed += 1;
            return Act::Hand(position.index, frame);
        }
        if self.handed == self.positions.len() {
            return Act::Done;
        }
        if self.exhausted.is_some() || now >= self.deadline {
            return Act::Fail(self.failure());
        }
        let flip = flip.map(|(due, _)| due);
        let overdue = self
            .shots
            .iter()
            .filter_map(|shot| self.pacing.overdue(shot));
        let decided = self
            .undecided
            .iter()
            .map(|exposed| self.pacing.end(exposed.start));
        let next = [flip, fire].into_iter().flatten().chain(overdue);
        // A frame that ends in the future is decided then, if the next flip does not do it.
        let next = next.chain(decided.filter(|end| *end > now));
        Act::Wait(
            next.min()
                .map_or(self.deadline, |next| next.min(self.deadline)),
        )
    }

    /// Gives frames to their positions, as far as is known.
    fn decide(&mut self, now: Timestamp) {
        for _ in 0..self.undecided.len() {
            let Some(exposed) = self.undecided.pop_front() else {
                return;
            };
            let start = exposed.start;
            let end = self.pacing.end(start);
            if let Some(pulse) = self.pacing.spoiled_by(start) {
                self.so_far.spoiled = self.so_far.spoiled.saturating_add(1);
                self.so_far.pulse_error = self.so_far.pulse_error.max(pulse.off());
                self.retake_the_shot_spoiled_by(&pulse);
                continue;
            }
            if !self
                .pacing
                .explains(start, self.count.before(exposed.count))
            {
                self.so_far.unexplained = self.so_far.unexplained.saturating_add(1);
                continue;
            }
            match self.views.identify(start, end, now) {
                Identity::Of(position, light) => self.take(position, light, exposed),
                Identity::Undecided => self.undecided.push_back(exposed),
                Identity::Stale => self.so_far.stale = self.so_far.stale.saturating_add(1),
                Identity::Straddles => {
                    self.so_far.straddled = self.so_far.straddled.saturating_add(1);
                    self.retake_the_shot_of(start);
                }
            }
        }
    }

    /// The frame is this position's.
    fn take(&mut self, position: usize, light: Timestamp, exposed: Exposed<F>) {
        for shot in self
            .shots
            .iter_mut()
            .filter(|shot| shot.position == position)
        {
            if let Some(expected) = shot.fired {
                let off = exposed
                    .start
                    .since(expected)
                    .max(expected.since(exposed.start));
                self.so_far.sync_error = self.so_far.sync_error.max(off);
            }
            shot.done = true;
        }
        let slot = &mut self.positions[position].frame;
        if !matches!(slot, Taken::Not) {
            self.so_far.surplus = self.so_far.surplus.saturating_add(1);
            return;
        }
        *slot = Taken::Waits(exposed.frame);
        self.todo.retain(|waiting| *waiting != position);
        // Within the tolerance an exposure may begin before its light.
        let began = light.min(exposed.start);
        self.started = Some(self.started.map_or(began, |first| first.min(began)));
        let so_far = &mut self.so_far;
        so_far.done = so_far.done.max(exposed.start);
        so_far.lag = so_far.lag.max(exposed.start.since(light));
    }

    /// A frame exposed from `start` was nobody's: the shot that it was meant for is taken again at once.
    fn retake_the_shot_of(&mut self, start: Timestamp) {
        let near = self.pacing.exposure / 2;
        let meant = self.shots.iter().position(|shot| {
            let expected = if shot.done {
                None
            } else {
                self.pacing.expected(shot)
            };
            expected.is_some_and(|at| at.since(start).max(start.since(at)) < near)
        });
        if let Some(at) = meant {
            self.retake(at);
        }
    }

    /// The frame of a spoiled pulse came: its shot is taken again at once, if nobody does that already.
    fn retake_the_shot_spoiled_by(&mut self, pulse: &Spoiled) {
        let spoiled = |at| self.pacing.spoils(pulse, at);
        let meant = |shot: &Shot| !shot.done && shot.fired.is_some_and(spoiled);
        if let Some(at) = self.shots.iter().position(meant) {
            self.retake(at);
        }
    }

    fn give_up_overdue(&mut self, now: Timestamp) {
        let overdue = |shot: &Shot| self.pacing.overdue(shot).is_some_and(|at| at <= now);
        if let Some(at) = self.shots.iter().position(overdue) {
            self.retake(at);
        }
    }

    /// Shows the position of a shot once more.
    fn retake(&mut self, at: usize) {
        let shot = &mut self.shots[at];
        shot.done = true;
        let place = shot.position;
        let again = self.queued.is_some_and(|queued| queued.position == place)
            || self.todo.contains(&place)
            || self
                .shots
                .iter()
                .any(|shot| shot.position == place && !shot.done);
        let position = &self.positions[place];
        if again || !matches!(position.frame, Taken::Not) {
            return;
        }
        if position.shots >= MAX_SHOTS {
            self.exhausted = Some(place);
            return;
        }
        self.so_far.retaken = self.so_far.retaken.saturating_add(1);
        self.todo.push_front(place);
    }

    /// When the next flip is to be queued, and the count it should come with.
    fn flip_due(&self, now: Timestamp) -> Option<(Timestamp, Option<u64>)> {
        if self.queued.is_some() || self.todo.is_empty() {
            return None;
        }
        let Some(last) = self.shots.back() else {
            return Some((now, None));
        };
        let (due, count) = self.pacing.next_flip(self.shots.iter(), last, now)?;
        Some((due, Some(count)))
    }

    /// When the next trigger is due. A shot whose exposure would not end in its view is taken again instead.
    fn trigger_due(&mut self, now: Timestamp) -> Option<Timestamp> {
        loop {
            let at = self.shots.iter().position(Shot::waits_for_trigger)?;
            let due = self.pacing.trigger(&self.shots[at])?;
            let until = match self.shots.get(at + 1) {
                Some(next) => Some(next.light),
                None => self.queued.map(|_| {
                    self.pacing.next_refresh(&self.shots[at], now) + self.pacing.flip_to_light
                }),
            };
            let end = self.pacing.end(due.max(now));
            if until.is_none_or(|until| end <= until + self.pacing.tolerance) {
                return Some(due);
            }
            self.retake(at);
        }
    }

    fn failure(&self) -> Failure {
        let open = self
            .positions
            .iter()
            .position(|p| matches!(p.frame, Taken::Not));
        let blocked = match (self.exhausted, self.queued, self.count.any()) {
            (_, Some(_), _) if self.shots.is_empty() => Blocked::NoFlip,
            (_, _, false) => Blocked::NoFrame,
            // Or frames come, and not one fits: more time would not help.
            (Some(_), ..) => Blocked::misfit(&self.so_far),
            _ if self.started.is_none() && self.so_far.unfit() > 0 => Blocked::misfit(&self.so_far),
            _ => Blocked::Late,
        };
        let position = self.exhausted.or(open).unwrap_or(0);
        Failure {
            blocked,
            index: self.positions.get(position).map_or(0, |p| p.index),
            shots: self.positions.get(position).map_or(0, |p| p.shots),
            taken: self
                .positions
                .iter()
                .filter(|p| !matches!(p.frame, Taken::Not))
                .count(),
            of: self.positions.len(),
            so_far: self.so_far(),
        }
    }
}
