//! ERROR_CODE: every code that a result or a fault can have; `docs/operations.md` has the table
//! with the remedies.

/// The camera is lost.
pub const CAMERA_LOST: u16 = 101;
/// A device cannot do what is asked of it: any device, although the code is in the camera's family.
pub const UNSUPPORTED: u16 = 102;
/// The frames of a cycle are not those that the recipe was made for.
pub const WRONG_FRAMES: u16 = 103;
/// The projector is lost.
pub const PROJECTOR_LOST: u16 = 201;
/// A device did not answer in time.
pub const TIMEOUT: u16 = 301;
/// A device broke the rules of its interface.
pub const PROTOCOL: u16 = 302;
/// The GPIO chip of the camera's trigger is lost.
pub const LINES_LOST: u16 = 303;
/// What is in front of the head cannot be taught; the message says why.
pub const NOTHING_TO_TEACH: u16 = 401;
/// A stored recipe is damaged or cannot be used on this head; it stays stored.
pub const RECIPE_UNUSABLE: u16 = 402;
/// The geometry, the pattern and a recipe do not fit each other: teaching cannot triangulate with
/// them, the recipe that was taught cannot be made ready to measure, or a trigger came without a
/// recipe.
pub const RIG: u16 = 501;
/// The head has no calibration that can be used.
pub const NOT_CALIBRATED: u16 = 502;
/// A recipe could not be stored.
pub const NOT_STORED: u16 = 601;
/// There is not enough room left to store results.
pub const STORAGE_FULL: u16 = 602;
/// The number of a result could not be stored.
pub const SEQ_NOT_STORED: u16 = 603;
/// The measuring task did not answer before the deadline of a job, or gave no sign of life while it
/// had none.
pub const DEADLINE: u16 = 801;
/// The PLC or a stop ended the cycle before it had a result.
pub const ABORTED: u16 = 802;
/// The measuring task failed without naming a code of its own.
pub const UNNAMED: u16 = 899;

/// A part was measured but cannot be judged: nothing of the pattern's light comes back from it.
pub const EMPTY: u16 = 901;
/// What lies there does not look like the part that was taught.
pub const NOT_THE_PART: u16 = 902;
/// The part lies farther from its place than the recipe allows.
pub const OUT_OF_PLACE: u16 = 903;
/// Much less light comes back than when the part was taught.
pub const TOO_DARK: u16 = 904;
/// So much light comes back that samples are at full scale.
pub const SATURATED: u16 = 905;
/// The fine fringes have lost their contrast.
pub const BLURRED: u16 = 906;
/// A value lies too close to a limit to prove PASS or FAIL.
pub const GUARD_BAND: u16 = 907;
/// A gauge found nothing to measure.
pub const NOT_MEASURED: u16 = 908;
/// The light changed within a cycle by more than can be corrected.
pub const UNSTEADY_LIGHT: u16 = 909;

/// Whether a code says why a part could not be judged, not that the station failed.
pub fn is_of_part(code: u16) -> bool {
    code / 100 == 9
}

/// The code of a failure: [`UNNAMED`] in place of 0, which means no error.
pub(super) fn or_unnamed(code: u16) -> u16 {
    if code == 0 { UNNAMED } else { code }
}

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
        // Reserved: no code is in this family yet.
        7 => "thermal",
        9 => "part",
        _ => "internal",
    }
}
