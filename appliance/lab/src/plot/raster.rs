//! A plot as a picture of pixels: lines and dots with soft edges, words in the one font of all
//! pictures, whose size is fixed (the `size` of [`Mark::Words`] is for SVG). Pixel (x, y) has its
//! centre at the point (x, y), in SVG at (x + ½, y + ½).

use super::marks::{Anchor, DASH, Mark};
use appliance::output::canvas::{Canvas, LETTER, LINE};

/// The marks on white, in a picture of `width` × `height` pixels.
pub fn render((width, height): (f64, f64), marks: &[Mark]) -> Canvas<3> {
    let mut canvas = Canvas::new(width as usize, height as usize);
    canvas.pixels.fill([255; 3]);
    for mark in marks {
        match mark {
            Mark::Line {
                points,
                colour,
                width,
                dashed,
            } => {
                let mut walked = 0.0;
                for pair in points.windows(2) {
                    let ends = (pair[0], pair[1]);
                    line(
                        &mut canvas,
                        ends,
                        rgb(colour),
                        *width,
                        dashed.then_some(walked),
                    );
                    walked += f64::hypot(pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
                }
            }
            Mark::Dot { at, radius, colour } => dot(&mut canvas, *at, *radius, rgb(colour)),
            Mark::Words {
                at,
                anchor,
                colour,
                words: text,
                ..
            } => words(&mut canvas, *at, *anchor, rgb(colour), text),
        }
    }
    canvas
}

/// The colour of a CSS code with six hexadecimal digits, as all marks have; black for a code that
/// is not hexadecimal.
fn rgb(code: &str) -> [u8; 3] {
    let bits = u32::from_str_radix(code.trim_start_matches('#'), 16).unwrap_or(0);
    [16, 8, 0].map(|shift| (bits >> shift) as u8)
}

/// Mixes `colour` into the pixels of a box, each by the share `cover` of its centre (x, y), which
/// is clamped to 0…1.
fn paint(
    canvas: &mut Canvas<3>,
    [left, top, right, bottom]: [f64; 4],
    colour: [u8; 3],
    cover: impl Fn(f64, f64) -> f64,
) {
    let inside = |from: f64, to: f64, end: usize| {
        (from.floor().max(0.0) as usize)..((to.ceil() + 1.0).max(0.0) as usize).min(end)
    };
    for y in inside(top, bottom, canvas.height) {
        for x in inside(left, right, canvas.width) {
            let share = cover(x as f64, y as f64).clamp(0.0, 1.0);
            let pixel = &mut canvas.pixels[y * canvas.width + x];
            for (below, above) in pixel.iter_mut().zip(colour) {
                let mixed = f64::from(*below) * (1.0 - share) + f64::from(above) * share;
                *below = mixed.round() as u8;
            }
        }
    }
}

/// A straight line of `width` pixels; if it is dashed, `walked` is the length in pixels of the
/// whole line before it, so that dashes go on over its points.
fn line(
    canvas: &mut Canvas<3>,
    ((x0, y0), (x1, y1)): ((f64, f64), (f64, f64)),
    colour: [u8; 3],
    width: f64,
    walked: Option<f64>,
) {
    let length = f64::hypot(x1 - x0, y1 - y0).max(1e-9);
    let (along_x, along_y) = ((x1 - x0) / length, (y1 - y0) / length);
    let reach = width / 2.0 + 1.0;
    let area = [
        x0.min(x1) - reach,
        y0.min(y1) - reach,
        x0.max(x1) + reach,
        y0.max(y1) + reach,
    ];
    paint(canvas, area, colour, |x, y| {
        let along = ((x - x0) * along_x + (y - y0) * along_y).clamp(0.0, length);
        let gap = walked.is_some_and(|walked| (walked + along) % (DASH[0] + DASH[1]) > DASH[0]);
        if gap {
            return 0.0;
        }
        let away = f64::hypot(x - x0 - along * along_x, y - y0 - along * along_y);
        width / 2.0 + 0.5 - away
    });
}

fn dot(canvas: &mut Canvas<3>, (x, y): (f64, f64), radius: f64, colour: [u8; 3]) {
    let reach = radius + 1.0;
    let area = [x - reach, y - reach, x + reach, y + reach];
    paint(canvas, area, colour, |px, py| {
        radius + 0.5 - f64::hypot(px - x, py - y)
    });
}

/// Words at the point (x, y) of their base line.
fn words(canvas: &mut Canvas<3>, (x, y): (f64, f64), anchor: Anchor, colour: [u8; 3], text: &str) {
    let length = LETTER * text.chars().count();
    let before = match anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => length as f64 / 2.0,
        Anchor::End => length as f64,
        Anchor::Upright => return upright(canvas, (x, y), colour, text),
    };
    // The base line is 3 pixels above the lower edge of a line.
    let top = y - (LINE as f64 - 3.0);
    canvas.text_in(
        text,
        (x - before).max(0.0) as usize,
        top.max(0.0) as usize,
        colour,
    );
}

/// Words that are read from below, with their middle at height y. They are drawn on a white canvas
/// and copied turned by a quarter, including its background, which hides what is below. The lower
/// edge of the line, not its base line, is at x.
fn upright(canvas: &mut Canvas<3>, (x, y): (f64, f64), colour: [u8; 3], text: &str) {
    let length = LETTER * text.chars().count();
    let mut lying = Canvas::<3>::new(length.max(1), LINE);
    lying.pixels.fill([255; 3]);
    lying.text_in(text, 0, 0, colour);
    let left = (x as usize).saturating_sub(LINE);
    let bottom = (y + length as f64 / 2.0) as usize;
    for (at, &pixel) in lying.pixels.iter().enumerate() {
        let (across, down) = (at % lying.width, at / lying.width);
        canvas.set(left + down, bottom.saturating_sub(across), pixel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: &str = "#ff0000";

    #[test]
    fn every_kind_of_mark_leaves_ink_where_it_stands() {
        let size = (80.0, 80.0);
        let inked = |mark: Mark| {
            let canvas = render(size, &[mark]);
            let inked =
                |(at, pixel): (usize, &[u8; 3])| (*pixel != [255; 3]).then_some((at % 80, at / 80));
            let places = canvas.pixels.iter().enumerate().filter_map(inked);
            places.collect::<Vec<_>>()
        };
        let line = |dashed| Mark::Line {
            points: vec![(10.0, 20.0), (60.0, 20.0)],
            colour: RED,
            width: 1.0,
            dashed,
        };
        let (whole, dashed) = (inked(line(false)), inked(line(true)));
        assert!(whole.contains(&(10, 20)) && whole.contains(&(60, 20)));
        assert!(dashed.len() < whole.len() && dashed.len() > whole.len() / 2);
        let dot = inked(Mark::Dot {
            at: (40.0, 40.0),
            radius: 3.0,
            colour: RED,
        });
        assert!(dot.contains(&(40, 40)) && dot.contains(&(43, 40)) && !dot.contains(&(45, 40)));
        for (anchor, columns, rows) in [
            (Anchor::Start, 40..55, 28..44),
            (Anchor::End, 25..41, 28..44),
            (Anchor::Middle, 32..48, 28..44),
            (Anchor::Upright, 25..41, 32..49),
        ] {
            let ink = inked(Mark::Words {
                at: (40.0, 40.0),
                anchor,
                colour: RED,
                size: 12.0,
                words: "mm".into(),
            });
            assert!(!ink.is_empty());
            let inside =
                |place: &(usize, usize)| columns.contains(&place.0) && rows.contains(&place.1);
            assert!(ink.iter().all(inside), "{anchor:?} {ink:?}");
        }
    }
}
