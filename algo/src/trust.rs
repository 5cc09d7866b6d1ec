//! Which pixels to trust, and why not the others.

/// Smallest modulation that is trusted, in counts of an 8-bit sample; scales with full scale.
pub const MIN_MODULATION_8_BIT: f64 = 16.0;

/// Whether a pixel is resolved, or the first reason why it is not, in the order in which the
/// reasons are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Trust {
    /// Phase (and height) are valid.
    Resolved = 0,
    /// The coarsest level's modulation is below 16 counts (of 255): the pattern's light does not
    /// reach the pixel.
    #[default]
    Dark = 1,
    /// A finer level's modulation is below 16 counts: its fringes are not resolved.
    LowModulation = 2,
    /// A sample is at full scale in a level of fewer than 8 shifts.
    Saturated = 3,
    /// An unwrapping step left more than 0.40 turn over.
    Residual = 4,
    /// No height in the working range has this phase.
    OutOfRange = 5,
    /// Nothing is known here to unwrap about: not looked at.
    Unexpected = 6,
}

impl Trust {
    /// Every reason for rejecting a pixel, in the order in which they are looked for.
    pub const REASONS: [Self; 6] = [
        Self::Unexpected,
        Self::Dark,
        Self::LowModulation,
        Self::Saturated,
        Self::Residual,
        Self::OutOfRange,
    ];

    /// The largest of their numbers.
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
