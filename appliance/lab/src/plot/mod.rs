//! Plots with labelled points, as SVG and PNG.
//!
//! No plotting library is used, because none places the labels of points clear of each other and of
//! the lines; the rest is a frame and ticks.

mod axis;
mod labels;
mod marks;
mod raster;

use axis::Axis;
use labels::{Area, block, place};
use marks::{Anchor, Mark};

/// A plot.
pub struct Plot {
    /// Above the frame.
    pub title: String,
    /// Below the frame.
    pub x_label: &'static str,
    /// Beside the frame.
    pub y_label: &'static str,
    /// Whether the x axis is logarithmic; all x are then above zero.
    pub log_x: bool,
    /// Whether the y axis starts at zero.
    pub from_zero: bool,
    /// What is drawn.
    pub series: Vec<Series>,
}

/// Points of one kind.
pub struct Series {
    /// For the legend.
    pub name: String,
    /// CSS colour, six digits.
    pub colour: &'static str,
    /// How they are drawn.
    pub kind: Kind,
    /// x, y and label of each point; an empty label is left out.
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
const LETTER: f64 = 7.0;
const DOT: f64 = 4.0;
/// Width of lines between points.
const STROKE: f64 = 1.5;
const BLACK: &str = "#000000";
const DARK: &str = "#222222";
const FRAME: &str = "#444444";
const GRID: &str = "#e4e4e4";
const LEADER: &str = "#999999";

impl Plot {
    /// As SVG.
    pub fn svg(&self) -> String {
        marks::svg((WIDTH, HEIGHT), &self.marks())
    }

    /// As PNG.
    pub fn png(&self) -> Vec<u8> {
        raster::render((WIDTH, HEIGHT), &self.marks()).png(png::Compression::High)
    }

    fn marks(&self) -> Vec<Mark> {
        let x = if self.log_x {
            Axis::decades(self.values(|p| p.0), [LEFT, RIGHT])
        } else {
            Axis::over(self.values(|p| p.0), false, [LEFT, RIGHT])
        };
        let y = Axis::over(self.values(|p| p.1), self.from_zero, [BOTTOM, TOP]);
        let mut out = Vec::new();
        let middle = ((LEFT + RIGHT) / 2.0, (TOP + BOTTOM) / 2.0);
        let title = (WIDTH / 2.0, 22.0);
        words(&mut out, title, Anchor::Middle, BLACK, 15.0, &self.title);
        axes(&mut out, &x, &y);
        let below = (middle.0, HEIGHT - 14.0);
        words(&mut out, below, Anchor::Middle, BLACK, 13.0, self.x_label);
        let beside = (18.0, middle.1);
        words(&mut out, beside, Anchor::Upright, BLACK, 13.0, self.y_label);
        self.draw(&mut out, &x, &y);
        self.legend(&mut out);
        out
    }

    fn values(&self, of: fn(&(f64, f64, String)) -> f64) -> Vec<f64> {
        let points = self.series.iter().flat_map(|series| &series.points);
        points.map(of).filter(|value| value.is_finite()).collect()
    }

    fn draw(&self, out: &mut Vec<Mark>, x: &Axis, y: &Axis) {
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
                    line(out, vec![(LEFT, y), (RIGHT, y)], colour, STROKE, true);
                    block(&mut taken, (LEFT, y), (RIGHT, y));
                }
                continue;
            }
            if series.kind != Kind::Dots {
                for pair in at.windows(2) {
                    block(&mut taken, pair[0], pair[1]);
                }
                let dashed = series.kind == Kind::Dashed;
                line(out, at.clone(), colour, STROKE, dashed);
            }
            for (x, y) in at {
                out.push(Mark::Dot {
                    at: (x, y),
                    radius: DOT,
                    colour,
                });
                taken.push([x - DOT, y - DOT, x + DOT, y + DOT]);
            }
        }
        for series in &self.series {
            for (px, py, label) in series.points.iter().filter(|point| !point.2.is_empty()) {
                let level = series.kind == Kind::Level;
                let dot = if level {
                    (RIGHT - 8.0, y.at(*py))
                } else {
                    (x.at(*px), y.at(*py))
                };
                let (area, left) = place(dot, label, level, &taken);
                if let Some(end) = left {
                    line(out, vec![dot, end], LEADER, 0.8, false);
                }
                let base = (area[0], area[3] - 2.5);
                words(out, base, Anchor::Start, series.colour, LABEL, label);
                taken.push(area);
            }
        }
    }

    fn legend(&self, out: &mut Vec<Mark>) {
        let mut x = LEFT;
        for series in &self.series {
            let colour = series.colour;
            if series.kind == Kind::Level {
                line(out, vec![(x, 44.0), (x + 20.0, 44.0)], colour, STROKE, true);
            } else {
                out.push(Mark::Dot {
                    at: (x + 12.0, 44.0),
                    radius: DOT,
                    colour,
                });
            }
            let name = &series.name;
            words(out, (x + 22.0, 48.0), Anchor::Start, DARK, LABEL, name);
            x += 38.0 + LETTER * name.chars().count() as f64;
        }
    }
}

fn words(
    out: &mut Vec<Mark>,
    at: (f64, f64),
    anchor: Anchor,
    colour: &'static str,
    size: f64,
    words: &str,
) {
    let words = words.to_owned();
    out.push(Mark::Words {
        at,
        anchor,
        colour,
        size,
        words,
    });
}

fn line(
    out: &mut Vec<Mark>,
    points: Vec<(f64, f64)>,
    colour: &'static str,
    width: f64,
    dashed: bool,
) {
    out.push(Mark::Line {
        points,
        colour,
        width,
        dashed,
    });
}

/// Frame, grid, ticks and their numbers.
fn axes(out: &mut Vec<Mark>, x: &Axis, y: &Axis) {
    for tick in x.ticks() {
        let at = x.at(tick);
        line(out, vec![(at, TOP), (at, BOTTOM)], GRID, 1.0, false);
        let place = (at, BOTTOM + 18.0);
        words(out, place, Anchor::Middle, DARK, LABEL, &x.number(tick));
    }
    for tick in y.ticks() {
        let at = y.at(tick);
        line(out, vec![(LEFT, at), (RIGHT, at)], GRID, 1.0, false);
        let place = (LEFT - 7.0, at + 4.0);
        words(out, place, Anchor::End, DARK, LABEL, &y.number(tick));
    }
    let corners = vec![
        (LEFT, TOP),
        (RIGHT, TOP),
        (RIGHT, BOTTOM),
        (LEFT, BOTTOM),
        (LEFT, TOP),
    ];
    line(out, corners, FRAME, 1.0, false);
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
            log_x: false,
            from_zero: true,
            series: Vec::new(),
        };
        assert!(plot.svg().ends_with("</svg>\n"));
        assert_eq!(&plot.png()[1..4], b"PNG");
    }
}
