//! Errors and their uncertainty.

use super::joint::{Chance, Joint, Rendered, truth};
use crate::inspect::section::{Knowledge, Section, Side, Value, flush, gap, radius};
use std::vec::Vec;

const PIXELS: [f64; 2] = [0.145, 0.41];

fn section(rendered: &Rendered, seed: u64, noise: f64) -> Option<[Value; 4]> {
    let joint = &rendered.joint;
    let points = rendered.capture(seed, noise);
    let section = Section::new(&points, &joint.request(), &joint.optics());
    let section = match section {
        Ok(section) => section,
        Err(why) => {
            std::println!("{why} {joint:?}");
            return None;
        }
    };
    let inputs = section.inputs(&Knowledge::default());
    let value = |f: &dyn Fn(&_) -> f64| section.value(f, &inputs).unwrap();
    Some([
        value(&gap),
        value(&flush),
        value(&|geometry| radius(geometry, Side::Left)),
        value(&|geometry| radius(geometry, Side::Right)),
    ])
}

#[test]
fn explore() {
    for pixel in PIXELS {
        for floor in [None, Some((18.0, 1.0)), Some((13.0, 0.5)), Some((4.0, 0.5))] {
            let mut all: [Vec<f64>; 4] = Default::default();
            let (mut over, mut sig, mut u) = ([0.0; 4], [0.0; 4], [0.0; 4]);
            let mut seen = 0.0;
            for seed in 0..40 {
                let mut chance = Chance::new(seed);
                let mut joint = Joint::draw(pixel, &mut chance);
                joint.floor = floor;
                let rendered = joint.rendered();
                let Some(values) = section(&rendered, seed, 1.0) else {
                    continue;
                };
                seen += 1.0;
                let (g, f) = truth(&joint);
                let is = [g, f, joint.radii[0], joint.radii[1]];
                for i in 0..4 {
                    let off = (values[i].value - is[i]) * 1e3;
                    all[i].push(off);
                    let un = values[i].uncertainty() * 1e3;
                    over[i] += f64::from(u8::from(off.abs() > un));
                    sig[i] += values[i].sigma * 1e3;
                    u[i] += un;
                }
            }
            for i in 0..4 {
                let n = all[i].len() as f64;
                let mean = all[i].iter().sum::<f64>() / n;
                let sd = (all[i].iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
                let max = all[i].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                std::println!(
                    "{pixel} {floor:?} {} n {seen} bias {mean:.1} sd {sd:.1} max {max:.1} sigma {:.1} U {:.1} in U {:.2}",
                    ["gap", "flush", "rL", "rR"][i],
                    sig[i] / n,
                    u[i] / n,
                    1.0 - over[i] / n
                );
            }
        }
    }
}

#[test]
fn debug() {
    for noise in [0.05, 1.0] {
        for seed in 0..12 {
            let mut chance = Chance::new(seed);
            let joint = Joint::draw(0.41, &mut chance);
            let points = joint.rendered().capture(seed, noise);
            let section = Section::new(&points, &joint.request(), &joint.optics());
            match section {
                Ok(section) => {
                    for (i, edge) in section.edges.iter().enumerate() {
                        let [.., t, r] = edge.parameters;
                        let is = -joint.gap / 2.0 + joint.place * [1.0, -1.0][i] + 10.75;
                        std::println!(
                            "{noise} {seed} r {:.3} found {r:.3} sigma {:.3} arc {:.0} extreme off {:.3} light {:.2} turn {:.3}",
                            joint.radii[i],
                            edge.covariance[3][3].sqrt(),
                            edge.arc.to_degrees(),
                            t + r - is,
                            joint.light * [1.0, -1.0][i],
                            joint.turn
                        );
                    }
                }
                Err(why) => std::println!(
                    "{noise} {seed} {why} {:?} light {:.2} turn {:.3}",
                    joint.radii,
                    joint.light,
                    joint.turn
                ),
            }
        }
    }
}
