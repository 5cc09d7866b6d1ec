//! Storage: the state folder, files that a loss of power leaves whole, and archives that came from
//! elsewhere.

pub mod archive;
pub mod folder;
pub mod state;

/// Lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
