//! Why a pixel has no height.

/// Resolved, or the first reason why not, in the order in which they are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Reason {
    /// Phase and height are valid.
    Resolved,
    /// The map that the levels are unwrapped about knows nothing here.
    Unexpected,
    /// The coarsest level's modulation is below 16 counts of 255.
    Dark,
    /// Another level's modulation is.
    LowModulation,
    /// A sample is at full scale in a level of fewer than 8 shifts.
    Saturated,
    /// A rounding step of the unwrapping left more than 0.40 turn over.
    Residual,
    /// No height in the working range has this phase, or several have.
    OutOfRange,
}

impl Reason {
    /// The word that reports use.
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
