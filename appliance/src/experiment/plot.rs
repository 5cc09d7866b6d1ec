//! Plots with labelled points, as SVG.
//!
//! Own and small: a plot is a frame, ticks, and points whose labels keep clear of each other, which is
//! the one thing that plotting libraries do not do.

use std::fmt::Write as _;

/// A plot. Both axes are linear.
pub struct Plot {
    /// Above the frame.
    pub title: String,
    /// Below the frame.
    pub x_label: &'static str,
    /// Beside the frame.
    pub y_label: &'static str,
    /// Whether the y axis starts at zero.
    pub from_zero: bool,
    /// What is drawn.
    pub series: Vec<Series>,
}

/// Points of one kind.
pub struct Series {
    /// For the legend.
    pub name: String,
    /// CSS colour.
    pub colour: &'static str,
    /// How they are drawn.
    pub kind: Kind,
    /// x, y and label.
    pub points: Vec<(f64, f64, String)>,
}

/// How points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Dots joined by a line.
    Line,
    /// Dots joined by a dashed line.
    Dashed,
    /// Dots alone.
    Dots,
    /// A line over the whole width at the y of each point, for what does not depend on x.
    Level,
}

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 620.0;
const LEFT: f64 = 74.0;
const RIGHT: f64 = WIDTH - 24.0;
const TOP: f64 = 66.0;
const BOTTOM: f64 = HEIGHT - 56.0;
/// Size of labels, and the width of a letter of it.
const LABEL: f64 = 12.0;
const LETTER: f64 = 6.9;
const DOT: f64 = 4.0;

/// x from, y from, x to, y to.
type Area = [f64; 4];

impl Plot {
    /// The picture.
    pub fn svg(&self) -> String {
        let x = Axis::over(self.values(|p| p.0), false, [LEFT, RIGHT]);
        let y = Axis::over(self.values(|p| p.1), self.from_zero, [BOTTOM, TOP]);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
             viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"DejaVu Sans, Arial, sans-serif\" \
             font-size=\"{LABEL}\">\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"white\"/>\n"
        );
        text(
            &mut out,
            WIDTH / 2.0,
            22.0,
            "middle",
            "#000",
            15.0,
            &self.title,
        );
        axes(&mut out, &x, &y);
        let middle = (LEFT + RIGHT) / 2.0;
        text(
            &mut out,
            middle,
            HEIGHT - 14.0,
            "middle",
            "#000",
            13.0,
            self.x_label,
        );
        let middle = (TOP + BOTTOM) / 2.0;
        // Writing to a string does not fail, here and below.
        let _ = writeln!(
            out,
            "<text transform=\"translate(18 {middle}) rotate(-90)\" text-anchor=\"middle\" \
             font-size=\"13\">{}</text>",
            self.y_label
        );
        self.draw(&mut out, &x, &y);
        self.legend(&mut out);
        out.push_str("</svg>\n");
        out
    }

    fn values(&self, of: fn(&(f64, f64, String)) -> f64) -> Vec<f64> {
        let points = self.series.iter().flat_map(|series| &series.points);
        points.map(of).filter(|value| value.is_finite()).collect()
    }

    fn draw(&self, out: &mut String, x: &Axis, y: &Axis) {
        let mut taken: Vec<Area> = Vec::new();
        for series in &self.series {
            let colour = series.colour;
            let at: Vec<(f64, f64)> = series
                .points
                .iter()
                .map(|point| (x.at(point.0), y.at(point.1)))
                .collect();
            if series.kind == Kind::Level {
                for (_, y) in at {
                    let _ = writeln!(
                        out,
                        "<path d=\"M{LEFT} {y:.1}H{RIGHT}\" stroke=\"{colour}\" stroke-dasharray=\"7 4\" \
                         stroke-width=\"1.5\"/>"
                    );
                    block(&mut taken, (LEFT, y), (RIGHT, y));
                }
                continue;
            }
            if series.kind != Kind::Dots {
                for pair in at.windows(2) {
                    block(&mut taken, pair[0], pair[1]);
                }
                let path: Vec<String> = at.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                let dashes = match series.kind {
                    Kind::Dashed => " stroke-dasharray=\"7 4\"",
                    _ => "",
                };
                let _ = writeln!(
                    out,
                    "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\"{dashes} \
                     stroke-width=\"1.5\"/>",
                    path.join(" ")
                );
            }
            for (x, y) in at {
                let _ = writeln!(
                    out,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{DOT}\" fill=\"{colour}\"/>"
                );
                taken.push([x - DOT, y - DOT, x + DOT, y + DOT]);
            }
        }
        for series in &self.series {
            for (px, py, label) in &series.points {
                let level = series.kind == Kind::Level;
                let dot = if level {
                    (RIGHT - 8.0, y.at(*py))
                } else {
                    (x.at(*px), y.at(*py))
                };
                let (area, left) = place(dot, label, level, &taken);
                if let Some(end) = left {
                    let _ = writeln!(
                        out,
                        "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"#999\" stroke-width=\"0.8\"/>",
                        dot.0, dot.1, end.0, end.1
                    );
                }
                text(
                    out,
                    area[0],
                    area[3] - 2.5,
                    "start",
                    series.colour,
                    LABEL,
                    label,
                );
                taken.push(area);
            }
        }
    }

    fn legend(&self, out: &mut String) {
        let mut x = LEFT;
        for series in &self.series {
            let colour = series.colour;
            let _ = match series.kind {
                Kind::Level => writeln!(
                    out,
                    "<path d=\"M{x} 44h20\" stroke=\"{colour}\" stroke-dasharray=\"7 4\" \
                     stroke-width=\"1.5\"/>"
                ),
                _ => writeln!(
                    out,
                    "<circle cx=\"{}\" cy=\"44\" r=\"{DOT}\" fill=\"{colour}\"/>",
                    x + 12.0
                ),
            };
            text(out, x + 26.0, 48.0, "start", "#222", LABEL, &series.name);
            x += 40.0 + 6.4 * series.name.chars().count() as f64;
        }
    }
}

