//! The sequencer decides which pattern to show when, when to trigger, and which pattern each frame
//! shows.
//!
//! It receives events and the time as arguments ([`Sequencer::flipped`], [`Sequencer::fired`],
//! [`Sequencer::spoiled`], [`Sequencer::frame`]) and returns what to do next ([`Sequencer::act`]);
//! the head's loop carries that out. A *position* is a place in the sequence and has one pattern;
//! an *attempt* is one showing of that pattern, with one trigger. A position whose attempt gave no
//! frame is shown again, before the positions that follow it. Frames are handed over in the order
//! of the sequence.

use std::collections::VecDeque;

use super::identity::{FrameCount, Identity, Views};
use super::outcome::{Blocked, Exposure, Failure};
use super::pacing::{Attempt, Pacing};
use crate::frame::Frame;
use crate::projector::Flip;
use crate::trigger::{Spoiled, keep_latest};
use crate::units::Timestamp;

/// Attempts at one position before the sequence is given up.
const MAX_ATTEMPTS: u32 = 12;
/// Frames that may wait for the flip that decides them.
const MAX_UNDECIDED: usize = 8;

/// What to do next.
#[derive(Debug)]
pub(super) enum Act {
    /// Queue the pattern of this index.
    Queue(usize),
    /// Fire the trigger and report when the pulse began.
    Fire,
    /// Hand over the frame of the pattern of this index.
    Hand(usize, Frame),
    /// Wait until this time, or until a flip or a frame arrives.
    Wait(Timestamp),
    /// All frames were handed over.
    Done,
    /// Give up.
    Fail(Failure),
}

/// A place of the sequence.
#[derive(Debug)]
struct Position {
    index: usize,
    attempts: u32,
    frame: Taken,
}

#[derive(Debug)]
enum Taken {
    Not,
    Waits(Frame),
    Handed,
}

/// A flip that was queued and not yet reported.
#[derive(Clone, Copy, Debug)]
struct Queued {
    position: usize,
    /// The planned count of its refresh; none for the first flip.
    wanted: Option<u64>,
}

/// The state of one sequence. It is reused for the next one, so that repeated sequences allocate
/// nothing.
#[derive(Debug, Default)]
pub(super) struct Sequencer {
    pacing: Pacing,
    positions: Vec<Position>,
    /// Positions to be shown, the next one first.
    todo: VecDeque<usize>,
    queued: Option<Queued>,
    /// The planned count of the next flip.
    planned: Option<u64>,
    /// Attempts whose frames are expected; the last one is the pattern in view, done or not.
    attempts: VecDeque<Attempt>,
    views: Views,
    /// Frames that are not decided yet.
    undecided: heapless::Deque<Frame, MAX_UNDECIDED>,
    count: FrameCount,
    /// Attempts that were given up since the last frame arrived.
    unanswered: u32,
    handed: usize,
    /// Frames that arrived, without repetitions.
    arrived: usize,
    exhausted: Option<usize>,
    deadline: Timestamp,
    /// When the light of the first pattern that gave a frame came.
    started: Option<Timestamp>,
    so_far: Exposure,
}

impl Sequencer {
    /// Begins a sequence of the patterns `indices`, to be done by `deadline`.
    pub fn begin(&mut self, pacing: Pacing, indices: &[usize], deadline: Timestamp) {
        let Self {
            mut positions,
            mut todo,
            mut attempts,
            ..
        } = std::mem::take(self);
        positions.clear();
        positions.extend(indices.iter().map(|index| Position {
            index: *index,
            attempts: 0,
            frame: Taken::Not,
        }));
        todo.clear();
        todo.extend(0..indices.len());
        attempts.clear();
        *self = Self {
            views: Views::new(&pacing),
            pacing,
            positions,
            todo,
            attempts,
            deadline,
            ..Self::default()
        };
    }

    /// The counts and times of the sequence so far.
    pub fn so_far(&self) -> Exposure {
        Exposure {
            started: self.started.unwrap_or_default(),
            dropped: self.count.missing(),
            ..self.so_far
        }
    }

    /// Whether each trigger of this sequence gave a frame that was handed over, so that no other
    /// can arrive later.
    pub fn all_answered(&self) -> bool {
        self.handed == self.positions.len() && self.pacing.triggers() == self.handed
    }

    /// Whether each trigger of this sequence gave a frame, whatever it shows.
    pub fn none_is_awaited(&self) -> bool {
        self.arrived >= self.pacing.triggers()
    }

