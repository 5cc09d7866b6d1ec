//! The ratio and shift that one frame shows.

/// The ratio and shift at which one frame shows a phase function Φ_P: I = I_max/2 · (1 + sin 2π(ratio · Φ_P + shift)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// Share of the full phase function. Frames of equal ratio form a level.
    pub ratio: f64,
    /// Shift in turns.
    pub shift: f64,
}

impl Shot {
    /// A level: `shifts` shots of one ratio, k/N turns apart.
    pub fn level(ratio: f64, shifts: usize) -> impl Iterator<Item = Self> + Clone {
        (0..shifts).map(move |k| Self {
            ratio,
            shift: k as f64 / shifts as f64,
        })
    }
}
