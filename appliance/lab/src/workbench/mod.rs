//! Pictures of other programs and heads: what to project, a recording of what was taken, and
//! patterns made for a part.

pub mod adapt;
pub mod import;
pub mod layout;
mod outline;
pub mod projected;
