//! The uncertainty of a value of a section, by numeric propagation.
//!
//! # Equations
//! With q the eight parameters of both sides, C their covariance by noise and f the value,
//! σ² = gᵀ C g, gᵢ = [f(qᵢ + uᵢ) − f(qᵢ − uᵢ)] / 2uᵢ, uᵢ = √Cᵢᵢ (JCGM 100:2008, 5.1.3 note 2, with
//! 5.2.2 for covariances). An input that is the same in every measurement states by how much each
//! parameter is off for its standard uncertainty; it adds the square of f's change between − and +
//! half of that.

use super::edge::Edge;
use super::find::Section;
use super::geometry::Geometry;
use super::reason::Side;
use crate::math::derivative;
use alloc::vec::Vec;

/// By how much the radius of what is not seen of an edge differs from that of what is seen, of it,
/// and how far a stated radius is off, of it (1 σ), where nothing is known of that. Neither is
/// measured.
const FORM: f64 = 0.05;

/// What is uncertain, the same in every measurement of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The heights of a side, by the calibration.
    Heights(Side),
    /// The scale of lengths, by the calibration.
    Lengths,
    /// What a pixel averages.
    Blur,
    /// The part of an edge that is not seen: the extreme point is extrapolated from what is.
    Missing(Side),
    /// A stated radius.
    Radius(Side),
}

/// An input of the uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// What is uncertain.
    pub source: Source,
    /// By how much each parameter is off for one standard uncertainty.
    pub off: [f64; 8],
}

/// What is known of the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Knowledge {
    /// σ of the heights of a side by the calibration, mm.
    pub height: f64,
    /// σ of lengths by the calibration, of 1.
    pub scale: f64,
    /// σ of a stated radius, and of that of what is not seen of its edge, mm; `None` where it is not
    /// known.
    pub radius: Option<f64>,
}

/// A value with its errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// The value.
    pub value: f64,
    /// By noise, 1 σ: over repeats of the same part.
    pub sigma: f64,
    /// By what is the same in every measurement, 1 σ.
    pub systematic: f64,
}

impl Value {
    /// U = 2 √(σ² + systematic²).
    pub fn uncertainty(&self) -> f64 {
        2.0 * libm::sqrt(self.sigma * self.sigma + self.systematic * self.systematic)
    }
}

impl Section {
    /// The inputs of the uncertainty of its values beside noise.
    pub fn inputs(&self, known: &Knowledge) -> Vec<Input> {
        let mut inputs = Vec::new();
        for (side, edge) in [Side::Left, Side::Right].into_iter().zip(&self.edges) {
            let mut add = |source, own: [f64; 4]| {
                let off = match side {
                    Side::Left => joint(own, [0.0; 4]),
                    Side::Right => joint([0.0; 4], own),
                };
                inputs.push(Input { source, off });
            };
            add(Source::Heights(side), [known.height, 0.0, 0.0, 0.0]);
            let radius = known.radius.filter(|_| edge.is_stated);
            let radius = radius.unwrap_or(FORM * edge.parameters[3]);
            let missing = radius * (1.0 - libm::sin(edge.arc));
            add(Source::Missing(side), [0.0, 0.0, missing, 0.0]);
            if edge.is_stated {
                add(Source::Radius(side), edge.stated.map(|off| off * radius));
            }
        }
        let [left, right] = &self.edges;
        inputs.push(Input {
            source: Source::Lengths,
            off: joint(scaled(left, known.scale), scaled(right, known.scale)),
        });
        inputs.push(Input {
            source: Source::Blur,
            off: joint(left.blurred, right.blurred),
        });
        inputs
    }

    /// A value of its geometry with its errors; `None` where it is not finite.
    pub fn value(&self, f: impl Fn(&Geometry) -> f64, inputs: &[Input]) -> Option<Value> {
        let here = self.parameters();
        let at = |off: &[f64; 8], times: f64| {
            f(&self.geometry(&core::array::from_fn(|i| here[i] + times * off[i])))
        };
        let value = at(&[0.0; 8], 0.0);
        let mut variance = 0.0;
        for (side, edge) in self.edges.iter().enumerate() {
            let g: [f64; 4] = core::array::from_fn(|i| {
                derivative(value, libm::sqrt(edge.covariance[i][i].max(0.0)), |step| {
                    let mut off = [0.0; 8];
                    off[4 * side + i] = 1.0;
                    at(&off, step)
                })
            });
            for (row, own) in edge.covariance.iter().zip(g) {
                variance += row
                    .iter()
                    .zip(g)
                    .map(|(c, other)| own * c * other)
                    .sum::<f64>();
            }
        }
        let systematic = inputs.iter().map(|Input { off, .. }| {
            let change = at(off, 0.5) - at(off, -0.5);
            change * change
        });
        let systematic = libm::sqrt(systematic.sum::<f64>());
        let sigma = libm::sqrt(variance.max(0.0));
        let is_finite = [value, sigma, systematic].iter().all(|x| x.is_finite());
        is_finite.then_some(Value {
            value,
            sigma,
            systematic,
        })
    }
}

/// What both sides are off.
fn joint(left: [f64; 4], right: [f64; 4]) -> [f64; 8] {
    core::array::from_fn(|i| if i < 4 { left[i] } else { right[i - 4] })
}

/// By how much the parameters of a side are off if all lengths are by a share.
fn scaled(edge: &Edge, share: f64) -> [f64; 4] {
    let [c, a, t, r] = edge.parameters;
    let middle = edge.middle;
    // The middle of the stretch stays where it is and the line is moved under it.
    let along = middle * libm::sqrt(1.0 + a * a);
    [c - a * middle, 0.0, t + along, r].map(|off| off * share)
}
