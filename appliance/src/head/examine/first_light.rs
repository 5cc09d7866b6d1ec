//! Waits for the projector's first light: after its mode was set, a projector needs seconds to lock
//! on to the signal, and what is measured before is the dark.

use super::pictures::{LEAST_LIT, Lit, SETTLE};
use hal::error::Error;
use hal::head::Head;
use std::time::Duration;

/// Longest wait for the first light. Projectors lock within a few seconds; without a part in front
/// of the head, no light comes back at all.
pub const LONGEST_DARK: Duration = Duration::from_secs(15);

/// Shows black and white until they differ, and returns how long that took; `None` if they are
/// still the same after [`LONGEST_DARK`].
///
/// # Errors
/// The error of a device, or if no frame comes.
pub fn first_light(head: &mut Head) -> Result<Option<Duration>, Error> {
    let begun = head.now();
    loop {
        let share = Lit::take(head, SETTLE)?.share();
        let waited = head.now().since(begun);
        if share >= LEAST_LIT {
            return Ok(Some(waited));
        }
        if waited >= LONGEST_DARK {
            return Ok(None);
        }
    }
}
