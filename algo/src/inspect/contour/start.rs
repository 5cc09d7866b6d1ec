//! Where a contour lies roughly: edges on some of its normals, to a fraction of a pixel.
//!
//! # Idea
//! The pixels nearest to a normal are split in two, background and material, where the squares that
//! both means leave are least; material is in phase with the plane. Pixels beside the split that see
//! both tell by their share where in between the edge lies. The shape goes through these edges.

use super::sample::Signals;
use super::shape::Shape;
use super::view::View;
use crate::math::complex::Complex;
use crate::math::solve::{Point, associate};
use alloc::vec::Vec;

/// Distance of normals, px, and how many there are at most.
const APART: f64 = 4.0;
const MOST: f64 = 32.0;
/// Pixels beyond the reach on both sides, and the least number of them on each side of a split.
const BEYOND: f64 = 3.0;
const LEAST: usize = 2;
/// Of how many variances a split must take squares away: noise alone has 25 once in 10⁵.
const CLEAR: f64 = 40.0;
/// Over how many px an edge goes from background to material.
const WIDE: f64 = 1.2;
/// σ of these edges, px.
const SIGMA: f64 = 0.25;
/// The least share of normals with an edge on the shape.
const AGREED: f64 = 0.4;

/// A pixel on a normal: its distance from the contour as expected, px, and its light.
type OnNormal = (f64, Complex);

/// The parameters near the expected ones that go through the edges; `None` if too few agree.
pub fn start<const N: usize>(
    (shape, expected): (&impl Shape<N>, &[f64; N]),
    signals: &Signals<'_, impl View>,
    pixel: f64,
    ratios: &mut Vec<f64>,
) -> Option<[f64; N]> {
    let length = shape.length(expected);
    let reach = signals.setup.reach / pixel;
    // Casts cut off, and keep to the range of their type.
    let count = (length / pixel / APART).clamp(8.0, MOST) as usize;
    let (mut points, mut line) = (Vec::new(), Vec::new());
    for number in 0..count {
        let foot = shape.foot(expected, length * (number as f64 + 0.5) / count as f64);
        let at = |px: f64| {
            let mm = px * pixel;
            let (x, y) = (foot.x + mm * foot.normal.0, foot.y + mm * foot.normal.1);
            signals.view.pixel(x, y)
        };
        let d = |x, y| shape.distance(expected, x, y) / pixel;
        let Some(places) = at(0.0).zip(at(1.0)) else {
            continue;
        };
        read(places, d, reach + BEYOND, signals, &mut line);
        if let Some(edge) = split(&line, signals) {
            let off = edge * pixel;
            points.push(Point {
                x: foot.x + off * foot.normal.0,
                y: foot.y + off * foot.normal.1,
                variance: SIGMA * SIGMA * pixel * pixel,
                weight: 1.0,
            });
        }
    }
    let mut p = *expected;
    associate(shape, &mut p, &mut points, ratios)?;
    let far = (reach + 1.0) * pixel;
    let agree = |point: &&Point| {
        let moved = shape.distance(expected, point.x, point.y);
        point.weight > 0.5 && libm::fabs(moved) < far
    };
    (points.iter().filter(agree).count() as f64 >= AGREED * count as f64).then_some(p)
}

/// A place of the picture, px.
type Place = (f64, f64);

/// Reads the pixels along a normal, which passes through two places of the picture.
fn read(
    ((u, v), to): (Place, Place),
    d: impl Fn(f64, f64) -> f64,
    reach: f64,
    signals: &Signals<'_, impl View>,
    line: &mut Vec<OnNormal>,
) {
    line.clear();
    let (columns, rows) = signals.view.size();
    let way = (to.0 - u, to.1 - v);
    let length = libm::sqrt(way.0 * way.0 + way.1 * way.1);
    let step = (way.0 / length, way.1 / length);
    // Casts cut off, and keep to the range of their type: places left of or above the frame are -0.
    let reach = reach as i32;
    for at in -reach..=reach {
        let (u, v) = (u + step.0 * f64::from(at), v + step.1 * f64::from(at));
        if !(u > -0.5 && v > -0.5) {
            continue;
        }
        let at = ((u + 0.5) as usize, (v + 0.5) as usize);
        if at.0 >= columns || at.1 >= rows {
            continue;
        }
        if let Some(spot) = signals.view.spot(at.0 as f64, at.1 as f64)
            && let Some([light, _]) = signals.light_at(at, &spot)
        {
            line.push((d(spot.x, spot.y), light));
        }
    }
}

/// Where background ends and material begins, px; `None` if nothing tells.
fn split(line: &[OnNormal], signals: &Signals<'_, impl View>) -> Option<f64> {
    let total = line.iter().fold(Complex::default(), |sum, of| sum + of.1);
    let all = line.len() as f64;
    let (mut below, mut best) = (Complex::default(), (0.0, 0, Complex::default()));
    for (i, of) in line.iter().enumerate() {
        let (n, m) = (i as f64, all - i as f64);
        if i >= LEAST && i + LEAST <= line.len() {
            let above = (total - below).re.max(0.0);
            let explained = below.square() / n + above * above / m;
            if explained > best.0 {
                best = (explained, i, below);
            }
        }
        below += of.1;
    }
    let (explained, at, below) = best;
    let (n, m) = (at as f64, all - at as f64);
    let clear = CLEAR * signals.variance;
    let material = (total - below) * (1.0 / m);
    if !(explained - total.square() / all > clear && material.re >= signals.setup.least) {
        return None;
    }
    let background = below * (1.0 / n);
    let contrast = material - background;
    let (mut sum, mut weights) = (0.0, 0.0);
    for (d, light) in &line[at.saturating_sub(LEAST)..(at + LEAST).min(line.len())] {
        let share = contrast.dot(*light - background) / contrast.square();
        let weight = (share * (1.0 - share)).max(0.01);
        sum += weight * (d - WIDE * (share - 0.5));
        weights += weight;
    }
    Some(sum / weights)
}
