//! The technician's page and its API: what the station does, what it found, and what may be changed about it.
//!
//! [`router`] is the table of all paths, described for others in `openapi.json`. Looking needs no login; whatever changes
//! something passes the gate: Origin, session, record. [`events`] are the server-sent events, [`view`] the JSON of a
//! snapshot, [`host`] keeps requests away that were meant for another name, [`server`] listens and [`slots`] bounds its
//! connections. The page itself is a handful of files in `assets/`, compiled in.
pub mod access;
pub mod assets;
pub mod body;
pub mod events;
pub mod host;
pub mod look;
pub mod map;
pub mod problem;
pub mod router;
pub mod server;
pub mod simulation;
mod site;
pub mod slots;
pub mod view;

mod downloads;
mod gate;
mod history;
mod kept;
mod metrics;
mod orders;
mod recipes;
mod sessions;

#[cfg(test)]
mod tests;

pub use server::serve;
pub use site::{Parts, Site};
