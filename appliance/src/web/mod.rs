//! The technician's page: one screen that says what the station does and what it found last.
//!
//! [`router`] gives the paths, [`events`] the server-sent events, [`view`] the JSON of a snapshot, [`host`] keeps requests
//! away that were meant for another name, [`server`] listens. The page itself is three files in `assets/`, compiled in.
//! It only reads: nothing here changes the station.
//!
//! | path | answer |
//! |---|---|
//! | `/`, `/page.css`, `/page.js` | the page |
//! | `/events` | server-sent events: the snapshot as JSON when it changes (at most 5 a second), and once a second anyway |
//! | `/api/snapshot` | the same JSON, once |
//! | `/height.png` | picture of the last measured height; 404 with words before the first |
//! | `/healthz` | 200 while the measuring task meets its deadlines, else 503 |
pub mod events;
pub mod host;
pub mod router;
pub mod server;
pub mod view;

#[cfg(test)]
mod looking;
#[cfg(test)]
mod tests;

pub use router::{HeightPicture, Site};
pub use server::{WebError, bind, serve};
