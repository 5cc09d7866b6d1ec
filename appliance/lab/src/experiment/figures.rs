//! The figures of the experiments: what is plotted for each part.

use super::scenes::{Judged, Scene};
use super::table::RunRow;
use crate::plot::{Kind, Plot, Series};

const FIXED: &str = "#1f5fa8";
const PAPER: &str = "#c2410c";
const BETTER: &str = "#15803d";
const SECOND: &str = "#7c3aed";

/// File names and SVGs of the figures of one part, from its mean rows.
pub fn figures(scene: &Scene, means: &[RunRow]) -> Vec<(String, String)> {
    let rows: Vec<&RunRow> = means.iter().filter(|row| row.part == scene.name).collect();
    let Some(first) = rows.first() else {
        return Vec::new();
    };
    let title = format!("{}: {}, {} optics", scene.figure, scene.name, first.optics);
    let plot = match scene.judged {
        Judged::Error => Plot {
            title,
            x_label: "unresolvable pixels",
            y_label: "RMS error, mm",
            log_x: false,
            from_zero: true,
            series: errors(&rows),
        },
        Judged::Coverage => Plot {
            title,
            x_label: "fringes over the projector's width, n_F",
            y_label: "resolved share of the lit pixels, %",
            log_x: false,
            from_zero: false,
            series: over_fringes(&rows, |row| 100.0 * row.values.coverage),
        },
        Judged::CylinderFit => Plot {
            title: format!(
                "{}: {}, residual of the fitted cylinder",
                scene.figure, scene.name
            ),
            x_label: "fringes over the projector's width, n_F",
            y_label: "RMS distance from the cylinder, mm",
            log_x: false,
            from_zero: true,
            series: over_fringes(&rows, |row| row.values.fit_residual_mm),
        },
    };
    vec![(format!("{}-{}.svg", scene.name, first.optics), plot.svg())]
}

/// RMS error over unresolved pixels: the paper's way to compare patterns.
fn errors(rows: &[&RunRow]) -> Vec<Series> {
    let kinds = [
        ("fixed-", "fixed pitch, n_F", FIXED, Kind::Line, "n_F ", ""),
        (
            "paper-",
            "paper's adaptive, p_I",
            PAPER,
            Kind::Dots,
            "p_I ",
            "",
        ),
        (
            "better-",
            "better adaptive, frames",
            BETTER,
            Kind::Dots,
            "",
            " frames",
        ),
    ];
    let series = kinds.map(|(prefix, name, colour, kind, before, after)| Series {
        name: name.to_owned(),
        colour,
        kind,
        points: rows
            .iter()
            .filter_map(|row| {
                let number = row.method.strip_prefix(prefix)?;
                let label = format!("{before}{number}{after}");
                Some((row.values.unresolved_px, row.values.rms_mm, label))
            })
            .collect(),
    });
    series.into()
}

/// A quantity over the number of fringes, for each of the optics; adaptive patterns as horizontal
/// lines.
fn over_fringes(rows: &[&RunRow], quantity: fn(&RunRow) -> f64) -> Vec<Series> {
    let mut optics: Vec<&str> = rows.iter().map(|row| row.optics).collect();
    optics.dedup();
    let mut series = Vec::new();
    for (optics, colour, kind) in optics
        .iter()
        .zip([(FIXED, Kind::Line), (SECOND, Kind::Dashed)])
        .map(|(optics, (colour, kind))| (*optics, colour, kind))
    {
        let of = rows.iter().filter(|row| row.optics == optics);
        let points = of.filter_map(|row| {
            let number = row.method.strip_prefix("fixed-")?;
            Some((number.parse().ok()?, quantity(row), number.to_owned()))
        });
        series.push(Series {
            name: format!("fixed, {optics}"),
            colour,
            kind,
            points: points.collect(),
        });
    }
    for (prefix, name, colour) in [
        ("paper-5", "paper's adaptive, p_I 5", PAPER),
        ("better-12", "better adaptive, 12 frames", BETTER),
    ] {
        let of = rows.iter().filter(|row| row.method == prefix);
        let middle = |row: &&&RunRow| (MIDDLE, quantity(row), row.optics.to_owned());
        series.push(Series {
            name: name.to_owned(),
            colour,
            kind: Kind::Level,
            points: of.map(|row| middle(&row)).collect(),
        });
    }
    series
}

/// x of the points of [`Kind::Level`], within the axis of n_F; their lines are drawn over its whole
/// width.
const MIDDLE: f64 = 100.0;
