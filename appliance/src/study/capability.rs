//! The capability of a gauge by repeated measurements of one reference part: C_g, C_gk, Q_MS.
//!
//! ```text
//! bias = x̄ − x_ref ± t s/√n        C_g = (share/100) T / (spread s)        C_gk = ((share/200) T − |bias|) / (spread/2 s)
//! U_MS = 2 √(u_CAL² + max(u_RE², u_EVR²) + u_BI² + …)        u_RE = resolution/√12, u_EVR = s, u_BI = |bias|/√3
//! Q_MS = 2 U_MS / T
//! ```
//!
//! Sources: ISO 22514-7:2021 and VDA 5 (2021).

use super::decimal::Decimal;
use super::distribution::{self, Tail};
use super::spread::{Spread, defined, offsets};
use super::text::{rounded, short, shown, titled};
use super::values::Characteristic;
use super::verdict::{Judgement, Prediction, ended};
use crate::error::{Exit, Failure, Result, shortened};
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// What a study of the capability goes by.
#[derive(Clone, Debug)]
pub struct CapabilityLimits {
    /// The step of the values; 0 if it is not known.
    pub resolution: f64,
    /// u_CAL, the standard uncertainty of the reference.
    pub u_reference: f64,
    /// Further standard uncertainties.
    pub u_others: Vec<f64>,
    /// Share of T that the gauge may take, %.
    pub share: f64,
    /// Widths in s that must fit into it.
    pub spread: f64,
    /// The least C_g.
    pub cg: f64,
    /// The least C_gk.
    pub cgk: f64,
    /// The most Q_MS, %.
    pub q_ms: f64,
}

impl CapabilityLimits {
    /// Those of ISO 22514-7, of a reference that is known exactly.
    pub const USUAL: Self = Self {
        resolution: 0.0,
        u_reference: 0.0,
        u_others: Vec::new(),
        share: 20.0,
        spread: 6.0,
        cg: 1.33,
        cgk: 1.33,
        q_ms: 15.0,
    };
}

/// The capability of a gauge. What cannot be formed is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GaugeCapability {
    /// What was measured.
    pub characteristic: String,
    /// Its unit.
    pub unit: String,
    /// How many values.
    pub n: usize,
    /// The reference part's value.
    pub reference: f64,
    /// T.
    pub tolerance: f64,
    /// x̄.
    pub mean: f64,
    /// x̄ − reference.
    pub bias: f64,
    /// Its 95 % interval.
    pub bias_interval: Option<[f64; 2]>,
    /// Of so large a bias if there is none.
    pub bias_p: Option<f64>,
    /// Degrees of freedom of s.
    pub df: f64,
    /// Standard deviation.
    pub s: Option<f64>,
    /// C_g.
    pub cg: Option<f64>,
    /// C_gk.
    pub cgk: Option<f64>,
    /// u_CAL.
    pub u_cal: f64,
    /// u_RE.
    pub u_re: f64,
    /// u_EVR.
    pub u_evr: Option<f64>,
    /// u_BI.
    pub u_bi: f64,
    /// U_MS.
    pub u_ms: Option<f64>,
    /// Q_MS, %.
    pub q_ms: Option<f64>,
    /// What was predicted.
    pub prediction: Option<Prediction>,
    /// The verdict.
    pub judgement: Judgement,
}

/// The expanded uncertainty of independent standard uncertainties.
pub fn expanded(u: impl IntoIterator<Item = f64>) -> f64 {
    2.0 * u.into_iter().map(|u| u * u).sum::<f64>().sqrt()
}

