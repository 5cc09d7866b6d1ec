//! Temporal unwrapping of levels that the production kernels do not support: by beats of any ratios,
//! and by a Gray code.
//!
//! Recordings of other people's heads have levels such as 64 and 63 fringes, fractional numbers of
//! fringes, or a Gray code beside them. Each level's wrapped phase comes from the production
//! kernels ([`crate::pipeline::wrapped`]); what follows is plain `f64`, a pixel at a time. This
//! file plans the chain, `unwrap` applies it, `gray` has the code and where its cells end within
//! the fringes, `alone` what the code gives without fringes.
//!
//! A beat of two levels a, b has phase φ_a − φ_b, ratio r_a − r_b and the noise of both (Cheng &
//! Wyant 1985, for wavelengths; Reich, Ritter & Thesing 1997 and Towers, Towers & Jones 2003, for
//! fringes); a beat of two beats is computed in the same way. A beat, or a level, that spans at
//! most one turn of the pattern is absolute by itself, as 2 φ_b − φ_a of 13 and 7 fringes; a Gray
//! code is absolute within half a cell. From an absolute phase of ratio r_a the next level b gets
//! its fringe order k = round(r_b Φ − φ_b). With a = Σ m_i φ_i and b = Σ n_i φ_i its argument has
//! the error Σ (m_i r_b / r_a − n_i) e_i, where e_i is the noise of φ_i, which falls with √N_i. The
//! safety of a step is (½ turn − the uncertainty by the code's cell) / noise. Of all chains of
//! levels, beats and beats of beats, the one whose least safe step is the safest is taken.

mod alone;
mod gray;
#[cfg(test)]
mod tests;
mod unwrap;

pub use alone::{CodePhases, SIGMA_CELLS};
pub use gray::{
    CodeError, CodePictures, CodeWord, Coding, EXPECTED_TURNS, Edges, GrayCode, MAX_CODE_BITS,
};

use crate::pattern::{Level, MAX_LEVELS, PhaseRange};
use alloc::vec::Vec;

/// Largest noise of a step's fringe order, in units of the finest level's noise. Two levels of 64
/// and 63 fringes have 90.
pub const MAX_MAGNIFICATION: f64 = 128.0;
/// Largest span of the chain's first level, in turns, that is still absolute by itself.
const ONE_TURN: f64 = 1.001;
/// Noise with which the safety of steps is computed: σ of a level's phase times √N, turns; 0.01 turn
/// for 4 shifts.
const NOISE: f64 = 0.02;
/// Smaller ratios of beats are rounding of equal ratios.
const LEAST_RATIO: f64 = 1e-6;
/// Relative rounding by which half a cell of a code may exceed half a turn.
const ROUNDING: f64 = 1e-6;
/// Least safety of the steps of a chain that starts about a map. It allows a step to 50 times the
/// ratio with 4 shifts. [`NOISE`] is that of faint fringes, whose wrong orders leave large
/// residuals.
const SAFE: f64 = 1.0;

/// The cells of a Gray code in turns of the phase function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cells {
    /// Φ_P at the beginning of the first cell.
    pub origin: f64,
    /// Φ_P from one cell to the next.
    pub width: f64,
    /// Number of cells on the projector.
    pub count: u32,
    /// Number of bits of the code.
    pub bits: u8,
    /// How the numbers of cells are written in the bits.
    pub coding: Coding,
}

/// Levels (and a code, if there is one) without an absolute phase.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChainError {
    /// Nothing is absolute by itself.
    #[error(
        "levels of ratios {0:?} have no absolute phase: neither one of them nor a beat of them spans at most one turn of the \
         pattern: add a coarser level, a level with one fringe more or less, or a Gray code"
    )]
    NoStart(Vec<f64>),
    /// The finest level cannot be reached.
    #[error(
        "levels of ratios {ratios:?}: a step to the finest level multiplies the noise by {magnification:.0}, above \
         {MAX_MAGNIFICATION}: add a level between them"
    )]
    TooFar {
        /// The levels' ratios.
        ratios: Vec<f64>,
        /// Noise of the step in units of the finest level's.
        magnification: f64,
    },
    /// The code's cells are wider than a fringe of every level and beat.
    #[error(
        "a cell of the Gray code is {turns:.3} turns of the finest level wide, and no coarser level or beat has its order within a \
         cell: make the cells narrower, or add a level"
    )]
    WideCells {
        /// Width of a cell in turns of the finest level.
        turns: f64,
    },
}

/// A level or a beat: Σ m_i φ_i with whole m_i.
#[derive(Clone, Debug, PartialEq)]
struct Link {
    /// m_i of each level.
    pub weights: [i8; MAX_LEVELS],
    /// Σ m_i r_i, positive.
    pub ratio: f64,
    /// Noise of its phase in turns.
    pub noise: f64,
}

