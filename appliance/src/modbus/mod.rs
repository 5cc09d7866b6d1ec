//! Modbus TCP: the register map, version 1.4, and the server that shows a
//! [`Snapshot`](crate::station::Snapshot) through it.
//!
//! [`map`] is the one table, which [`render`] prints; [`encode`] and [`blocks`] turn a snapshot into
//! words, [`service`] answers one request, [`guard`] checks one connection's frames and times,
//! [`clients`] limits the connections and logs what is refused, [`server`] joins them to
//! `tokio-modbus`.
//!
//! Decisions where the map is silent:
//!
//! - A slot without a gauge reads as invalid (0x80000000, NaN), and so does the RESULT block
//!   before the first result: a zero could be taken for a measured height.
//! - A unit-less gauge has the register step 0.0001.
//! - A client that may not write gets exception 1 for every FC5, 6, 15, 16 and 23, well-formed or
//!   not.
//! - FC43/14 gives vendor, product code and version as the basic objects 0–2, the product name as 4
//!   and the serial as 0x80.
//! - A frame whose header is no Modbus TCP (protocol not 0, length not 2–254, function code
//!   above 127) closes the connection: it is not known where the next frame begins. A request that
//!   only contradicts itself (byte count, length, coil value) gets exception 3; `tokio-modbus`
//!   alone would close the connection or panic, so the guard checks first.

pub mod blocks;
pub mod clients;
pub mod encode;
pub mod guard;
pub mod map;
pub mod render;
pub mod server;
pub mod service;

#[cfg(test)]
mod tests;

pub use blocks::live;
pub use clients::{Clients, Refusals};
pub use render::{registers_csv, registers_json};
pub use server::{Options, serve};
