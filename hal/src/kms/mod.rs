//! A projector on a display connector of this computer, through the kernel's mode setting (KMS).
//!
//! [`open`] finds card, connector and mode, removes the console and everything else from the
//! connector, and shows black. Patterns are drawn into the card's memory when they are loaded; a
//! flip copies nothing. Each flip is one atomic commit that does not wait; its event has the
//! kernel's count and time of the refresh with which the pattern is shown.
//!
//! Dropping a [`Display`] switches the connector off and returns the card to the console.

mod card;
mod find;
mod pipeline;

use std::io;
use std::os::fd::OwnedFd;
use std::time::Duration;

use drm::Device as _;
use drm::control::{Device as _, Event, PageFlipEvent};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::clock::monotonic;
use crate::error::Error;
use crate::projector::{Flip, Projector, Raster, all_kept, all_of_size};
use crate::setup::ProjectorSetup;
use crate::units::Timestamp;
use card::{Canvas, refused};
use pipeline::Pipeline;

/// How many refreshes to wait for a flip before it is an error.
const PATIENCE: u32 = 10;

/// A display that shows patterns, each for whole refreshes.
#[derive(Debug)]
pub struct Display {
    pipeline: Pipeline,
    black: Canvas,
    /// Canvases in the order of the patterns; there may be more canvases than patterns, from a
    /// longer sequence before.
    canvases: Vec<Canvas>,
    loaded: usize,
    shown: Picture,
    /// The commit whose event has not arrived.
    waiting: Option<Commit>,
    /// The pattern to be committed once black is shown.
    next: Option<usize>,
    /// A flip that has happened and was not fetched.
    came: Option<Flip>,
    /// The kernel's count of refreshes, continued beyond its 32 bits.
    count: Option<u64>,
    missed: u64,
}

/// What a display shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Picture {
    Black,
    Pattern(usize),
}

/// A change of the picture that was asked for.
#[derive(Clone, Copy, Debug)]
struct Commit {
    picture: Picture,
    asked: Timestamp,
}

/// Opens the display of a setup in its mode and shows black.
///
/// # Errors
/// `Unsupported` if card, connector or mode does not exist, or another program uses the card;
/// `Disconnected` if nothing is plugged in. The message lists what exists.
pub fn open(setup: &ProjectorSetup) -> Result<Display, Error> {
    let pipeline = Pipeline::find(setup)?;
    let size = (pipeline.timings.width, pipeline.timings.height);
    let mut black = Canvas::new(&pipeline.card, size)?;
    black.draw(&pipeline.card, &Raster::uniform(size.0, size.1, 0)?)?;
    pipeline.switch_on(&black)?;
    Ok(Display {
        pipeline,
        black,
        canvases: Vec::new(),
        loaded: 0,
        shown: Picture::Black,
        waiting: None,
        next: None,
        came: None,
        count: None,
        missed: 0,
    })
}

impl Display {
    /// A duplicate of its descriptor, which is readable when a flip has happened.
    ///
    /// # Errors
    /// The kernel's error.
    pub fn descriptor(&self) -> Result<OwnedFd, Error> {
        self.pipeline.card.descriptor()
    }

    /// Refreshes that the driver missed: whole refreshes that passed between the commit of a flip
    /// and the flip. A commit in the last quarter of a refresh may be too late for the next one and
    /// is not counted. Refreshes for which no flip was queued in time show in the count of the
    /// flips instead.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    fn commit(&mut self, picture: Picture) -> Result<(), Error> {
        let canvas = match picture {
            Picture::Black => &self.black,
            Picture::Pattern(index) => &self.canvases[index],
        };
        let asked = monotonic();
        self.pipeline
            .flip(canvas)
            .map_err(|error| refused("asking for a flip", &error))?;
        self.waiting = Some(Commit { picture, asked });
        Ok(())
    }

    fn waits_for_black(&self) -> bool {
        self.waiting
            .is_some_and(|commit| commit.picture == Picture::Black)
    }

    /// Reads the events that have arrived.
    fn take_events(&mut self) -> Result<(), Error> {
        loop {
            let events = match self.pipeline.card.receive_events() {
                Ok(events) => events,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(refused("reading flips", &error)),
            };
            for event in events {
                if let Event::PageFlip(event) = event
                    && event.crtc == self.pipeline.crtc
                {
                    self.flipped(&event)?;
                }
            }
        }
    }

    fn flipped(&mut self, event: &PageFlipEvent) -> Result<(), Error> {
        let count = continued(self.count, event.frame);
        self.count = Some(count);
        let Some(commit) = self.waiting.take() else {
            return Ok(());
        };
        self.shown = commit.picture;
        if let Picture::Pattern(_) = commit.picture {
            // The crate calls it a duration; it is the time on CLOCK_MONOTONIC.
            let timestamp = Timestamp(0) + event.duration;
            let beyond = timestamp
                .since(commit.asked)
                .saturating_sub(self.refresh() / 4);
            let missed = beyond.as_nanos() / self.refresh().as_nanos();
            self.missed += u64::try_from(missed).unwrap_or(u64::MAX);
            self.came = Some(Flip { timestamp, count });
        }
        match self.next.take() {
            Some(index) => self.commit(Picture::Pattern(index)),
            None => Ok(()),
        }
    }

    /// Waits for the pending commit: up to one refresh, normally.
    fn settle(&mut self) -> Result<(), Error> {
        let patience = self.refresh() * PATIENCE;
        let end = monotonic() + patience;
        loop {
            self.take_events()?;
            if self.waiting.is_none() {
                return Ok(());
            }
            self.pipeline.present("waiting for a flip")?;
            let left = end.since(monotonic()).min(self.refresh());
            if left.is_zero() {
                return Err(Error::timeout(
                    "waiting for a flip",
                    patience,
                    "check the display's mode; if that does not help, restart the computer",
                ));
            }
            let mut news = [PollFd::new(&self.pipeline.card, PollFlags::IN)];
            // A signal ends the wait early; nothing else can fail with a descriptor that we own.
            let _ = poll(&mut news, Timespec::try_from(left).ok().as_ref());
        }
    }
}

