//! The clock of a head: the time that all its devices share, and waiting for them.

use std::os::fd::OwnedFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::time::{ClockId, clock_gettime};

use crate::units::Timestamp;

/// The clock by which flips, triggers and frames are stamped.
pub trait Clock: Send {
    /// Now.
    fn now(&self) -> Timestamp;

    /// Waits until `until`, or until a flip or a frame arrives; it may also return early without a
    /// reason.
    fn wait(&mut self, until: Timestamp);

    /// Whether time passes only in [`Clock::wait`], as in a simulation. Work between two waits then
    /// takes no time on this clock.
    fn stands_still(&self) -> bool {
        false
    }
}

/// The clock of real devices: `CLOCK_MONOTONIC`, waiting for any of their descriptors.
///
/// A descriptor must be readable as long as its device has a flip, a frame or an error that was not
/// fetched. It may be a duplicate (`BorrowedFd::try_clone_to_owned`); the device keeps its own.
#[derive(Debug, Default)]
pub struct Monotonic {
    devices: Vec<OwnedFd>,
}

impl Monotonic {
    /// A clock whose waits end when one of these has something to fetch.
    #[must_use]
    pub fn new(devices: Vec<OwnedFd>) -> Self {
        Self { devices }
    }
}

impl Clock for Monotonic {
    fn now(&self) -> Timestamp {
        monotonic()
    }

    fn wait(&mut self, until: Timestamp) {
        let left = until.since(monotonic());
        if left.is_zero() {
            return;
        }
        let mut waiting: Vec<PollFd<'_>> = self
            .devices
            .iter()
            .map(|device| PollFd::new(device, PollFlags::IN))
            .collect();
        // A signal ends the wait early, which the trait allows; nothing else can fail with
        // descriptors that we own.
        let _ = poll(&mut waiting, Timespec::try_from(left).ok().as_ref());
        let hung_up: Vec<bool> = waiting
            .iter()
            .map(|device| {
                let came = device.revents();
                !came.is_empty() && !came.contains(PollFlags::IN)
            })
            .collect();
        // A device that is gone ends one wait, so that its error is noticed. It is removed here, or
        // every later wait would return at once.
        let mut hung_up = hung_up.into_iter();
        self.devices.retain(|_| hung_up.next() != Some(true));
    }
}

/// Now, on `CLOCK_MONOTONIC`.
#[must_use]
pub fn monotonic() -> Timestamp {
    read(ClockId::Monotonic)
}

/// Now, on a clock that starts at 0 when the system boots and never goes back, so the conversion
/// does not fail.
pub(crate) fn read(clock: ClockId) -> Timestamp {
    Timestamp(0) + Duration::try_from(clock_gettime(clock)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::check_clock;
    use rustix::io::write;
    use rustix::pipe::pipe;
    use std::time::Instant;

    /// Longer than any wait in these tests lasts.
    const LONG: Duration = Duration::from_secs(60);
    /// Far less than `LONG`, but enough on a busy computer.
    const SOON: Duration = Duration::from_secs(10);

    #[test]
    fn the_real_clock_keeps_the_promises_of_a_clock() {
        check_clock(&mut Monotonic::default()).unwrap();
    }

    #[test]
    fn a_wait_does_not_end_before_its_time_for_nothing() {
        let (idle, _writer) = pipe().unwrap();
        let mut clock = Monotonic::new(vec![idle]);
        let until = clock.now() + Duration::from_millis(20);
        clock.wait(until);
        assert!(clock.now() >= until, "{} before {until}", clock.now());
    }

    #[test]
    fn a_wait_ends_when_a_device_has_something_to_fetch() {
        let (idle, _writer) = pipe().unwrap();
        let (device, news) = pipe().unwrap();
        let mut clock = Monotonic::new(vec![idle, device]);
        write(&news, b"!").unwrap();
        let begun = Instant::now();
        clock.wait(clock.now() + LONG);
        assert!(begun.elapsed() < SOON, "{:?}", begun.elapsed());
    }

    #[test]
    fn a_device_that_is_gone_ends_one_wait_and_no_other() {
        let (device, news) = pipe().unwrap();
        let mut clock = Monotonic::new(vec![device]);
        drop(news);
        let begun = Instant::now();
        clock.wait(clock.now() + LONG);
        assert!(begun.elapsed() < SOON, "{:?}", begun.elapsed());
        let until = clock.now() + Duration::from_millis(20);
        clock.wait(until);
        assert!(clock.now() >= until, "the second wait spun");
    }
}
