//! Gage R&R: what of the scatter of values is the gauge's, by an analysis of variance.
//!
//! **Crossed**, p parts × o appraisers × r trials, with mean squares of the balanced two-way table. With the interaction,
//!
//! ```text
//! F_PO = MS_PO / MS_E              (p−1)(o−1) and po(r−1) degrees of freedom
//! EV² = MS_E   PO² = (MS_PO − MS_E)/r   O² = (MS_O − MS_PO)/pr   PV² = (MS_P − MS_PO)/or
//! ```
//!
//! and where its p is above a bound, the pooled MS_E′ = (SS_PO + SS_E)/(por − p − o + 1) takes the place of both.
//! **One-way**, p parts × r placements, as an inline station has it: EV² = MS_E, PV² = (MS_P − MS_E)/r.
//!
//! ```text
//! AV² = O² + PO²   GRR² = EV² + AV²   TV² = GRR² + PV²          negative components are 0
//! % of study = σ/TV    % of tolerance = 6σ/T, or 3σ over the distance of the mean from the only limit
//! ndc = ⌊1.41 PV/GRR⌋       U_MP = 2 √(u_CAL² + max(u_RE², EV²) + O² + PO² + …)      Q_MP = 2 U_MP / T
//! ```
//!
//! Sources: AIAG, *Measurement Systems Analysis*, 4th edition, 2010; Q_MP: ISO 22514-7 and VDA 5.

use super::balanced::{Balanced, Sums, ms};
use super::capability::expanded;
use super::decimal::Decimal;
use super::distribution::{self, Tail};
use super::spread::defined;
use super::text::{rounded, short, shown, titled};
use super::values::Characteristic;
use super::verdict::{Judgement, Prediction, ended};
use crate::error::{Exit, Failure, Result, shortened};
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// What a Gage R&R goes by.
#[derive(Clone, Debug)]
pub struct StudyLimits {
    /// Lower limit of the characteristic, instead of that of the file.
    pub low: Option<Decimal>,
    /// Upper limit.
    pub high: Option<Decimal>,
    /// The interaction is pooled where its p is above this.
    pub pool: f64,
    /// The step of the values; 0 if it is not known.
    pub resolution: f64,
    /// Further standard uncertainties of U_MP.
    pub u_others: Vec<f64>,
    /// Fit up to this GRR, %.
    pub fit: f64,
    /// Fit with conditions up to this GRR, %.
    pub conditions: f64,
    /// The least ndc.
    pub ndc: f64,
    /// The most Q_MP, %.
    pub q_mp: f64,
}

impl StudyLimits {
    /// Those of the AIAG and of ISO 22514-7.
    pub const USUAL: Self = Self {
        low: None,
        high: None,
        pool: 0.25,
        resolution: 0.0,
        u_others: Vec::new(),
        fit: 10.0,
        conditions: 30.0,
        ndc: 5.0,
        q_mp: 30.0,
    };
}

/// A row of the table of the analysis of variance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VarianceRow {
    /// What varies.
    pub source: &'static str,
    /// Sum of squares.
    pub ss: f64,
    /// Degrees of freedom.
    pub df: f64,
    /// Mean square.
    pub ms: Option<f64>,
    /// Over the mean square of what it is compared with.
    pub f: Option<f64>,
    /// Of so large an F by chance.
    pub p: Option<f64>,
}

/// A component of the variance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VarianceComponent {
    /// Its abbreviation.
    pub name: &'static str,
    /// σ².
    pub variance: f64,
    /// σ.
    pub sigma: f64,
    /// % of the study's variation.
    pub of_study: Option<f64>,
    /// % of the tolerance.
    pub of_tolerance: Option<f64>,
}

/// A Gage R&R. What cannot be formed is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeatability {
    /// What was measured.
    pub characteristic: String,
    /// Its unit.
    pub unit: String,
    /// `crossed` or `one-way`.
    pub design: &'static str,
    /// p.
    pub parts: usize,
    /// o.
    pub appraisers: usize,
    /// r.
    pub trials: usize,
    /// Mean of all values.
    pub mean: f64,
    /// The analysis of variance as computed, before anything is pooled.
    pub anova: Vec<VarianceRow>,
    /// Whether the interaction was pooled.
    pub pooled: bool,
    /// Which model was taken and why.
    pub model: String,
    /// Degrees of freedom of EV.
    pub ev_df: f64,
    /// The 95 % interval of EV.
    pub ev_interval: Option<[f64; 2]>,
    /// EV, AV, O, PO, GRR, PV, TV.
    pub components: Vec<VarianceComponent>,
    /// T, or twice the distance of the mean from the only limit.
    pub tolerance: Option<f64>,
    /// Distinct categories.
    pub ndc: Option<f64>,
    /// The same before it is rounded down.
    pub ndc_unrounded: Option<f64>,
    /// U_MP.
    pub u_mp: Option<f64>,
    /// Q_MP, %.
    pub q_mp: Option<f64>,
    /// What was predicted.
    pub prediction: Option<Prediction>,
    /// How many results were left out.
    pub left_out: super::values::LeftOut,
    /// The verdict.
    pub judgement: Judgement,
}