/// Keeps labels off a line.
fn block(taken: &mut Vec<Area>, from: (f64, f64), to: (f64, f64)) {
    let steps = (f64::hypot(to.0 - from.0, to.1 - from.1) / 4.0)
        .ceil()
        .max(1.0);
    for i in 0..=steps as usize {
        let share = i as f64 / steps;
        let x = from.0 + share * (to.0 - from.0);
        let y = from.1 + share * (to.1 - from.1);
        taken.push([x - 1.5, y - 1.5, x + 1.5, y + 1.5]);
    }
}

/// Where a label goes: the first place near its dot that is free; far from it with the end of a line to it.
fn place(
    (x, y): (f64, f64),
    label: &str,
    left: bool,
    taken: &[Area],
) -> (Area, Option<(f64, f64)>) {
    let width = LETTER * label.chars().count() as f64 + 2.0;
    let area = |dx: f64, dy: f64| {
        let start = x + dx;
        [
            start,
            y + dy - LABEL / 2.0 - 0.5,
            start + width,
            y + dy + LABEL / 2.0 + 1.0,
        ]
    };
    let near = [
        (8.0, 0.0),
        (-8.0 - width, 0.0),
        (7.0, -11.0),
        (7.0, 11.0),
        (-width / 2.0, -14.0),
        (-width / 2.0, 14.0),
        (-7.0 - width, -11.0),
        (-7.0 - width, 11.0),
    ];
    let order: Vec<(f64, f64)> = if left {
        let steps = (0..8).map(|i| -width - 40.0 * f64::from(i));
        steps.flat_map(|dx| [(dx, -10.0), (dx, 10.0)]).collect()
    } else {
        near.to_vec()
    };
    let free = |area: &Area| {
        let inside =
            area[0] > LEFT + 3.0 && area[2] < RIGHT - 3.0 && area[1] > TOP && area[3] < BOTTOM;
        let clear = |other: &Area| {
            area[2] <= other[0] || other[2] <= area[0] || area[3] <= other[1] || other[3] <= area[1]
        };
        inside && taken.iter().all(clear)
    };
    if let Some(found) = order.iter().map(|&(dx, dy)| area(dx, dy)).find(free) {
        return (found, None);
    }
    // Further away, to the right in growing steps up and down.
    let far = (1..24).flat_map(|ring| {
        let step = 8.0 * f64::from(ring);
        [(26.0, -step), (26.0, step), (60.0, -step), (60.0, step)]
    });
    far.map(|(dx, dy)| area(dx, dy))
        .find(free)
        .map_or((area(8.0, 0.0), None), |found| {
            (found, Some((found[0] - 2.0, (found[1] + found[3]) / 2.0)))
        })
}

