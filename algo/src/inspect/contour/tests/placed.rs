//! Holes in many placements: errors, scatter, share of the rim.

use super::scene::{Chance, Noise, Rendered, Scene};
use crate::inspect::contour::shape::circle::Circle;
use crate::inspect::contour::shape::padded;
use crate::inspect::contour::{State, find, inputs};
use std::vec::Vec;

pub const LEVELS: &[f64] = &[1.0, 15.0 / 16.0, 0.75];
pub const NOTHING: &(dyn Fn(f64, f64) -> f64 + Sync) = &|_, _| 1e3;

/// A thin sheet above nothing, in front of a sharp camera.
pub fn sheet(mm_per_px: f64) -> Scene<'static> {
    Scene {
        opening: NOTHING,
        hidden: None,
        thickness: 0.0,
        floor: None,
        ambient: 0.02,
        blur: 0.3,
        mm_per_px,
        size: 100,
        tilt: (0.0, 0.0),
        noise: Noise::Uniform,
        ratios: LEVELS,
    }
}

/// Errors of holes in many placements.
#[derive(Debug, Default)]
pub struct Figures {
    /// Largest mean error of x, y and diameter, µm.
    pub bias: f64,
    /// Root mean square of the errors of single measurements, µm.
    pub error: f64,
    /// Scatter in place over σ.
    pub scatter: f64,
    /// σ of the diameter, µm.
    pub sigma: f64,
    /// Least share of the rim that was accepted.
    pub least: f64,
    /// Mean share of the rim that was accepted.
    pub rim: f64,
    /// Mean blur, px.
    pub blur: f64,
    /// Share of x, y and diameters within U.
    pub within: f64,
    /// Mean U, µm.
    pub u: f64,
}

/// How holes are placed and measured.
#[derive(Clone, Copy)]
pub struct Many {
    pub placements: u64,
    /// Captures of each.
    pub captures: u64,
    /// Whether the thickness is known.
    pub is_told: bool,
}

pub fn figures(scene: &Scene<'_>, r: f64, many: Many) -> Figures {
    let mut all = Figures {
        least: 1.0,
        ..Figures::default()
    };
    let (mut errors, mut squares, mut ratios) = ([0.0; 3], 0.0, 0.0);
    let (placements, draws) = (many.placements, many.captures);
    let count = (placements * draws) as f64;
    for placement in 0..placements {
        let mut chance = Chance::new(1000 * placement + (r * 100.0) as u64);
        let (x, y) = (chance.within(1.0), chance.within(1.0));
        let opening = move |px: f64, py: f64| libm::hypot(px - x, py - y) - r;
        let mut scene = scene.clone();
        scene.opening = &opening;
        scene.tilt.0 += chance.within(1.0);
        scene.tilt.1 += chance.within(1.0);
        // What is looked at: the band about places within reach of where the hole is expected.
        let reach = 6.0 * scene.mm_per_px + 1.0;
        let rendered = Rendered::new(scene, reach, placement);
        let mut setup = rendered.setup();
        if !many.is_told {
            setup.thickness = None;
        }
        let expected = padded(&[
            x + chance.within(0.25),
            y + chance.within(0.25),
            r + chance.within(0.1),
        ]);
        let mut found = Vec::new();
        for draw in 0..draws {
            let capture = rendered.capture(placement * 100 + draw);
            let contour = find(&Circle, &expected, &capture, &setup);
            assert_eq!(contour.state, State::Found, "r {r}: {contour:?}");
            let p = contour.parameters;
            let off = [p[0] - x, p[1] - y, 2.0 * (p[2] - r)].map(|mm| mm * 1e3);
            let of = |i: usize, mm: f64| if i == 2 { 2e3 * mm } else { 1e3 * mm };
            let sigma = [0, 1, 2].map(|i| of(i, libm::sqrt(contour.covariance[i][i])));
            let inputs = inputs(&Circle, &contour, &setup, 0.0);
            for i in 0..3 {
                let systematic = inputs.iter().map(|input| of(i, input.off[i]).powi(2));
                let u = 2.0 * (sigma[i] * sigma[i] + systematic.sum::<f64>()).sqrt();
                all.within += f64::from(u8::from(off[i].abs() <= u)) / (3.0 * count);
                all.u += u / (3.0 * count);
                squares += off[i] * off[i] / (3.0 * count);
            }
            all.least = all.least.min(contour.found);
            all.rim += contour.found / count;
            all.sigma += sigma[2] / count;
            all.blur += contour.blur / count;
            found.push((off, sigma));
        }
        for (i, error) in errors.iter_mut().enumerate() {
            let mean = found.iter().map(|of| of.0[i]).sum::<f64>() / draws as f64;
            let spread: f64 = found
                .iter()
                .map(|of| ((of.0[i] - mean) / of.1[i]).powi(2))
                .sum();
            *error += mean / placements as f64;
            ratios += spread / (3 * placements * (draws - 1).max(1)) as f64;
        }
    }
    all.bias = errors.iter().fold(0.0, |most, off| off.abs().max(most));
    all.error = squares.sqrt();
    all.scatter = ratios.sqrt();
    all
}