/// The best chain to a candidate.
#[derive(Clone, Debug)]
struct Way {
    /// Half a turn less what is uncertain by the code, over the noise, of the least safe step.
    safety: f64,
    steps: usize,
    /// The candidate from which this one is unwrapped.
    before: Option<usize>,
}

impl Way {
    /// Whether it is safer by more than rounding, or as safe in fewer steps.
    fn betters(&self, other: &Self) -> bool {
        let margin = 1e-9 * other.safety.min(1e9);
        self.safety > other.safety + margin
            || (self.safety >= other.safety - margin && self.steps < other.steps)
    }
}

/// What the first link of a chain is unwrapped by.
#[derive(Clone, Debug, PartialEq)]
enum ChainStart {
    /// It is absolute by itself, from this lowest phase in its turns on.
    Itself(f64),
    /// The cells of a code.
    Code(Cells),
    /// A known map of the phase.
    Map,
}

/// How levels are unwrapped one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Levels and beats from coarse to fine; the last is the finest level.
    links: Vec<Link>,
    start: ChainStart,
    ratios: Vec<f64>,
    magnification: f64,
}

impl Chain {
    /// Finds the chain of levels (coarse to fine) of a phase function with this range, from a Gray
    /// code if there is one.
    ///
    /// # Errors
    /// If the levels and the code have no chain; the message says what to add.
    pub fn new(
        levels: &[Level],
        range: PhaseRange,
        cells: Option<Cells>,
    ) -> Result<Self, ChainError> {
        let half_cell = cells.map_or(0.0, |cells| cells.width / 2.0);
        let candidates = candidates(levels);
        let best = best(levels, &candidates, |_, to| match cells {
            None => (to.ratio * range.span() <= ONE_TURN).then_some(f64::INFINITY),
            Some(_) => {
                let left = 0.5 * (1.0 + ROUNDING) - to.ratio * half_cell;
                (left >= 0.0).then(|| left / to.noise)
            }
        });
        let Some((_, links)) = best else {
            return Err(match cells {
                Some(cells) => ChainError::WideCells {
                    turns: cells.width * levels[levels.len() - 1].ratio,
                },
                None => ChainError::NoStart(levels.iter().map(|level| level.ratio).collect()),
            });
        };
        let first = links[0].ratio;
        // The part of a turn that the first link does not use is margin for noise, half on each
        // side.
        let margin = (1.0 - first * range.span()).max(0.0) / 2.0;
        let itself = ChainStart::Itself(first * range.min - margin);
        let chain = Self::of(levels, links, cells.map_or(itself, ChainStart::Code));
        match chain.magnification > MAX_MAGNIFICATION {
            true => Err(ChainError::TooFar {
                ratios: chain.ratios,
                magnification: chain.magnification,
            }),
            false => Ok(chain),
        }
    }

    /// The chain of levels whose phase is known to within some turns: from the coarsest level or
    /// beat from which all steps are safe.
    pub fn about_map(levels: &[Level]) -> Self {
        let candidates = candidates(levels);
        let from = |start| {
            let best = best(levels, &candidates, |at, _| {
                (at == start).then_some(f64::INFINITY)
            });
            best.filter(|(safety, _)| *safety >= SAFE)
        };
        let found = (0..candidates.len()).find_map(from);
        let finest = || alloc::vec![candidates[candidates.len() - 1].clone()];
        let links = found.map_or_else(finest, |(_, links)| links);
        Self::of(levels, links, ChainStart::Map)
    }

    fn of(levels: &[Level], links: Vec<Link>, start: ChainStart) -> Self {
        let finest = links[links.len() - 1].noise;
        let steps = links.windows(2);
        let noise = steps.map(|pair| step_noise(&pair[0], &pair[1], levels));
        Self {
            magnification: noise.fold(1.0, |most: f64, noise| most.max(noise / finest)),
            ratios: levels.iter().map(|level| level.ratio).collect(),
            links,
            start,
        }
    }

    /// By how much the map that a chain starts about may be off, in turns of the phase function.
    pub fn reach(&self) -> f64 {
        0.5 / self.links[0].ratio
    }

