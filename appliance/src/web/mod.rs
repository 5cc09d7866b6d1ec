//! The technician's page and its API: shows the station and its results, and changes what may be
//! changed.
//!
//! [`server`] has the table of all paths, described in `openapi.json`, and listens; [`slots`] limits its
//! connections. Every request passes the gate (`gate.rs`): the role that its row needs, and of a change
//! its Origin and the record of changes. It also refuses requests for another host name. [`view`] is the snapshot as
//! JSON and as server-sent events. The files of the page are in `assets/` and compiled in.

pub mod assets;
pub mod look;
pub mod map;
pub mod problem;
pub mod server;
pub mod slots;
pub mod view;

mod backup;
mod changes;
mod desk;
mod downloads;
mod gate;
mod head;
mod history;
mod maps;
mod metrics;
mod orders;
mod recipes;
mod request;
mod results;
mod session;
mod site;
mod statistics;
mod studies;
mod tries;
mod triggers;
mod users;

#[cfg(test)]
mod tests;

pub use server::serve;
pub use site::{Parts, Site};
