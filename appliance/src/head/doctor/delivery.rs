//! The doctor's check of how long frames need from the camera to this program: reading them from
//! slow memory shows here.

use super::time::ms;
use super::{Check, Checked, Subject};
use crate::head::examine::{PATIENCE, load_black_and_white};
use hal::head::Showing;
use serde_json::json;
use std::time::Duration;

/// Refreshes over which frames are timed.
const REFRESHES: u32 = 24;
/// How much later than stated a frame may come: a few turns of the scheduler.
const LATE: Duration = Duration::from_millis(5);

/// The median time from the end of an exposure until its frame can be used.
pub(super) fn delivery(subject: &mut Subject<'_>) -> Checked {
    let head = &mut *subject.head;
    load_black_and_white(head)?;
    let camera = head.camera_timing();
    let showing = Showing {
        index: 0,
        refreshes: REFRESHES,
        settle: 0,
    };
    let seen = head.watch(&[showing], PATIENCE, &mut |_| ())?;
    let needed =
        |frame: &hal::head::WatchedFrame<()>| frame.arrived.since(frame.start + camera.exposure);
    let mut times: Vec<Duration> = seen.frames.iter().map(needed).collect();
    times.sort_unstable();
    let median = times.get(times.len() / 2).copied().unwrap_or_default();
    let stated = camera.delivery;
    let found = format!(
        "a frame can be used {:.1} ms after its exposure, {:.1} ms are stated",
        ms(median),
        ms(stated)
    );
    let measured = json!({ "delivered_ms": ms(median), "stated_ms": ms(stated) });
    let remedy = format!(
        "frames are read slowly: see that /dev/dma_heap/vidbuf_cached exists and this user may open it (group \"video\"), and that nothing else loads the computer; \
         if it cannot be faster, set head.camera.delivery_us to {:.0}",
        ms(median).ceil() * 1e3
    );
    Ok(Check::new(
        found,
        (median > stated + LATE).then_some(&*remedy),
        measured,
    ))
}