impl Repeatability {
    /// Of one characteristic.
    ///
    /// # Errors
    /// The table of parts, appraisers and trials is not balanced, or too small: with the name of what is missing.
    pub fn of(measured: &Characteristic, limits: &StudyLimits) -> Result<Self> {
        let study = Balanced::of(measured)?;
        let readings = &measured.readings;
        let first = readings
            .first()
            .map(|reading| reading.value)
            .unwrap_or_default();
        let sums = Sums::of(&study, first);
        let [p, o, r] = [
            study.parts.len(),
            study.appraisers.len(),
            study.cells.first().map_or(0, Vec::len),
        ];
        let is_crossed = o > 1;
        let (f_po, p_po) = Sums::test(sums.interaction, sums.error);
        let pooled = is_crossed && p_po.is_some_and(|p| p > limits.pool);
        let joint = [
            sums.interaction[0] + sums.error[0],
            sums.interaction[1] + sums.error[1],
        ];
        let error = if pooled { joint } else { sums.error };
        let over = if pooled || !is_crossed {
            error
        } else {
            sums.interaction
        };
        let row = |source, [ss, df]: [f64; 2], (f, p)| VarianceRow {
            source,
            ss,
            df,
            ms: ms([ss, df]),
            f,
            p,
        };
        let mut anova = vec![row("parts", sums.parts, Sums::test(sums.parts, over))];
        if is_crossed {
            anova.push(row(
                "appraisers",
                sums.appraisers,
                Sums::test(sums.appraisers, over),
            ));
            anova.push(row("parts × appraisers", sums.interaction, (f_po, p_po)));
        }
        anova.push(row("repeatability", sums.error, (None, None)));
        let total = anova
            .iter()
            .fold([0.0; 2], |[ss, df], row| [ss + row.ss, df + row.df]);
        anova.push(VarianceRow {
            ms: None,
            ..row("total", total, (None, None))
        });
        let pool = limits.pool;
        let model = match (is_crossed, pooled, p_po) {
            (false, ..) => "one-way: one appraiser, so no reproducibility".into(),
            (_, true, Some(p)) => format!("interaction pooled: its p {} is above {pool}", short(p)),
            (_, false, Some(p)) => {
                format!("interaction kept: its p {} is not above {pool}", short(p))
            }
            (.., None) => {
                "interaction kept: repeated values are all equal, so its F is not defined".into()
            }
        };
        // Neither has no degree of freedom: there are two parts and two trials or more.
        let [ms_e, ms_over, ms_p, ms_o] =
            [error, over, sums.parts, sums.appraisers].map(|sum| ms(sum).unwrap_or(0.0));
        let [pf, of, rf] = [p, o, r].map(|count| count as f64);
        let ev = ms_e;
        let po = ((ms_over - ms_e) / rf).max(0.0);
        let by_appraisers = if is_crossed {
            ((ms_o - ms_over) / (pf * rf)).max(0.0)
        } else {
            0.0
        };
        let pv = ((ms_p - ms_over) / (of * rf)).max(0.0);
        let (av, grr) = (by_appraisers + po, ev + by_appraisers + po);
        let (low, high) = agreed_limits(measured, limits)?;
        let distance = |limit: Decimal, sign: f64| sign * (limit.minus(first) - sums.mean);
        let tolerance = match (low, high) {
            (Some(low), Some(high)) => Some(high.minus(low)),
            (Some(low), None) => Some(2.0 * distance(low, -1.0)),
            (None, Some(high)) => Some(2.0 * distance(high, 1.0)),
            (None, None) => None,
        };
        let tolerance = tolerance.filter(|tolerance| *tolerance > 0.0);
        let component = |name, variance: f64| VarianceComponent {
            name,
            variance,
            sigma: variance.sqrt(),
            of_study: defined(100.0 * (variance / (grr + pv)).sqrt()),
            of_tolerance: tolerance.map(|tolerance| 600.0 * variance.sqrt() / tolerance),
        };
        let mut components = vec![component("EV", ev)];
        if is_crossed {
            components.extend([
                component("AV", av),
                component("O", by_appraisers),
                component("PO", po),
            ]);
        }
        components.extend([
            component("GRR", grr),
            component("PV", pv),
            component("TV", grr + pv),
        ]);
        let ndc_unrounded = defined(1.41 * (pv / grr).sqrt());
        let ndc = ndc_unrounded.map(f64::floor);
        let both = low.and(high).and(tolerance);
        let u_re = limits.resolution / 12_f64.sqrt();
        let u_mp = expanded(
            [u_re.max(ev.sqrt()), av.sqrt()]
                .into_iter()
                .chain(limits.u_others.iter().copied()),
        );
        let q_mp = both.map(|tolerance| 200.0 * u_mp / tolerance);
        // Values that never differ say nothing of a gauge.
        let scatters = grr > 0.0;
        let figure = |value: Option<f64>| value.filter(|_| scatters);
        let gauge = component("GRR", grr);
        let (named, share) = match low.or(high) {
            Some(_) => ("GRR of tolerance", gauge.of_tolerance),
            None => ("GRR of study", gauge.of_study),
        };
        let mut judgement = Judgement::default()
            .most(named, figure(share), limits.fit, limits.conditions)
            .least("ndc", figure(ndc), limits.ndc);
        if both.is_some() {
            judgement = judgement.most("Q_MP", figure(q_mp), limits.q_mp, limits.q_mp);
        }
        let df = error[1];
        let bound = |tail| (error[0] / distribution::chi_squared_quantile(tail, df)).sqrt();
        Ok(Self {
            characteristic: measured.name.clone(),
            unit: measured.unit.clone(),
            design: if is_crossed { "crossed" } else { "one-way" },
            parts: p,
            appraisers: o,
            trials: r,
            mean: first.to_f64() + sums.mean,
            anova,
            pooled,
            model,
            ev_df: df,
            ev_interval: (ev > 0.0).then(|| [bound(Tail::Upper(0.025)), bound(Tail::Lower(0.025))]),
            components,
            tolerance,
            ndc,
            ndc_unrounded,
            u_mp: Some(u_mp).filter(|_| scatters),
            q_mp,
            prediction: Prediction::of(readings, Some(ev.sqrt()), df),
            left_out: measured.left_out,
            judgement,
        })
    }
}

