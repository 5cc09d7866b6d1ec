//! The results of the runs: one row per run as CSV, and their means over the noise seeds.

use super::compared::{Judged, Method, OpticsKind, PAPER, Scene};
use serde::Serialize;
use std::fmt::Write as _;

/// Columns of `experiments.csv`.
pub const HEADER: &str = "part,optics,method,frames,seed,scored_px,lit_px,unresolved_px,gross_px,\
    rms_mm,bias_mm,median_mm,p99_mm,error_over_sigma,ratio_to_paper,coverage,fit_residual_mm,\
    fit_radius_mm";

/// A run, or the mean of some.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunRow {
    /// Name of the part.
    pub part: &'static str,
    /// Word of the optics.
    pub optics: &'static str,
    /// Name of the method.
    pub method: String,
    /// Frames of its measurement.
    pub frames: usize,
    /// Noise seed; 0 = the mean over all.
    pub seed: u64,
    /// The measured quantities.
    #[serde(flatten)]
    pub values: Values,
}

/// Number of measured quantities of a row.
const QUANTITIES: usize = 13;

/// A struct of `f64` that can also be had as an array, in the order of its fields.
macro_rules! quantities {
    ($(#[$about:meta])* $name:ident { $($(#[$what:meta])* $field:ident,)* }) => {
        $(#[$about])*
        pub struct $name {
            $($(#[$what])* pub $field: f64,)*
        }

        impl $name {
            fn array(&self) -> [f64; QUANTITIES] {
                [$(self.$field),*]
            }

            fn from_array([$($field),*]: [f64; QUANTITIES]) -> Self {
                Self { $($field),* }
            }
        }
    };
}

quantities! {
    /// The measured quantities of a row; NaN where there is no value (an empty cell in CSV, null in
    /// JSON).
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    Values {
        /// Resolved pixels that truth calls wholly lit.
        scored_px,
        /// Pixels that truth calls wholly lit.
        lit_px,
        /// Pixels that truth calls wholly lit and that are not resolved.
        unresolved_px,
        /// Errors above 1 mm.
        gross_px,
        /// RMS error without gross errors, mm.
        rms_mm,
        /// Mean error without gross errors, mm.
        bias_mm,
        /// Median of |e|, mm.
        median_mm,
        /// 99 % of |e| lie below this, mm.
        p99_mm,
        /// RMS of error / σ_z.
        error_over_sigma,
        /// RMS error as a share of the paper's adaptive run (p_I = 5) with the same noise seed.
        ratio_to_paper,
        /// Resolved share of the lit pixels.
        coverage,
        /// RMS distance from the fitted cylinder, mm.
        fit_residual_mm,
        /// Radius of the fitted cylinder, mm.
        fit_radius_mm,
    }
}

impl RunRow {
    /// The row of one run.
    pub fn new(
        scene: &Scene,
        optics: OpticsKind,
        method: Method,
        seed: u64,
        values: Values,
    ) -> Self {
        Self {
            part: scene.name,
            optics: optics.word(),
            method: method.name(),
            frames: method.frame_count(),
            seed,
            values,
        }
    }

    /// A line of the CSV; an empty cell where there is no value.
    fn line(&self) -> String {
        let mut line = format!(
            "{},{},{},{},{}",
            self.part, self.optics, self.method, self.frames, self.seed
        );
        for (at, value) in self.values.array().iter().enumerate() {
            // Writing to a string does not fail. The first four are counts.
            let _ = match value {
                value if value.is_nan() => write!(line, ","),
                value if at < 4 => write!(line, ",{value:.0}"),
                value => write!(line, ",{value:.6}"),
            };
        }
        line
    }
}

/// Fills in the ratio to the paper's run of the same part, optics and seed.
pub fn set_ratios(rows: &mut [RunRow]) {
    let paper: Vec<RunRow> = rows
        .iter()
        .filter(|row| row.method == PAPER.name())
        .cloned()
        .collect();
    for row in rows {
        let same = paper
            .iter()
            .find(|p| (p.part, p.optics, p.seed) == (row.part, row.optics, row.seed));
        row.values.ratio_to_paper = same.map_or(f64::NAN, |p| row.values.rms_mm / p.values.rms_mm);
    }
}

/// All runs as CSV.
pub fn csv(rows: &[RunRow]) -> String {
    let lines = rows.iter().map(RunRow::line);
    let mut text = HEADER.to_owned();
    for line in lines {
        text.push('\n');
        text.push_str(&line);
    }
    text.push('\n');
    text
}

/// The means over the seeds, in the order of the first runs.
pub fn means(rows: &[RunRow]) -> Vec<RunRow> {
    let mut means: Vec<(RunRow, [f64; QUANTITIES], f64)> = Vec::new();
    for row in rows {
        let known = means.iter_mut().find(|(mean, ..)| {
            (mean.part, mean.optics, &mean.method) == (row.part, row.optics, &row.method)
        });
        let values = row.values.array();
        match known {
            Some((_, sums, count)) => {
                *count += 1.0;
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += value;
                }
            }
            None => means.push((row.clone(), values, 1.0)),
        }
    }
    means
        .into_iter()
        .map(|(row, sums, count)| RunRow {
            seed: 0,
            values: Values::from_array(sums.map(|sum| sum / count)),
            ..row
        })
        .collect()
}

/// The means of one part under one optics, as a table for people.
pub fn table(scene: &Scene, means: &[&RunRow]) -> String {
    let fitted = scene.judged == Judged::CylinderFit;
    let optics = means.first().map_or("", |row| row.optics);
    let mut text = format!(
        "{}, {}, {optics} optics\n{:<10} {:>8} {:>10} {:>7} {:>8} {:>9} {:>8}",
        scene.name,
        scene.figure,
        "method",
        "RMS mm",
        "unresolved",
        "gross",
        "error/σ",
        "× paper",
        "coverage"
    );
    if fitted {
        text.push_str("   fit mm  radius mm");
    }
    for row in means {
        let v = &row.values;
        let _ = write!(
            text,
            "\n{:<10} {:>8.4} {:>10.0} {:>7.0} {:>8.3} {:>9.3} {:>7.2}%",
            row.method,
            v.rms_mm,
            v.unresolved_px,
            v.gross_px,
            v.error_over_sigma,
            v.ratio_to_paper,
            100.0 * v.coverage
        );
        if fitted {
            let _ = write!(
                text,
                " {:>8.4} {:>10.3}",
                v.fit_residual_mm, v.fit_radius_mm
            );
        }
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, seed: u64, rms_mm: f64) -> RunRow {
        let mut values = [1.0; QUANTITIES];
        values[4] = rms_mm;
        values[11] = f64::NAN;
        RunRow {
            part: "cone",
            optics: "sharp",
            method: method.to_owned(),
            frames: 12,
            seed,
            values: Values::from_array(values),
        }
    }

    #[test]
    fn ratios_refer_to_the_same_seed_and_means_keep_the_order() {
        let mut rows = [
            row("fixed-49", 1, 0.2),
            row("paper-5", 1, 0.1),
            row("fixed-49", 2, 0.9),
            row("paper-5", 2, 0.3),
        ];
        set_ratios(&mut rows);
        let ratios = rows.each_ref().map(|row| row.values.ratio_to_paper);
        assert!((ratios[0] - 2.0).abs() < 1e-9 && (ratios[2] - 3.0).abs() < 1e-9);
        let means = means(&rows);
        assert_eq!(means[0].method, "fixed-49");
        assert!((means[0].values.rms_mm - 0.55).abs() < 1e-9);
        assert!((means[1].values.ratio_to_paper - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_line_has_a_cell_for_each_column_and_an_empty_one_for_no_value() {
        let line = row("fixed-49", 1, 0.2).line();
        assert_eq!(line.split(',').count(), HEADER.split(',').count());
        assert!(line.ends_with(",,1.000000"), "{line}");
    }
}
