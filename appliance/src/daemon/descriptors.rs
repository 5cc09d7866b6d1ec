//! File descriptors: as many as the system allows, so that a flood of connections leaves some for the PLC.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Raises this process's limit to the highest that it may set. `tokio-modbus` closes every connection when `accept` finds no
/// descriptor, and the usual limit of 1024 is soon reached by somebody who means to.
pub fn raise() {
    let limit = getrlimit(Resource::Nofile);
    let highest = Rlimit {
        current: limit.maximum,
        ..limit
    };
    // What cannot be raised stays as it was; nothing depends on it.
    let _ = setrlimit(Resource::Nofile, highest);
}