impl GaugeCapability {
    /// By the values of one part, which is known to have the value `reference`, for a characteristic of this tolerance T.
    ///
    /// # Errors
    /// There are no values, or those of several parts.
    pub fn of(
        measured: &Characteristic,
        reference: Decimal,
        tolerance: f64,
        limits: &CapabilityLimits,
    ) -> Result<Self> {
        let readings = &measured.readings;
        let Some(first) = readings.first() else {
            let words = format!("{} has no values", shortened(&measured.name));
            return Exit::Content.fail(words + ": measure one part 25 to 50 times");
        };
        if let Some(other) = readings.iter().find(|other| other.part != first.part) {
            let what = format!(
                "the capability of a gauge is that of one part, and there are {:?} and {:?}",
                first.part, other.part
            );
            return Err(Failure::because(
                Exit::Content,
                what,
                "keep the rows of one part, or run fringed study grr",
            ));
        }
        let (first, offsets) = offsets(readings.iter().map(|reading| reading.value));
        let spread = Spread::of(&offsets);
        let (n, df) = (spread.n as f64, spread.df());
        let (s, bias) = (spread.s(), first.minus(reference) + spread.mean);
        let error = s.map(|s| s / n.sqrt());
        let scattering = s.filter(|s| *s > 0.0);
        let [u_re, u_bi] = [limits.resolution / 12_f64.sqrt(), bias.abs() / 3_f64.sqrt()];
        let u_ms = s.map(|s| {
            let all = [limits.u_reference, u_re.max(s), u_bi].into_iter();
            expanded(all.chain(limits.u_others.iter().copied()))
        });
        let half = |s: f64| limits.spread / 2.0 * s;
        let cg = scattering.map(|s| limits.share / 100.0 * tolerance / (limits.spread * s));
        let cgk = scattering.map(|s| (limits.share / 200.0 * tolerance - bias.abs()) / half(s));
        let q_ms = u_ms.map(|u| 100.0 * 2.0 * u / tolerance);
        let judgement = Judgement::default()
            .least("C_g", cg, limits.cg)
            .least("C_gk", cgk, limits.cgk)
            // With no scatter at all it says nothing of the gauge.
            .most(
                "Q_MS",
                q_ms.filter(|_| scattering.is_some()),
                limits.q_ms,
                limits.q_ms,
            );
        let t = error.map(|error| distribution::t_quantile(Tail::Upper(0.025), df) * error);
        let beyond = error.and_then(|error| defined(bias / error));
        Ok(Self {
            characteristic: measured.name.clone(),
            unit: measured.unit.clone(),
            n: spread.n,
            reference: reference.to_f64(),
            tolerance,
            mean: first.to_f64() + spread.mean,
            bias,
            bias_interval: t.map(|t| [bias - t, bias + t]),
            bias_p: beyond.map(|t| 2.0 * distribution::t(t.abs(), df).upper),
            df,
            s,
            cg,
            cgk,
            u_cal: limits.u_reference,
            u_re,
            u_evr: s,
            u_bi,
            u_ms,
            q_ms,
            prediction: Prediction::of(readings, s, df),
            judgement,
        })
    }
}

impl Display for GaugeCapability {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: capability of the gauge, {} values of one part, T {}",
            titled(&self.characteristic, &self.unit),
            self.n,
            short(self.tolerance)
        )?;
        let [low, high] = self
            .bias_interval
            .map_or([None; 2], |bounds| bounds.map(Some));
        writeln!(
            f,
            "  mean {}  reference {}  s {}",
            rounded(self.mean, 10),
            rounded(self.reference, 10),
            shown(self.s)
        )?;
        writeln!(
            f,
            "  bias {}, 95 % {} to {}, p {}",
            short(self.bias),
            shown(low),
            shown(high),
            shown(self.bias_p)
        )?;
        writeln!(f, "  C_g {}  C_gk {}", shown(self.cg), shown(self.cgk))?;
        writeln!(
            f,
            "  u_CAL {}  u_RE {}  u_EVR {}  u_BI {}  U_MS {}  Q_MS {} %",
            short(self.u_cal),
            short(self.u_re),
            shown(self.u_evr),
            short(self.u_bi),
            shown(self.u_ms),
            shown(self.q_ms)
        )?;
        ended(f, self.prediction.as_ref(), "s", &self.judgement)
    }
}
