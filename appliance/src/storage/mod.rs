//! What is stored: the state folder, files that are whole whatever happens, and archives that came from elsewhere.

pub mod archive;
pub mod folder;
pub mod state;
pub mod unpack;

/// Lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
