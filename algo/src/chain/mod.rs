//! Temporal unwrapping of levels that the production kernels do not know: by beats of any ratios, and by a Gray code.
//!
//! Recordings of other people's heads have levels such as 64 and 63 fringes, fractional numbers of fringes, or a Gray code beside
//! them. Each level's wrapped phase comes from the production kernels ([`crate::pipeline::wrapped`]); what follows is plain `f64`, a
//! pixel at a time. `plan` finds the chain, `unwrap` applies it, `gray` has the code, `alone` what it gives without
//! fringes.

mod alone;
mod gray;
mod plan;
mod unwrap;

pub use alone::SIGMA_CELLS;
pub use gray::{CodeError, CodePictures, GrayCode, MAX_CODE_BITS};
pub use plan::{Cells, Chain, ChainError, MAX_MAGNIFICATION};

#[cfg(test)]
mod tests;