impl Projector for Display {
    fn size(&self) -> (u32, u32) {
        (self.pipeline.timings.width, self.pipeline.timings.height)
    }

    fn refresh(&self) -> Duration {
        self.pipeline.timings.period
    }

    fn present(&self) -> Result<(), Error> {
        self.pipeline.present("looking for the projector")?;
        self.pipeline.same_display()
    }

    fn starts_dark(&self) -> bool {
        true
    }

    /// Waits until black is shown, at most a few refreshes, so that no visible picture is drawn
    /// over.
    fn load_behind(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        let size = self.size();
        all_of_size(&rasters, size)?;
        all_kept(kept, self.loaded)?;
        self.blank()?;
        self.settle()?;
        self.loaded = kept;
        let card = &self.pipeline.card;
        let wanted = kept + rasters.len();
        for spare in self.canvases.drain(wanted.min(self.canvases.len())..) {
            spare.free(card);
        }
        for (index, raster) in (kept..).zip(&rasters) {
            if index == self.canvases.len() {
                self.canvases.push(Canvas::new(card, size)?);
            }
            self.canvases[index].draw(card, raster)?;
        }
        self.loaded = wanted;
        Ok(())
    }

    fn queue(&mut self, index: usize) -> Result<(), Error> {
        self.pipeline.present("showing a pattern")?;
        if index >= self.loaded {
            return Err(Error::protocol(
                format!(
                    "showing pattern {index} of {} loaded (counted from 0)",
                    self.loaded
                ),
                "load the patterns first",
            ));
        }
        self.take_events()?;
        let black = self.waits_for_black();
        if self.came.is_some() || self.next.is_some() || self.waiting.is_some() && !black {
            return Err(Error::protocol(
                format!("showing pattern {index} while another one waits for its refresh"),
                "fetch its flip first",
            ));
        }
        if black {
            self.next = Some(index);
            return Ok(());
        }
        self.commit(Picture::Pattern(index))
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        self.take_events()?;
        let flip = self.came.take();
        if flip.is_none() && self.waiting.is_some() {
            // A display that is gone sends no events.
            self.pipeline.present("waiting for a flip")?;
        }
        Ok(flip)
    }

    /// Waits for a pattern that is queued, at most a few refreshes: a commit cannot be cancelled.
    fn blank(&mut self) -> Result<(), Error> {
        self.next = None;
        if !self.waits_for_black() {
            self.settle()?;
            if self.shown != Picture::Black {
                self.commit(Picture::Black)?;
            }
        }
        self.came = None;
        Ok(())
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.pipeline.switch_off();
        let card = &self.pipeline.card;
        for canvas in self.canvases.drain(..) {
            canvas.free(card);
        }
        self.black.free(card);
        // Duplicates of the descriptor that are still open would otherwise keep this program the
        // card's master.
        let _ = card.release_master_lock();
    }
}

/// The kernel's count of refreshes, continued where its 32 bits wrap around.
fn continued(last: Option<u64>, counted: u32) -> u64 {
    last.map_or(u64::from(counted), |last| {
        // Truncation is intended: the low 32 bits are the kernel's count.
        last + u64::from(counted.wrapping_sub(last as u32))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_of_refreshes_goes_on_where_the_kernels_starts_again() {
        assert_eq!(continued(None, 7), 7);
        assert_eq!(continued(Some(7), 9), 9);
        let last = continued(Some(u64::from(u32::MAX) - 1), u32::MAX);
        assert_eq!(continued(Some(last), 1), (1 << 32) + 1);
    }
}