    /// The word for reports.
    pub fn kind(&self) -> &'static str {
        match self.start {
            ChainStart::Code(_) => "gray code",
            _ if self.links.iter().all(Link::is_level) => "geometric",
            _ => "heterodyne",
        }
    }

    /// Largest noise of a fringe order, in units of the finest level's noise.
    pub fn magnification(&self) -> f64 {
        self.magnification
    }

    /// The steps in words: ratios of levels and beats from coarse to fine, a beat in brackets.
    pub fn steps(&self) -> Vec<alloc::string::String> {
        let words = |link: &Link| match link.is_level() {
            true => alloc::format!("{:.6}", link.ratio),
            false => alloc::format!("({:.6})", link.ratio),
        };
        let code = match &self.start {
            ChainStart::Code(cells) => Some(alloc::format!("{} cells", cells.count)),
            _ => None,
        };
        code.into_iter()
            .chain(self.links.iter().map(words))
            .collect()
    }

    /// Whether a level takes part, for each level from coarse to fine.
    fn uses(&self) -> Vec<bool> {
        let used = |at: usize| self.links.iter().any(|link| link.weights[at] != 0);
        (0..self.ratios.len()).map(used).collect()
    }
}

impl Link {
    fn is_level(&self) -> bool {
        self.weights.iter().map(|weight| weight.abs()).sum::<i8>() == 1
    }

    /// The difference of two links, with a positive ratio.
    fn beat(&self, other: &Self, levels: &[Level]) -> Option<Self> {
        let (high, low) = match self.ratio > other.ratio {
            true => (self, other),
            false => (other, self),
        };
        let mut weights = high.weights;
        for (weight, less) in weights.iter_mut().zip(&low.weights) {
            *weight -= less;
        }
        let ratio = high.ratio - low.ratio;
        (ratio > LEAST_RATIO).then(|| Self {
            noise: noise(weights.iter().map(|&weight| f64::from(weight)), levels),
            weights,
            ratio,
        })
    }
}

/// The safest way to the finest level, the last candidate, with its safety, from candidates that
/// are known with the safety of `first`.
fn best(
    levels: &[Level],
    candidates: &[Link],
    first: impl Fn(usize, &Link) -> Option<f64>,
) -> Option<(f64, Vec<Link>)> {
    let mut best: Vec<Option<Way>> = alloc::vec![None; candidates.len()];
    for (at, to) in candidates.iter().enumerate() {
        let mut found = first(at, to).map(|safety| Way {
            safety,
            steps: 0,
            before: None,
        });
        for (before, from) in candidates[..at].iter().enumerate() {
            let Some(known) = &best[before] else {
                continue;
            };
            let step = 0.5 / step_noise(from, to, levels);
            let way = Way {
                safety: step.min(known.safety),
                steps: known.steps + 1,
                before: Some(before),
            };
            if to.ratio > from.ratio && found.as_ref().is_none_or(|found| way.betters(found)) {
                found = Some(way);
            }
        }
        best[at] = found;
    }
    let target = candidates.len() - 1;
    let safety = best[target].as_ref()?.safety;
    let mut path = alloc::vec![target];
    while let Some(before) = best[path[path.len() - 1]]
        .as_ref()
        .and_then(|way| way.before)
    {
        path.push(before);
    }
    let links = path.iter().rev().map(|&at| candidates[at].clone());
    Some((safety, links.collect()))
}

/// Noise of Σ c_i φ_i in turns: the levels' are independent and fall with √N.
fn noise(weights: impl Iterator<Item = f64>, levels: &[Level]) -> f64 {
    let variances = weights
        .zip(levels)
        .map(|(weight, level)| weight * weight / level.shifts() as f64);
    NOISE * libm::sqrt(variances.sum())
}

/// Noise of the fringe order of `to` from the absolute phase of `from`, in turns.
fn step_noise(from: &Link, to: &Link, levels: &[Level]) -> f64 {
    let factor = to.ratio / from.ratio;
    let pairs = from.weights.iter().zip(&to.weights);
    noise(
        pairs.map(|(&m, &n)| f64::from(m) * factor - f64::from(n)),
        levels,
    )
}

/// The levels, their beats, and the beats of these with each other and with levels, from coarse to
/// fine; the finest level is the last.
fn candidates(levels: &[Level]) -> Vec<Link> {
    let own = |at: usize| {
        let mut weights = [0; MAX_LEVELS];
        weights[at] = 1;
        Link {
            noise: noise(weights.iter().map(|&weight| f64::from(weight)), levels),
            weights,
            ratio: levels[at].ratio,
        }
    };
    let mut all: Vec<Link> = (0..levels.len()).map(own).collect();
    let mut begin = 0;
    for _ in 0..2 {
        let end = all.len();
        for high in begin..end {
            for low in 0..high {
                let beat = all[high].beat(&all[low], levels);
                all.extend(
                    beat.filter(|beat| all.iter().all(|known| known.weights != beat.weights)),
                );
            }
        }
        begin = end;
    }
    let finest = all[levels.len() - 1].clone();
    all.retain(|link| link.ratio < finest.ratio);
    all.sort_by(|a, b| {
        a.ratio
            .total_cmp(&b.ratio)
            .then(a.noise.total_cmp(&b.noise))
    });
    all.push(finest);
    all
}