    /// The queued flip has happened. A flip that was not queued is ignored.
    pub fn flipped(&mut self, flip: Flip) {
        let Some(queued) = self.queued.take() else {
            return;
        };
        let off = self.views.flipped(queued.position, flip);
        let late = queued
            .wanted
            .map_or(0, |wanted| flip.count.saturating_sub(wanted));
        let so_far = &mut self.so_far;
        so_far.sync_error = so_far.sync_error.max(off);
        so_far.missed_flips = so_far
            .missed_flips
            .saturating_add(u32::try_from(late).unwrap_or(u32::MAX));
        // Of the attempts that are done only the last may stay: the next flip is planned from it.
        while self.attempts.front().is_some_and(|attempt| attempt.done) {
            self.attempts.pop_front();
        }
        self.positions[queued.position].attempts += 1;
        self.attempts.push_back(Attempt {
            position: queued.position,
            flip,
            light: flip.timestamp + self.pacing.flip_to_light,
            fired: None,
            done: false,
        });
    }

    /// The trigger has fired at this time.
    pub fn fired(&mut self, at: Timestamp) {
        if let Some(attempt) = self
            .attempts
            .iter_mut()
            .find(|attempt| attempt.waits_for_trigger())
        {
            attempt.fired = Some(at);
        }
        self.pacing.fired(at);
    }

    /// This pulse of the trigger was spoiled. Must be called before the next [`Sequencer::act`],
    /// which may decide its frame.
    pub fn spoiled(&mut self, pulse: Spoiled) {
        self.pacing.spoiled(pulse);
    }

    /// A frame has arrived, stamped with the start of its exposure.
    pub fn frame(&mut self, frame: Frame) {
        self.unanswered = 0;
        if !self.count.see(frame.count()) {
            self.so_far.duplicated = self.so_far.duplicated.saturating_add(1);
            return;
        }
        self.arrived += 1;
        self.pacing.exposed(frame.timestamp());
        if keep_latest(&mut self.undecided, frame).is_some() {
            self.so_far.stale = self.so_far.stale.saturating_add(1);
        }
    }

    /// What to do now. Flips and triggers come before frames, so that handing over delays none of
    /// them.
    pub fn act(&mut self, now: Timestamp) -> Act {
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
        // A flip counts as late if it happens after the refresh that was planned before its time.
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
            .attempts
            .iter()
            .filter_map(|attempt| self.pacing.overdue(attempt));
        let decided = self
            .undecided
            .iter()
            .map(|frame| self.pacing.end(frame.timestamp()));
        let next = [flip, fire].into_iter().flatten().chain(overdue);
        // A frame whose exposure ends in the future is decided at that time, unless the next flip
        // decides it earlier.
        let next = next.chain(decided.filter(|end| *end > now));
        Act::Wait(
            next.min()
                .map_or(self.deadline, |next| next.min(self.deadline)),
        )
    }

    /// Assigns frames to their positions, as far as they can be decided.
    fn decide(&mut self, now: Timestamp) {
        for _ in 0..self.undecided.len() {
            let Some(frame) = self.undecided.pop_front() else {
                return;
            };
            let start = frame.timestamp();
            let end = self.pacing.end(start);
            if let Some(pulse) = self.pacing.spoiled_by(start) {
                self.so_far.spoiled = self.so_far.spoiled.saturating_add(1);
                self.so_far.pulse_error = self.so_far.pulse_error.max(pulse.off());
                self.retake_the_attempt_spoiled_by(&pulse);
                continue;
            }
            if !self
                .pacing
                .explains(start, self.count.before(frame.count()))
            {
                self.so_far.unexplained = self.so_far.unexplained.saturating_add(1);
                continue;
            }
            match self.views.identify(start, end, now) {
                Identity::Of(position, light) => self.take(position, light, frame),
                Identity::Undecided => {
                    keep_latest(&mut self.undecided, frame);
                }
                Identity::Stale => self.so_far.stale = self.so_far.stale.saturating_add(1),
                Identity::Straddles => {
                    self.so_far.straddled = self.so_far.straddled.saturating_add(1);
                    self.retake_the_attempt_of(start);
                }
            }
        }
    }

    /// Assigns a frame to this position.
    fn take(&mut self, position: usize, light: Timestamp, frame: Frame) {
        let start = frame.timestamp();
        for attempt in self
            .attempts
            .iter_mut()
            .filter(|attempt| attempt.position == position)
        {
            if let Some(expected) = attempt.fired {
                let off = start.off(expected);
                self.so_far.sync_error = self.so_far.sync_error.max(off);
            }
            attempt.done = true;
        }
        let slot = &mut self.positions[position].frame;
        if !matches!(slot, Taken::Not) {
            self.so_far.surplus = self.so_far.surplus.saturating_add(1);
            return;
        }
        *slot = Taken::Waits(frame);
        self.todo.retain(|waiting| *waiting != position);
        // Within the tolerance an exposure may begin before its pattern's light.
        let began = light.min(start);
        self.started = Some(self.started.map_or(began, |first| first.min(began)));
        let so_far = &mut self.so_far;
        so_far.done = so_far.done.max(start);
        so_far.lag = so_far.lag.max(start.since(light));
    }

