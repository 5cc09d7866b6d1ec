//! Figures of values that come one after the other: P_p, P_pk, C_p, C_pk, individuals and moving ranges.
//!
//! ```text
//! P_p = (U − L)/6s      P_pk = min(U − x̄, x̄ − L)/3s      C_p and C_pk the same with σ = M̄R̄/1.128
//! C_p √(χ²_{α/2, ν}/ν) to C_p √(χ²_{1−α/2, ν}/ν)           C_pk ± 1.96 √(1/9n + C_pk²/2ν)          ν = n − 1
//! x̄ ± 3σ, ranges up to 3.267 M̄R̄
//! ```
//!
//! Sources: Montgomery, *Introduction to Statistical Quality Control*; Bissell 1990 for the interval of C_pk. Sums have
//! twice the digits of their terms (`Sum`), so that one pass over any number of values gives what two would.

use super::decimal::Decimal;
use super::distribution::{self, Tail};
use super::marks::Mark;
use super::spread::{Spread, defined, more_than_rounding};
use super::verdict::{Prediction, Squares};
use serde::Serialize;

/// Mean moving range of two values over σ.
const RANGE_OF_TWO: f64 = 1.128;
/// Largest moving range over their mean.
const LARGEST_RANGE: f64 = 3.267;

/// The limits of a characteristic.
pub type LimitPair = (Option<Decimal>, Option<Decimal>);

/// A figure with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Capability {
    /// The figure.
    pub value: f64,
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
}

/// Values that were judged by the same limits. What cannot be formed is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProcessGroup {
    /// Lower limit.
    pub low: Option<f64>,
    /// Upper limit.
    pub high: Option<f64>,
    /// SEQ of the first value, or its line.
    pub first: u64,
    /// The same of the last.
    pub last: u64,
    /// How many values.
    pub n: usize,
    /// x̄.
    pub mean: f64,
    /// Standard deviation of all.
    pub s: Option<f64>,
    /// Mean moving range.
    pub mean_range: Option<f64>,
    /// σ by the moving range.
    pub sigma: Option<f64>,
    /// P_p.
    pub pp: Option<Capability>,
    /// P_pk.
    pub ppk: Option<Capability>,
    /// C_p.
    pub cp: Option<Capability>,
    /// C_pk.
    pub cpk: Option<Capability>,
    /// Control limits of the values.
    pub control: Option<[f64; 2]>,
    /// Control limit of the moving ranges.
    pub largest_range: Option<f64>,
    /// What was predicted of the measurement; s is that of the process.
    pub prediction: Option<Prediction>,
    /// Values that stand out, where they were looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub marks: Option<Vec<Mark>>,
    /// The values, where they are listed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub individuals: Option<Vec<f64>>,
    /// Each but the first against the one before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moving_ranges: Option<Vec<f64>>,
}

/// A sum of numbers and of squares that keeps what rounding takes off (Knuth's two-sum; Dekker 1971).
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    high: f64,
    low: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        let sum = self.high + x;
        let taken = sum - self.high;
        self.low += (self.high - (sum - taken)) + (x - taken);
        self.high = sum;
    }

    fn add_square(&mut self, x: f64) {
        let square = x * x;
        self.low += x.mul_add(x, -square);
        self.add(square);
    }

    fn value(self) -> f64 {
        self.high + self.low
    }

    /// This sum of squares less the square of a sum over n.
    fn less_mean(self, sum: Self, n: f64) -> f64 {
        let square = sum.high * sum.high;
        let rest = sum.high.mul_add(sum.high, -square) + 2.0 * sum.high * sum.low;
        let share = square / n;
        let rest = (rest - share.mul_add(n, -square)) / n;
        (self.high - share) + (self.low - rest)
    }
}

/// The sums over values that were judged by the same limits, as offsets from the first.
#[derive(Clone, Debug)]
pub struct RunningGroup {
    bounds: LimitPair,
    first: Decimal,
    /// The first value, rounded to binary.
    binary: f64,
    n: usize,
    at: [u64; 2],
    sum: Sum,
    squares: Sum,
    ranges: Sum,
    last: f64,
    /// The largest offset, without its sign.
    largest: f64,
    sigmas: Squares,
    us: Squares,
}

