//! What is stored: the state folder, files that are whole whatever happens, and archives that came from elsewhere.

pub mod archive;
pub mod folder;
pub mod state;
pub mod unpack;