    /// A frame exposed from `start` showed no pattern alone: the position of its attempt is shown
    /// again at once.
    fn retake_the_attempt_of(&mut self, start: Timestamp) {
        let near = self.pacing.exposure / 2;
        let meant = self.attempts.iter().position(|attempt| {
            let expected = if attempt.done {
                None
            } else {
                self.pacing.expected(attempt)
            };
            expected.is_some_and(|at| at.off(start) < near)
        });
        if let Some(at) = meant {
            self.retake(at);
        }
    }

    /// The frame of a spoiled pulse has arrived: the position of its attempt is shown again at
    /// once, unless that is planned already.
    fn retake_the_attempt_spoiled_by(&mut self, pulse: &Spoiled) {
        let spoiled = |at| self.pacing.spoils(pulse, at);
        let meant = |attempt: &Attempt| !attempt.done && attempt.fired.is_some_and(spoiled);
        if let Some(at) = self.attempts.iter().position(meant) {
            self.retake(at);
        }
    }

    fn give_up_overdue(&mut self, now: Timestamp) {
        let overdue = |attempt: &Attempt| self.pacing.overdue(attempt).is_some_and(|at| at <= now);
        if let Some(at) = self.attempts.iter().position(overdue) {
            self.retake(at);
        }
    }

    /// Shows the position of an attempt once more, unless it is planned or done already.
    fn retake(&mut self, at: usize) {
        self.unanswered += 1;
        let attempt = &mut self.attempts[at];
        attempt.done = true;
        let place = attempt.position;
        let again = self.queued.is_some_and(|queued| queued.position == place)
            || self.todo.contains(&place)
            || self
                .attempts
                .iter()
                .any(|attempt| attempt.position == place && !attempt.done);
        let position = &self.positions[place];
        if again || !matches!(position.frame, Taken::Not) {
            return;
        }
        if position.attempts >= MAX_ATTEMPTS {
            self.exhausted = Some(place);
            return;
        }
        self.so_far.retaken = self.so_far.retaken.saturating_add(1);
        self.todo.push_front(place);
    }

    /// When the next flip is to be queued, and the planned count of its refresh.
    fn flip_due(&self, now: Timestamp) -> Option<(Timestamp, Option<u64>)> {
        if self.queued.is_some() || self.todo.is_empty() {
            return None;
        }
        let Some(last) = self.attempts.back() else {
            return Some((now, None));
        };
        let (due, count) = self.pacing.next_flip(self.attempts.iter(), last, now)?;
        Some((due, Some(count)))
    }

    /// When the next trigger is due. If the exposure would not end while the pattern is in view,
    /// its position is shown again instead.
    fn trigger_due(&mut self, now: Timestamp) -> Option<Timestamp> {
        loop {
            let at = self.attempts.iter().position(Attempt::waits_for_trigger)?;
            let due = self.pacing.trigger(&self.attempts[at])?;
            let until = match self.attempts.get(at + 1) {
                Some(next) => Some(next.light),
                None => self.queued.map(|_| {
                    self.pacing.next_refresh(&self.attempts[at], now) + self.pacing.flip_to_light
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
            (_, Some(_), _) if self.attempts.is_empty() => Blocked::NoFlip,
            (_, _, false) => Blocked::NoFrame,
            _ if self.unanswered > MAX_ATTEMPTS / 2 => Blocked::NoFrame,
            // Also when frames arrive and none fits: more time would not help.
            (Some(_), ..) => Blocked::misfit(&self.so_far),
            _ if self.started.is_none() && self.so_far.unfit() > 0 => Blocked::misfit(&self.so_far),
            _ => Blocked::Late,
        };
        let position = self.exhausted.or(open).unwrap_or(0);
        Failure {
            blocked,
            index: self.positions.get(position).map_or(0, |p| p.index),
            attempts: self.positions.get(position).map_or(0, |p| p.attempts),
            taken: self
                .positions
                .iter()
                .filter(|p| !matches!(p.frame, Taken::Not))
                .count(),
            patterns: self.positions.len(),
            so_far: self.so_far(),
        }
    }
}
