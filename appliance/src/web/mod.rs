//! The technician's page and its API: shows the station and its results, and changes what may be
//! changed.
//!
//! [`router`] is the table of all paths, described in `openapi.json`. Reading needs no login; every
//! change passes the gate: Origin, session, record of changes. [`events`] are the server-sent
//! events, [`view`] the JSON of a snapshot, [`host`] refuses requests for another host name,
//! [`server`] listens and [`slots`] limits its connections. The files of the page are in `assets/`
//! and compiled in.

pub mod access;
pub mod assets;
pub mod board;
mod body;
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
mod tries;
mod turns;
pub mod view;

mod downloads;
mod gate;
mod head;
mod history;
mod kept;
mod metrics;
mod orders;
mod query;
mod recipes;
mod results;
mod sessions;

#[cfg(test)]
mod tests;

pub use server::serve;
pub use site::{Parts, Site};