fn text(out: &mut String, x: f64, y: f64, anchor: &str, colour: &str, size: f64, words: &str) {
    let _ = writeln!(
        out,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"{colour}\" \
         font-size=\"{size}\">{words}</text>"
    );
}

/// Frame, grid, ticks and their numbers.
fn axes(out: &mut String, x: &Axis, y: &Axis) {
    for tick in x.ticks() {
        let at = x.at(tick);
        let _ = writeln!(
            out,
            "<path d=\"M{at:.1} {TOP}V{BOTTOM}\" stroke=\"#e4e4e4\"/>"
        );
        text(
            out,
            at,
            BOTTOM + 18.0,
            "middle",
            "#222",
            LABEL,
            &x.number(tick),
        );
    }
    for tick in y.ticks() {
        let at = y.at(tick);
        let _ = writeln!(
            out,
            "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"#e4e4e4\"/>"
        );
        text(
            out,
            LEFT - 7.0,
            at + 4.0,
            "end",
            "#222",
            LABEL,
            &y.number(tick),
        );
    }
    let _ = writeln!(
        out,
        "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#444\"/>",
        RIGHT - LEFT,
        BOTTOM - TOP
    );
}

/// A linear axis.
struct Axis {
    low: f64,
    high: f64,
    step: f64,
    ends: [f64; 2],
}

impl Axis {
    /// Over values with some space around them, drawn between the ends (pixels).
    fn over(values: Vec<f64>, from_zero: bool, ends: [f64; 2]) -> Self {
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (least, most) = if least <= most {
            (least, most)
        } else {
            (0.0, 1.0)
        };
        let least = if from_zero { 0.0 } else { least };
        let span = (most - least).max(1e-3 * most.abs()).max(1e-9);
        let low = if from_zero { 0.0 } else { least - 0.09 * span };
        let high = most + 0.09 * span;
        Self {
            low,
            high,
            step: round_step((high - low) / 6.0),
            ends,
        }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        self.ends[0] + share * (self.ends[1] - self.ends[0])
    }

    fn ticks(&self) -> Vec<f64> {
        let (first, last) = (
            (self.low / self.step).ceil(),
            (self.high / self.step).floor(),
        );
        let count = (last - first).max(0.0) as usize;
        // Plus zero: no minus before a zero.
        (0..=count)
            .map(|i| (first + i as f64) * self.step + 0.0)
            .collect()
    }

    fn number(&self, value: f64) -> String {
        let digits = (-self.step.log10().floor() + 1e-9).max(0.0) as usize;
        format!("{value:.digits$}")
    }
}

/// The smallest of 1, 2, 5 × 10ⁿ that is at least `least`.
fn round_step(least: f64) -> f64 {
    let decade = 10_f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade);
    let found = steps.into_iter().find(|step| *step >= least * 0.999_999);
    found.unwrap_or(10.0 * decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_crowded_dots_keep_clear_of_each_other() {
        let mut taken: Vec<Area> = vec![[96.0, 196.0, 104.0, 204.0]];
        for _ in 0..12 {
            let (area, _) = place((100.0, 200.0), "12 frames", false, &taken);
            let clear =
                |o: &Area| area[2] <= o[0] || o[2] <= area[0] || area[3] <= o[1] || o[3] <= area[1];
            assert!(taken.iter().all(clear), "{area:?}");
            taken.push(area);
        }
    }

    #[test]
    fn a_plot_without_points_is_still_a_plot() {
        let plot = Plot {
            title: String::new(),
            x_label: "x",
            y_label: "y",
            from_zero: true,
            series: Vec::new(),
        };
        assert!(plot.svg().ends_with("</svg>\n"));
    }
}
