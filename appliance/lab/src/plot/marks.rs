//! The marks that a plot consists of (lines, dots, words), and how they are written as SVG.

use std::fmt::Write as _;

/// Where words stand relative to their point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// It is where they start.
    Start,
    /// It is their middle.
    Middle,
    /// It is where they end.
    End,
    /// It is their middle, and they are read from below.
    Upright,
}

/// A mark. Places are in pixels from the upper left corner.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// A line through points.
    Line {
        /// Its points.
        points: Vec<(f64, f64)>,
        /// CSS colour, six digits.
        colour: &'static str,
        /// Width.
        width: f64,
        /// Whether it is dashed.
        dashed: bool,
    },
    /// A filled circle.
    Dot {
        /// Its middle.
        at: (f64, f64),
        /// Its radius.
        radius: f64,
        /// CSS colour, six digits.
        colour: &'static str,
    },
    /// A line of words.
    Words {
        /// Their place, on the base line.
        at: (f64, f64),
        /// How the words stand to their place.
        anchor: Anchor,
        /// CSS colour, six digits.
        colour: &'static str,
        /// Height of the letters.
        size: f64,
        /// What they say.
        words: String,
    },
}

/// Length of a dash and of the space after it.
pub const DASH: [f64; 2] = [7.0, 4.0];

/// A picture of marks on white.
pub fn svg((width, height): (f64, f64), marks: &[Mark]) -> String {
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"DejaVu Sans, Arial, sans-serif\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for mark in marks {
        // Writing to a string does not fail.
        let _ = match mark {
            Mark::Line {
                points,
                colour,
                width,
                dashed,
            } => {
                let points: Vec<String> = points
                    .iter()
                    .map(|(x, y)| format!("{x:.1},{y:.1}"))
                    .collect();
                let dashes = if *dashed {
                    format!(" stroke-dasharray=\"{} {}\"", DASH[0], DASH[1])
                } else {
                    String::new()
                };
                writeln!(
                    out,
                    "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\"{dashes} stroke-width=\"{width}\"/>",
                    points.join(" ")
                )
            }
            Mark::Dot { at, radius, colour } => writeln!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"{colour}\"/>",
                at.0, at.1
            ),
            Mark::Words {
                at: (x, y),
                anchor,
                colour,
                size,
                words,
            } => {
                let (place, anchor) = match anchor {
                    Anchor::Start => (format!("x=\"{x:.1}\" y=\"{y:.1}\""), "start"),
                    Anchor::Middle => (format!("x=\"{x:.1}\" y=\"{y:.1}\""), "middle"),
                    Anchor::End => (format!("x=\"{x:.1}\" y=\"{y:.1}\""), "end"),
                    Anchor::Upright => (
                        format!("transform=\"translate({x:.1} {y:.1}) rotate(-90)\""),
                        "middle",
                    ),
                };
                writeln!(
                    out,
                    "<text {place} text-anchor=\"{anchor}\" fill=\"{colour}\" font-size=\"{size}\">{words}</text>"
                )
            }
        };
    }
    out.push_str("</svg>\n");
    out
}
