//! The plot of run time against error: every point, and the Pareto front.

use super::point::{Point, means};
use super::report::Report;
use crate::plot::{Kind, Plot, Series};

/// A colour for each implementation, in the order in which they first appear.
const COLOURS: [&str; 5] = ["#9ca3af", "#c2410c", "#7c3aed", "#1f5fa8", "#0e7490"];
const FRONT: &str = "#15803d";
/// A point is on the front if its error is at least this much smaller than that of every faster
/// one.
const SMALLER: f64 = 0.995;

impl Report {
    /// File names and contents of the plots: run time against error, as SVG and PNG.
    pub fn figures(&self) -> Vec<(String, Vec<u8>)> {
        let Some(points) = &self.accuracy else {
            return Vec::new();
        };
        let plot = plot(&means(points), &self.machine.processor);
        vec![
            ("accuracy.svg".into(), plot.svg().into_bytes()),
            ("accuracy.png".into(), plot.png()),
        ]
    }
}

fn plot(means: &[Point], machine: &str) -> Plot {
    let mut names: Vec<&str> = Vec::new();
    for point in means {
        if !names.contains(&point.implementation) {
            names.push(point.implementation);
        }
    }
    let front = front(means);
    let mut series: Vec<Series> = names
        .into_iter()
        .zip(COLOURS.iter().cycle())
        .map(|(name, colour)| {
            let of = |point: &&Point| point.implementation == name && !front.contains(point);
            let place = |point: &Point| (point.ns_per_px, point.rms_mm, String::new());
            Series {
                name: name.to_owned(),
                colour,
                kind: Kind::Dots,
                points: means.iter().filter(of).map(place).collect(),
            }
        })
        .collect();
    series.push(Series {
        name: "Pareto front".into(),
        colour: FRONT,
        kind: Kind::Line,
        points: front
            .iter()
            .map(|point| (point.ns_per_px, point.rms_mm, label(point)))
            .collect(),
    });
    Plot {
        title: format!("Run time against error, mean over the parts; {machine}"),
        x_label: "processor time of the decoding, ns per pixel",
        y_label: "RMS error of the height, mm",
        log_x: true,
        from_zero: true,
        series,
    }
}

fn label(point: &Point) -> String {
    let Point {
        sequence,
        frames,
        bits,
        implementation,
        ..
    } = point;
    let skipping = if point.skipping { ", skipping" } else { "" };
    format!("{sequence}-{frames}, {bits} bit, {implementation}{skipping}")
}

/// The Pareto front, from fast to slow: no other point is both faster and more accurate.
fn front(points: &[Point]) -> Vec<&Point> {
    let mut sorted: Vec<&Point> = points.iter().filter(|point| point.rms_mm > 0.0).collect();
    sorted.sort_by(|a, b| a.ns_per_px.total_cmp(&b.ns_per_px));
    let mut front: Vec<&Point> = Vec::new();
    for point in sorted {
        if front
            .last()
            .is_none_or(|best| point.rms_mm < SMALLER * best.rms_mm)
        {
            front.push(point);
        }
    }
    front
}
