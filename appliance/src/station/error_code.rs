//! The error codes that the station gives by itself; the worker brings its own (1xx camera … 7xx thermal).

/// A stored recipe is damaged or cannot be used on this head; it stays stored.
pub const RECIPE_UNUSABLE: u16 = 402;
/// There is not enough room left to store results.
pub const STORAGE_FULL: u16 = 602;
/// The number of a result could not be stored.
pub const SEQ_NOT_STORED: u16 = 603;
/// The station's measuring task did not answer before the deadline of a wait.
pub const DEADLINE: u16 = 801;
/// The PLC or a stop ended the cycle before it had a result.
pub const ABORTED: u16 = 802;
/// The measuring task failed without naming a code of its own.
pub const UNNAMED: u16 = 899;

/// The family of an error code in words, for the page and the log.
pub fn family(code: u16) -> &'static str {
    match code / 100 {
        0 => "none",
        1 => "camera",
        2 => "projector",
        3 => "sync",
        4 => "recipe",
        5 => "calibration",
        6 => "storage",
        7 => "thermal",
        _ => "internal",
    }
}
