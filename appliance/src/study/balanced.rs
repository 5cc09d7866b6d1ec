//! The balanced table of a Gage R&R, parts × appraisers × trials, and its sums of squares.

use super::decimal::Decimal;
use super::distribution;
use super::spread::{Spread, defined, more_than_rounding, offsets};
use super::values::{Characteristic, Reading};
use crate::error::{Exit, Failure, Result, shortened};
use std::collections::{BTreeMap, HashMap};

/// The values of a balanced study.
pub struct Balanced<'a> {
    /// Names, in the order in which they come.
    pub parts: Vec<&'a str>,
    /// The same.
    pub appraisers: Vec<&'a str>,
    /// By part, then appraiser.
    pub cells: Vec<Vec<&'a Reading>>,
}

/// The place of a name, in the order in which they come.
fn place<'a>(
    names: &mut Vec<&'a str>,
    known: &mut HashMap<&'a str, usize>,
    name: &'a str,
) -> usize {
    *known.entry(name).or_insert_with(|| {
        names.push(name);
        names.len() - 1
    })
}

impl<'a> Balanced<'a> {
    /// Of one characteristic.
    ///
    /// # Errors
    /// The table is not balanced, or too small: with the name of what is missing.
    pub fn of(measured: &'a Characteristic) -> Result<Self> {
        let name = shortened(&measured.name);
        let refused = |what: String, remedy: &str| {
            Failure::because(Exit::Content, format!("{name}: {what}"), remedy)
        };
        let (mut parts, mut appraisers) = (Vec::new(), Vec::new());
        let [mut part_places, mut appraiser_places] = [HashMap::new(), HashMap::new()];
        let placed: Vec<_> = measured
            .readings
            .iter()
            .map(|reading| {
                let part = place(&mut parts, &mut part_places, &reading.part);
                (
                    part,
                    place(&mut appraisers, &mut appraiser_places, &reading.appraiser),
                    reading,
                )
            })
            .collect();
        if parts.len() < 2 {
            return Err(refused(
                format!(
                    "a Gage R&R needs two parts or more, there is {}",
                    parts.len()
                ),
                "name them in the column part",
            ));
        }
        // By part, then appraiser. Of a table with gaps only what is there takes memory.
        let mut table = BTreeMap::<usize, Vec<&Reading>>::new();
        let mut trials = HashMap::new();
        for (part, appraiser, reading) in placed {
            let cell = part * appraisers.len() + appraiser;
            table.entry(cell).or_default().push(reading);
            if reading.trial.is_empty() {
                continue;
            }
            if let Some(before) = trials.insert((cell, &*reading.trial), reading.at) {
                let (cell, trial) = (words(parts[part], appraisers[appraiser]), &reading.trial);
                let what = format!(
                    "{cell} trial {trial} is there twice, at {before} and {}",
                    reading.at
                );
                return Err(refused(what, "leave one of them out"));
            }
        }
        let most = table.values().map(Vec::len).max().unwrap_or(0);
        let has = |cell: &usize| table.get(cell).map_or(0, Vec::len);
        let all = parts.len() * appraisers.len();
        if let Some(short) = (0..all).find(|cell| has(cell) < most) {
            let (part, appraiser) = (short / appraisers.len(), short % appraisers.len());
            let (cell, has) = (words(parts[part], appraisers[appraiser]), has(&short));
            return Err(refused(
                format!("{cell} has {has} trials, others have {most}"),
                "measure what is missing, or leave the part or appraiser out: the analysis needs a balanced table",
            ));
        }
        if most < 2 {
            return Err(refused(
                "there is one trial of each part".into(),
                "measure each part twice or more",
            ));
        }
        Ok(Self {
            parts,
            appraisers,
            cells: table.into_values().collect(),
        })
    }
}

fn words(part: &str, appraiser: &str) -> String {
    match appraiser {
        "" => format!("part {}", shortened(part)),
        _ => format!(
            "part {}, appraiser {}",
            shortened(part),
            shortened(appraiser)
        ),
    }
}

/// Sums of squares and degrees of freedom.
pub struct Sums {
    /// Of parts.
    pub parts: [f64; 2],
    /// Of appraisers.
    pub appraisers: [f64; 2],
    /// Of the two together.
    pub interaction: [f64; 2],
    /// Of repeated values.
    pub error: [f64; 2],
    /// Mean of all, about the first value.
    pub mean: f64,
}

/// A mean square; none without degrees of freedom.
pub fn ms([ss, df]: [f64; 2]) -> Option<f64> {
    defined(ss / df)
}

impl Sums {
    /// Of the offsets from the first value.
    pub fn of(study: &Balanced<'_>, first: Decimal) -> Self {
        let (p, o) = (study.parts.len(), study.appraisers.len());
        let cells = study.cells.iter().map(|cell| {
            let (base, offsets) = offsets(cell.iter().map(|reading| reading.value));
            let spread = Spread::of(&offsets);
            (base.minus(first) + spread.mean, spread.squares)
        });
        let (cells, within): (Vec<f64>, Vec<f64>) = cells.unzip();
        let trials = study.cells.first().map_or(0, Vec::len) as f64;
        let largest = cells
            .iter()
            .fold(0.0, |most: f64, mean| most.max(mean.abs()));
        let mean = |means: &[f64]| Spread::of(means).mean;
        let of_part: Vec<f64> = cells.chunks(o).map(mean).collect();
        let of_appraiser: Vec<f64> = (0..o)
            .map(|at| {
                let column: Vec<f64> = cells.iter().skip(at).step_by(o).copied().collect();
                mean(&column)
            })
            .collect();
        let all = mean(&of_part);
        let between = |means: &[f64], each: f64| {
            let squares = means.iter().map(|x| (x - all) * (x - all)).sum();
            each * more_than_rounding(squares, means.len(), largest)
        };
        let rest = cells
            .iter()
            .enumerate()
            .map(|(at, x)| x - of_part[at / o] - of_appraiser[at % o] + all);
        let rest = more_than_rounding(rest.map(|x| x * x).sum(), cells.len(), largest);
        let [pf, of] = [p, o].map(|count| count as f64);
        Self {
            parts: [between(&of_part, of * trials), pf - 1.0],
            appraisers: [between(&of_appraiser, pf * trials), of - 1.0],
            interaction: [trials * rest, (pf - 1.0) * (of - 1.0)],
            error: [within.iter().sum(), pf * of * (trials - 1.0)],
            mean: all,
        }
    }

    /// F of a mean square over another one, and its p.
    pub fn test(of: [f64; 2], over: [f64; 2]) -> (Option<f64>, Option<f64>) {
        let ratio = ms(of)
            .zip(ms(over))
            .and_then(|(of, over)| defined(of / over));
        (
            ratio,
            ratio.map(|ratio| distribution::f(ratio, of[1], over[1]).upper),
        )
    }
}
