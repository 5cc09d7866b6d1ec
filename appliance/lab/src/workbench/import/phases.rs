//! The phases of an imported pattern that its models and its direction are compared with.

use algo::pipeline::PhaseMap;
use appliance::head::channel::Channel;
use appliance::head::code::CodeAlone;
use appliance::measure::least_modulation;
use hal::replay::Recording;

/// The absolute phase of a pattern by its own levels or code.
///
/// # Errors
/// In words: it has none, and what to add.
pub(super) fn absolute(recording: &Recording, pattern: usize) -> Result<PhaseMap, String> {
    let least = least_modulation(recording);
    if let Some(code) = CodeAlone::of(recording, pattern)? {
        return Ok(code.phases(least)?);
    }
    let channel = Channel::new(recording, pattern, least)?;
    let by_itself = channel.unwrapping(None, &Err("there is no known map".into()))?;
    match by_itself.missing() {
        None => Ok(channel.decode(&by_itself)?.absolute),
        Some(missing) => Err(missing.to_owned()),
    }
}

/// The wrapped phase of a pattern's coarsest level, or the absolute one of a Gray code alone.
///
/// # Errors
/// In words: the frames make no levels.
pub(super) fn coarsest(recording: &Recording, pattern: usize) -> Result<PhaseMap, String> {
    let least = least_modulation(recording);
    if let Some(code) = CodeAlone::of(recording, pattern)? {
        return Ok(code.phases(least)?);
    }
    let channel = Channel::new(recording, pattern, least)?;
    Ok(channel.wrapped_levels()?.swap_remove(0))
}
