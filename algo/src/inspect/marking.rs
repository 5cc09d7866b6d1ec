//! What a person marks in the picture of a part.

use alloc::vec::Vec;

/// What a person says of which pixels are the part, by places (column, row) of the frame. A touch counts more than the
/// outline.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Marking {
    /// Corners of a polygon with the whole part inside; none where nothing was marked.
    pub outline: Vec<[u16; 2]>,
    /// Places on pieces of the part.
    pub part: Vec<[u16; 2]>,
    /// Places on pieces that are not of the part.
    pub others: Vec<[u16; 2]>,
}

impl Marking {
    /// Whether nothing was said.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.outline.is_empty() && self.part.is_empty() && self.others.is_empty()
    }
}

/// No part is seen where one is said to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoPart {
    /// No piece stands out where a person has touched the part: the place (column, row).
    #[error(
        "nothing stands out about column {}, row {} from what it lies on: touch the part elsewhere, or draw an outline around it",
        .0[0], .0[1]
    )]
    Touched([u16; 2]),
    /// Nothing stands out from the empty station, or inside what was marked.
    #[error(
        "nothing stands out from the empty station, or inside the outline: put the part in place, mark it anew, or record the \
         empty station again"
    )]
    Nothing,
}
