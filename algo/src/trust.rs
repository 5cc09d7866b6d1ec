//! Whether a pixel is resolved, and if not, the first reason.

/// Smallest modulation that is trusted, in counts of an 8-bit sample; scales with full scale.
pub const MIN_MODULATION_8_BIT: f64 = 16.0;

/// Whether a pixel is resolved, or the first reason why it is not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Trust {
    /// Phase (and height) are valid.
    Resolved = 0,
    /// The coarsest level's modulation is below 16 counts (of 255): the pixel sees none of the pattern.
    #[default]
    Dark = 1,
    /// A finer level's modulation is below 16 counts: its fringes are not resolved.
    LowModulation = 2,
    /// A sample is at full scale in a level of fewer than 8 shifts.
    Saturated = 3,
    /// The residual of an unwrapping step is above 0.40 turn: the fringe order would be a guess.
    Residual = 4,
    /// No height in the working range has this phase, or more than one has.
    OutOfRange = 5,
    /// The map that the levels are unwrapped about has no phase here: not decoded.
    Unexpected = 6,
}

impl Trust {
    /// Every reason for rejecting a pixel. A pixel has the first that applies.
    pub const REASONS: [Self; 6] = [
        Self::Unexpected,
        Self::Dark,
        Self::LowModulation,
        Self::Saturated,
        Self::Residual,
        Self::OutOfRange,
    ];

    /// The largest number of a variant.
    pub(crate) const LAST: u8 = Self::Unexpected as u8;

    /// The word for reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Resolved => "resolved",
            Self::Dark => "dark",
            Self::LowModulation => "low_modulation",
            Self::Saturated => "saturated",
            Self::Residual => "residual",
            Self::OutOfRange => "out_of_range",
            Self::Unexpected => "unexpected",
        }
    }

    /// Whether the phase is valid (the height may still be out of range).
    pub fn has_phase(self) -> bool {
        matches!(self, Self::Resolved | Self::OutOfRange)
    }
}
