//! Why a pixel has no height.

/// Resolved, or the first reason why not, in the order in which they are checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Reason {
    /// Phase and height are valid.
    Resolved,
    /// The map about which the levels are unwrapped has no phase here.
    Unexpected,
    /// The coarsest level's modulation is below the least that is trusted.
    Dark,
    /// The modulation of another level is below the least that is trusted.
    LowModulation,
    /// Samples are at full scale, and the others give no phase that is trusted.
    Saturated,
    /// A residual of the unwrapping is above 0.40 turn.
    Residual,
    /// No height in the working range has this phase, or several have.
    OutOfRange,
}

impl Reason {
    /// Its name in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Resolved => "resolved",
            Self::Unexpected => "unexpected",
            Self::Dark => "dark",
            Self::LowModulation => "low_modulation",
            Self::Saturated => "saturated",
            Self::Residual => "residual",
            Self::OutOfRange => "out_of_range",
        }
    }

    /// Whether the phase is valid, with or without a height.
    pub fn has_phase(self) -> bool {
        self == Self::Resolved || self == Self::OutOfRange
    }
}
