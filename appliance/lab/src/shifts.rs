//! The convention of shifts of a recording: sine or cosine, rising or falling, and where it begins.

use appliance::cli::numbers::number;
use hal::bounds::MAX_SHIFT_TURNS;

/// First shifts differ by quarters or thirds of a turn: the parts of a turn, and how near a measured
/// difference must be to a multiple of one, turns.
const USUAL: [(f64, f64); 2] = [(4.0, 0.0625), (3.0, 0.04)];

/// How the sine of a level is written down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Convention {
    /// I = A + B sin 2π(Φ + shift).
    Sin,
    /// I = A + B cos 2π(Φ + shift).
    Cos,
}

/// Whether the shift rises or falls from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ShiftSign {
    /// Frame k of N has the shift + k/N turn.
    #[value(name = "+")]
    Rising,
    /// Frame k of N has the shift − k/N turn.
    #[value(name = "-")]
    Falling,
}

/// The convention of shifts.
#[derive(Clone, Copy, Debug, PartialEq, clap::Args)]
pub struct Shifts {
    /// Whether the phase is that of a sine or of a cosine.
    #[arg(long, default_value = "sin")]
    pub convention: Convention,
    /// Whether the shift rises or falls from frame to frame.
    #[arg(
        id = "shift",
        long = "shift",
        value_name = "SHIFT",
        default_value = "+",
        allow_hyphen_values = true
    )]
    pub sign: ShiftSign,
    /// Shift of each level's first frame, turns.
    #[arg(id = "first_shift", long = "first-shift", value_name = "TURNS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = number(-MAX_SHIFT_TURNS, MAX_SHIFT_TURNS))]
    pub first: f64,
}

impl Convention {
    /// The shift of this function against the sine, in turns.
    pub fn turns(self) -> f64 {
        match self {
            Self::Sin => 0.0,
            Self::Cos => 0.25,
        }
    }
}

impl ShiftSign {
    /// The other one.
    pub fn reversed(self) -> Self {
        match self {
            Self::Rising => Self::Falling,
            Self::Falling => Self::Rising,
        }
    }
}

impl Shifts {
    /// The shift of the sine of frame `k` of `steps`, in turns.
    pub fn of(self, k: u8, steps: u8) -> f64 {
        let share = f64::from(k) / f64::from(steps);
        let along = match self.sign {
            ShiftSign::Rising => share,
            ShiftSign::Falling => -share,
        };
        along + self.first + self.convention.turns()
    }

    /// The shift of the sine in the first frame, turns.
    pub fn total(self) -> f64 {
        self.first + self.convention.turns()
    }

    /// These shifts with `total` as the shift of the sine in the first frame; in the convention that
    /// states it most plainly: with a first shift of 0, as stated, or of half a turn.
    pub fn with_total(self, sign: ShiftSign, total: f64) -> Self {
        let total = match usual(total - self.total()) {
            Some(turns) => self.total() + turns,
            None => (100.0 * total).round() / 100.0,
        };
        let other = match self.convention {
            Convention::Sin => Convention::Cos,
            Convention::Cos => Convention::Sin,
        };
        let [own, other] = [self.convention, other].map(|convention| {
            let first = total - convention.turns();
            let first = first - first.round();
            Self {
                convention,
                sign,
                first: if first == -0.5 { 0.5 } else { first },
            }
        });
        let plain = [0.0, self.first, 0.5].into_iter().find_map(|first| {
            let is_it = |shifts: &Self| (shifts.first - first).abs() < 1e-9;
            let found = [own, other].into_iter().find(is_it);
            found.map(|shifts| Self { first, ..shifts })
        });
        plain.unwrap_or(own)
    }

    /// The options of these shifts where others were stated.
    pub fn options(self, stated: Self) -> String {
        let convention = match self.convention {
            Convention::Sin => "sin",
            Convention::Cos => "cos",
        };
        let sign = match self.sign {
            ShiftSign::Rising => "+",
            ShiftSign::Falling => "-",
        };
        let first = match (self.first, stated.first) {
            (0.0, 0.0) => String::new(),
            (first, _) => format!(" --first-shift {first}"),
        };
        format!("--convention {convention} --shift {sign}{first}")
    }
}

/// The whole number of quarters or thirds of a turn that `turns` is near enough to stand for.
pub fn usual(turns: f64) -> Option<f64> {
    let parts = USUAL.into_iter().map(|(parts, near)| {
        let usual = (turns * parts).round() / parts;
        (usual, near)
    });
    let mut near = parts.filter(|(usual, near)| (usual - turns).abs() < *near);
    near.next().map(|(usual, _)| usual)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_are_named_in_the_plainest_way() {
        let stated = |convention, first| Shifts {
            convention,
            sign: ShiftSign::Rising,
            first,
        };
        let third = -1.0 / 3.0;
        for (convention, first, total, expected) in [
            (Convention::Sin, 0.0, 0.25, "--convention cos --shift +"),
            (Convention::Cos, 0.0, 0.01, "--convention sin --shift +"),
            (
                Convention::Cos,
                0.0,
                0.74,
                "--convention cos --shift + --first-shift 0.5",
            ),
            (
                Convention::Sin,
                0.0,
                -0.25,
                "--convention cos --shift + --first-shift 0.5",
            ),
            (
                Convention::Sin,
                0.5,
                0.0,
                "--convention sin --shift + --first-shift 0",
            ),
            (
                Convention::Sin,
                0.0,
                0.1,
                "--convention sin --shift + --first-shift 0.1",
            ),
            (
                Convention::Sin,
                third,
                third + 0.25,
                "--convention cos --shift + --first-shift -0.3333333333333333",
            ),
        ] {
            let stated = stated(convention, first);
            let named = stated.with_total(ShiftSign::Rising, total);
            assert_eq!(named.options(stated), expected);
        }
    }
}
