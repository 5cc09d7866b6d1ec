//! What is wrong with a scenario or a part that cannot be simulated.

use hal::bounds::OutOfBounds;

/// Most rays of a light transport; so many take minutes.
pub(crate) const MAX_RAYS: u64 = 1 << 28;

/// A value with which nothing can be simulated; the message names its key and says what to write.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// A value is outside its bounds.
    #[error(transparent)]
    OutOfBounds(#[from] OutOfBounds),
    /// No camera has so many bits.
    #[error("bit_depth is {0}: write 8, 10 or 12")]
    BitDepth(u8),
    /// A colour sensor is smaller than one cell of its colour filter.
    #[error(
        "rig.camera of {width}×{height} pixels with colour = true has no green plane: write at least 2 columns and rows"
    )]
    NoGreenPlane {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The light transport would take too long.
    #[error(
        "rig.camera of {width}×{height} pixels with {sub_rays}² sub_rays is {rays} rays: keep within {MAX_RAYS}"
    )]
    TooManyRays {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Rays per pixel along each side.
        sub_rays: u32,
        /// Rays of all pixels.
        rays: u64,
    },
    /// The camera has a period of its own, and the projector triggers it.
    #[error(
        "timing.camera_period_us: write 0 for a camera that the projector triggers (timing.by_projector)"
    )]
    OwnPeriod,
    /// The camera's period is shorter than its exposure or its readout.
    #[error(
        "timing.camera_period_us is {period_us}: write at least {least_us}, its exposure or readout, or 0 for a triggered camera"
    )]
    ShortPeriod {
        /// The period, µs.
        period_us: u64,
        /// The shortest possible one, µs.
        least_us: u128,
    },
    /// The part cannot have a defect of this kind; the text says which it can have.
    #[error("part.defects: {0}")]
    Defect(&'static str),
    /// A defect of a hole of a part without holes.
    #[error("part.defects.index is {index}: the part has no holes")]
    NoHoles {
        /// The hole.
        index: usize,
    },
}

/// The message, for callers that hand it to a person as it is.
impl From<Unfit> for String {
    fn from(unfit: Unfit) -> Self {
        unfit.to_string()
    }
}
