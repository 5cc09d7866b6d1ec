//! Waiting for what another thread or program does.

use std::fmt::Debug;
use std::time::{Duration, Instant};

/// Longest wait for any event, such as the end of a teach on a busy machine: it costs nothing where
/// the event comes.
pub const PATIENCE: Duration = Duration::from_secs(120);
/// Time between two questions: asked without a pause, they would take the processor from what is
/// waited for.
const PAUSE: Duration = Duration::from_millis(2);

/// Asks until the answer is `Ok`.
///
/// # Panics
/// If it is not after so much `patience`, with `what` did not come and what was said instead.
pub fn until<T, E: Debug>(
    what: &str,
    patience: Duration,
    mut question: impl FnMut() -> Result<T, E>,
) -> T {
    let began = Instant::now();
    loop {
        match question() {
            Ok(answer) => return answer,
            Err(instead) => assert!(
                began.elapsed() < patience,
                "no {what} within {patience:?}: {instead:?}"
            ),
        }
        std::thread::sleep(PAUSE);
    }
}