/// The limits that were asked for, else those by which all values were judged.
fn agreed_limits(
    measured: &Characteristic,
    asked: &StudyLimits,
) -> Result<(Option<Decimal>, Option<Decimal>)> {
    if asked.low.or(asked.high).is_some() {
        return Ok((asked.low, asked.high));
    }
    let mut limits = measured
        .readings
        .iter()
        .map(|reading| (reading.low, reading.high));
    let first = limits.next().unwrap_or_default();
    if limits.any(|other| other != first) {
        let what = format!(
            "{}: values were judged by different limits",
            shortened(&measured.name)
        );
        return Err(Failure::because(
            Exit::Content,
            what,
            "name those of the study with --low and --high",
        ));
    }
    Ok(first)
}

impl Display for Repeatability {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let by = if self.appraisers > 1 {
            format!("{} appraisers × ", self.appraisers)
        } else {
            String::new()
        };
        writeln!(
            f,
            "{}: Gage R&R, {}, {} parts × {by}{} trials, mean {}",
            titled(&self.characteristic, &self.unit),
            self.design,
            self.parts,
            self.trials,
            rounded(self.mean, 10)
        )?;
        writeln!(
            f,
            "  {:<20} {:>6} {:>12} {:>12} {:>10} {:>10}",
            "source", "df", "SS", "MS", "F", "p"
        )?;
        for row in &self.anova {
            let [ms, test, p] =
                [row.ms, row.f, row.p].map(|figure| figure.map_or("".into(), short));
            writeln!(
                f,
                "  {:<20} {:>6} {:>12} {ms:>12} {test:>10} {p:>10}",
                row.source,
                row.df,
                short(row.ss)
            )?;
        }
        writeln!(f, "  {}", self.model)?;
        let of_tolerance = if self.tolerance.is_some() {
            "% of tolerance"
        } else {
            ""
        };
        writeln!(
            f,
            "  {:<20} {:>12} {:>12} {of_tolerance:>14}",
            "component", "σ", "% of study"
        )?;
        for component in &self.components {
            let (sigma, study) = (short(component.sigma), shown(component.of_study));
            let tolerance = component.of_tolerance.map_or(String::new(), short);
            writeln!(
                f,
                "  {:<20} {sigma:>12} {study:>12} {tolerance:>14}",
                component.name
            )?;
        }
        let [low, high] = self
            .ev_interval
            .map_or([None; 2], |bounds| bounds.map(Some));
        writeln!(
            f,
            "  EV 95 % {} to {}  ndc {} ({})",
            shown(low),
            shown(high),
            shown(self.ndc),
            shown(self.ndc_unrounded)
        )?;
        if let Some(q_mp) = self.q_mp {
            writeln!(f, "  U_MP {}  Q_MP {} %", shown(self.u_mp), short(q_mp))?;
        }
        ended(f, self.prediction.as_ref(), "EV", &self.judgement)
    }
}
