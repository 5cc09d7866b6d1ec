//! Devices: traits and back-ends.
