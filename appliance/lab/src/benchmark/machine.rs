//! The machine on which times are measured.

use std::fs;

/// The machine in words and numbers.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Machine {
    /// The processor's model, or its architecture if the system does not name it.
    pub processor: String,
    /// Cores that this program may use.
    pub cores: usize,
    /// Architecture, `x86_64` or `aarch64`.
    pub architecture: &'static str,
}

impl Machine {
    /// This one.
    pub fn this() -> Self {
        let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let board = fs::read_to_string("/proc/device-tree/model").unwrap_or_default();
        let board = board.trim_end_matches('\0').trim();
        let processor = if board.is_empty() {
            model(&cpuinfo).unwrap_or(std::env::consts::ARCH)
        } else {
            board
        };
        Self {
            processor: processor.to_owned(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            architecture: std::env::consts::ARCH,
        }
    }
}

/// The processor's name in `/proc/cpuinfo`; on ARM only the board has one.
fn model(cpuinfo: &str) -> Option<&str> {
    let line = cpuinfo
        .lines()
        .find(|line| line.starts_with("model name"))?;
    line.split(':').nth(1).map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processors_name_is_found() {
        let cpuinfo = "processor\t: 0\nmodel name\t: Some CPU @ 2 GHz\nflags\t: a b\n";
        assert_eq!(model(cpuinfo), Some("Some CPU @ 2 GHz"));
        assert_eq!(model("processor : 0\nBogoMIPS : 108"), None);
        assert!(Machine::this().cores > 0);
    }
}