impl RunningGroup {
    /// Of values with these limits; none so far. Offsets are from `first`.
    pub fn new(bounds: LimitPair, first: Decimal) -> Self {
        Self {
            bounds,
            first,
            binary: first.to_f64(),
            n: 0,
            at: [0; 2],
            sum: Sum::default(),
            squares: Sum::default(),
            ranges: Sum::default(),
            last: 0.0,
            largest: 0.0,
            sigmas: Squares::default(),
            us: Squares::default(),
        }
    }

    /// The limits.
    pub fn bounds(&self) -> LimitPair {
        self.bounds
    }

    /// The first value.
    pub fn first(&self) -> Decimal {
        self.first
    }

    /// How far a value that was binary from its beginning is from the first; none if it is not finite.
    pub fn offset(&self, value: f64) -> Option<f64> {
        defined(value - self.binary)
    }

    /// The value of an offset.
    pub fn value(&self, offset: f64) -> f64 {
        self.binary + offset
    }

    /// Adds a value.
    pub fn add(&mut self, at: u64, offset: f64, sigma: Option<f64>, u: Option<f64>) {
        if self.n == 0 {
            self.at[0] = at;
        } else {
            self.ranges.add((offset - self.last).abs());
        }
        self.at[1] = at;
        self.n += 1;
        self.last = offset;
        self.largest = self.largest.max(offset.abs());
        self.sum.add(offset);
        self.squares.add_square(offset);
        self.sigmas.add(sigma);
        self.us.add(u);
    }

    fn spread(&self) -> Spread {
        let n = self.n.max(1) as f64;
        let squares = self.squares.less_mean(self.sum, n);
        Spread {
            n: self.n,
            mean: self.sum.value() / n,
            squares: more_than_rounding(squares, self.n, self.largest),
        }
    }

    fn mean_range(&self) -> Option<f64> {
        (self.n > 1).then(|| self.ranges.value() / (self.n - 1) as f64)
    }

    /// How far an offset is from the mean, in σ by moving ranges; none where nothing scatters.
    pub fn distance(&self, offset: f64) -> Option<f64> {
        let sigma = self.mean_range().filter(|range| *range > 0.0)? / RANGE_OF_TWO;
        Some((offset - self.spread().mean) / sigma)
    }

    /// The figures, without values.
    pub fn figures(&self) -> ProcessGroup {
        let spread = self.spread();
        let (n, df, s) = (spread.n, spread.df(), spread.s());
        let mean_range = self.mean_range();
        let sigma = mean_range.map(|range| range / RANGE_OF_TWO);
        let (low, high) = self.bounds;
        let below = low.map(|low| self.first.minus(low) + spread.mean);
        let above = high.map(|high| high.minus(self.first) - spread.mean);
        let nearest = match (below, above) {
            (Some(below), Some(above)) => Some(below.min(above)),
            (one, other) => one.or(other),
        };
        let width = low.zip(high).map(|(low, high)| high.minus(low));
        let over = |distance: Option<f64>, sigma: Option<f64>| defined(distance? / sigma?);
        let root = |tail| (distribution::chi_squared_quantile(tail, df) / df).sqrt();
        let both = |sigma| {
            over(width, sigma)
                .map(|six| six / 6.0)
                .map(|value| Capability {
                    value,
                    from: value * root(Tail::Lower(0.025)),
                    to: value * root(Tail::Upper(0.025)),
                })
        };
        let one = |sigma| {
            over(nearest, sigma).map(|three| three / 3.0).map(|value| {
                let half = 1.96 * (1.0 / (9.0 * n as f64) + value * value / (2.0 * df)).sqrt();
                Capability {
                    value,
                    from: value - half,
                    to: value + half,
                }
            })
        };
        let mean = self.value(spread.mean);
        ProcessGroup {
            low: low.map(Decimal::to_f64),
            high: high.map(Decimal::to_f64),
            first: self.at[0],
            last: self.at[1],
            n,
            mean,
            s,
            mean_range,
            sigma,
            pp: both(s),
            ppk: one(s),
            cp: both(sigma),
            cpk: one(sigma),
            control: sigma.map(|sigma| [mean - 3.0 * sigma, mean + 3.0 * sigma]),
            largest_range: mean_range.map(|range| LARGEST_RANGE * range),
            prediction: Prediction::compared(&self.sigmas, &self.us, s, df, true),
            marks: None,
            individuals: None,
            moving_ranges: None,
        }
    }
}
