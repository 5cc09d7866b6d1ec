//! The uncertainty of a value of a section, by numeric propagation.
//!
//! # Equations
//! Those of [`propagate`](crate::math::propagate), with q the eight parameters of both sides and C
//! their covariance by noise. An input that is the same in every measurement states by how much each
//! parameter is off for its standard uncertainty.

use super::edge::RoundEdge;
use super::find::Section;
use super::geometry::Joint;
use super::request::Side;
use crate::math::propagate::{Dependence, derivative};
use alloc::vec::Vec;

/// By how much the radius of what is not seen of an edge differs from that of what is seen, of it,
/// and how far a stated radius is off, of it (1 σ), where nothing is known of that. Neither is
/// measured.
const FORM: f64 = 0.05;

/// What is uncertain, the same in every measurement of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointSource {
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
pub struct JointInput {
    /// What is uncertain.
    pub source: JointSource,
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
pub struct JointValue {
    /// The value.
    pub value: f64,
    /// By noise, 1 σ: over repeats of the same part.
    pub sigma: f64,
    /// By what is the same in every measurement, 1 σ.
    pub systematic: f64,
}

impl Section {
    /// The inputs of the uncertainty of its values beside noise.
    pub fn inputs(&self, known: &Knowledge) -> Vec<JointInput> {
        let mut inputs = Vec::new();
        for (side, edge) in [Side::Left, Side::Right].into_iter().zip(&self.edges) {
            let mut add = |source, own: [f64; 4]| {
                let off = match side {
                    Side::Left => joint(own, [0.0; 4]),
                    Side::Right => joint([0.0; 4], own),
                };
                inputs.push(JointInput { source, off });
            };
            add(JointSource::Heights(side), [known.height, 0.0, 0.0, 0.0]);
            let radius = known.radius.filter(|_| edge.is_stated);
            let radius = radius.unwrap_or(FORM * edge.parameters[3]);
            let missing = radius * (1.0 - libm::sin(edge.arc));
            add(JointSource::Missing(side), [0.0, 0.0, missing, 0.0]);
            if edge.is_stated {
                add(
                    JointSource::Radius(side),
                    edge.stated.map(|off| off * radius),
                );
            }
        }
        let [left, right] = &self.edges;
        inputs.push(JointInput {
            source: JointSource::Lengths,
            off: joint(scaled(left, known.scale), scaled(right, known.scale)),
        });
        inputs.push(JointInput {
            source: JointSource::Blur,
            off: joint(left.blurred, right.blurred),
        });
        inputs
    }

    /// A value of its geometry with its errors; `None` where it is not finite.
    pub fn value(&self, f: impl Fn(&Joint) -> f64, inputs: &[JointInput]) -> Option<JointValue> {
        let here = self.parameters();
        let at = |off: &[f64; 8], times: f64| {
            f(&self.geometry(&core::array::from_fn(|i| here[i] + times * off[i])))
        };
        let value = at(&[0.0; 8], 0.0);
        let mut variance = 0.0;
        for (side, edge) in self.edges.iter().enumerate() {
            let changed = |i: usize, by: f64| {
                let mut off = [0.0; 8];
                off[4 * side + i] = 1.0;
                at(&off, by)
            };
            variance += Dependence::new(value, &edge.covariance, changed).variance;
        }
        let inputs = inputs.iter();
        let changes = inputs.map(|input| derivative(value, 1.0, |by| at(&input.off, by)));
        let systematic = libm::sqrt(changes.map(|change| change * change).sum::<f64>());
        let sigma = libm::sqrt(variance);
        let is_finite = [value, sigma, systematic].iter().all(|x| x.is_finite());
        is_finite.then_some(JointValue {
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
fn scaled(edge: &RoundEdge, share: f64) -> [f64; 4] {
    let [c, a, t, r] = edge.parameters;
    let middle = edge.middle;
    // The middle of the stretch stays where it is and the line is moved under it.
    let along = middle * libm::sqrt(1.0 + a * a);
    [c - a * middle, 0.0, t + along, r].map(|off| off * share)
}
