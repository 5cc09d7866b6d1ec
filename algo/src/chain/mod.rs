//! Temporal unwrapping of levels that the production kernels do not know: by beats of any ratios,
//! and by a Gray code.
//!
//! Recordings of other people's heads have levels such as 64 and 63 fringes, fractional numbers of
//! fringes, or a Gray code beside them. Each level's wrapped phase comes from the production
//! kernels ([`crate::pipeline::wrapped`]); what follows is plain `f64`, a pixel at a time. `plan`
//! finds the chain, `unwrap` applies it, `gray` has the code, `edges` where its cells end within
//! the fringes, `alone` what it gives without fringes.

mod alone;
mod edges;
mod gray;
mod plan;
mod unwrap;

pub use alone::{CodePhases, SIGMA_CELLS};
pub use edges::{EXPECTED_TURNS, Edges};
pub use gray::{CodeError, CodePictures, Coding, GrayCode, MAX_CODE_BITS, Seen};
pub use plan::{Cells, Chain, ChainError, MAX_MAGNIFICATION};

#[cfg(test)]
mod tests;
