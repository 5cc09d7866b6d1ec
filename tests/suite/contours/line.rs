//! A taught plate in front of a head, and sums over what is measured of many.

use super::plates::{Setting, gauging};
use crate::gauges::{frames, planned};
use crate::placement::{Bed, bed, taught_within};
use algo::inspect::State;
use appliance::recipe::plan::{Plan, PlanError};
use appliance::recipe::{GaugeFile, RecipeFile, Refusal};
use appliance::station::{GaugeValue, Inspection};
use sim::parts::Plate;
use sim::{Part, Placement};
use std::time::Instant;
use tests::random::Random;

/// Measurements in each place.
const REPEATS: usize = 4;
/// A plate that was taught, with gauges.
pub(super) struct Line {
    pub(super) setting: Setting,
    pub(super) bed: Bed,
    pub(super) plan: Plan,
    pub(super) gauges: Vec<(GaugeFile, f64)>,
    /// Names of all features.
    pub(super) features: Vec<String>,
}

impl Line {
    pub(super) fn new(setting: &Setting) -> Self {
        Self::with_limits(setting, |_, _| ())
    }

    pub(super) fn with_limits(setting: &Setting, limit: impl Fn(&mut GaugeFile, f64)) -> Self {
        let mut bed = bed(&setting.scenario());
        let part = Part::Plate(setting.plate.clone());
        bed.stage.place(&part, &setting.placement(None)).unwrap();
        let taught = taught_within(&mut bed, setting.tolerance_mm()).unwrap();
        let lies = setting.placement(None);
        let (mut features, datums, mut gauges) =
            gauging(&setting.plate, &bed.calibration.camera, &lies);
        features[0].thickness_mm = setting.thickness_mm;
        features[0].rim_mm = setting.rims_stated.then_some(setting.plate.rim_mm);
        for (gauge, truth) in &mut gauges {
            limit(gauge, *truth);
        }
        let mut file: RecipeFile = taught.manifest.clone();
        file.features.extend(features);
        file.datums = datums;
        file.gauges = gauges.iter().map(|(gauge, _)| gauge.clone()).collect();
        let plan = loop {
            let refused = match planned(&bed, &file, &taught.recipe.arrays) {
                Ok(plan) => break plan,
                Err(PlanError::Unfit {
                    reason:
                        Refusal {
                            of: Some(feature), ..
                        },
                    ..
                }) if setting.some => feature.place,
                Err(error) => panic!("{error}"),
            };
            // What golden does not show is not measured, nor what refers to it.
            let name = file.features.remove(refused).name;
            println!("golden does not show {name}");
            file.datums.retain(|datum| !datum.of.contains(&name));
            let systems: Vec<String> = file.datums.iter().map(|of| of.name.clone()).collect();
            gauges.retain(|(gauge, _)| {
                let datum = gauge.datum.as_ref().is_none_or(|of| systems.contains(of));
                datum && !gauge.of.contains(&name)
            });
            file.gauges = gauges.iter().map(|(gauge, _)| gauge.clone()).collect();
        };
        bed.head
            .load(plan.rasters(&bed.calibration).unwrap())
            .unwrap();
        Self {
            setting: setting.clone(),
            bed,
            plan,
            gauges,
            features: file.features.iter().map(|of| of.name.clone()).collect(),
        }
    }

    pub(super) fn inspect(&mut self, plate: Plate, lies: &Placement) -> Inspection {
        self.bed.stage.place(&Part::Plate(plate), lies).unwrap();
        let frames = frames(&mut self.bed, &self.plan, 0);
        self.plan.inspect(0, &frames, Instant::now())
    }

    /// Measures good plates at random places, and in each again and again.
    pub(super) fn judge(&mut self, name: &str, placements: usize, judged: &mut Judged) {
        let mut random = Random::new(5);
        let mut sums = vec![[0.0; 3]; self.gauges.len()];
        for at in 0..placements {
            let lies = self.setting.placement((at > 0).then_some(&mut random));
            let part = Part::Plate(self.setting.plate.clone());
            self.bed.stage.place(&part, &lies).unwrap();
            let found: Vec<Inspection> = (0..REPEATS)
                .map(|_| {
                    let frames = frames(&mut self.bed, &self.plan, 0);
                    self.plan.inspect(0, &frames, Instant::now())
                })
                .collect();
            for feature in &found[0].features {
                if feature.state != State::Found {
                    println!("{name} {at}: {feature:?}");
                }
                judged.rims.push(feature.found);
            }
            for (at, ((gauge, truth), sum)) in self.gauges.iter().zip(&mut sums).enumerate() {
                let values = found.iter().map(|found| &found.gauges[at]);
                judged.add(&gauge.name, values.collect(), *truth, sum);
            }
        }
        for ((gauge, _), [sum, squares, count]) in self.gauges.iter().zip(sums) {
            let (bias, rms) = (sum / count * 1e3, (squares / count).sqrt() * 1e3);
            println!(
                "{name}, {:<12} bias {bias:+6.1} µm, RMS {rms:5.1}, of {count}",
                gauge.name
            );
            judged.bias = judged.bias.max(bias.abs());
        }
    }
}

/// Sums over measurements.
#[derive(Default)]
pub(super) struct Judged {
    /// Largest mean error, µm.
    pub(super) bias: f64,
    /// Scatter over σ of measurements of the same part in place, squared.
    pub(super) ratios: f64,
    pub(super) freedom: f64,
    pub(super) errors: f64,
    pub(super) squares: f64,
    pub(super) within: f64,
    /// Gauges with this in their names are not counted.
    pub(super) without: Option<&'static str>,
    /// Gauges with errors of more than 2 U.
    pub(super) far: Vec<String>,
    /// Σ U².
    pub(super) stated: f64,
    pub(super) missing: usize,
    /// Shares of rims that were found.
    pub(super) rims: Vec<f64>,
}

impl Judged {
    /// Adds repeated measurements of a gauge.
    fn add(&mut self, name: &str, found: Vec<&GaugeValue>, truth: f64, sum: &mut [f64; 3]) {
        if self.without.is_some_and(|word| name.contains(word)) {
            return;
        }
        let values: Vec<f64> = found.iter().filter_map(|found| found.value).collect();
        if values.len() < found.len() {
            println!("   {name}: {:?}", found[0].reason);
            self.missing += found.len() - values.len();
            return;
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let sigmas = found.iter().map(|found| found.sigma.unwrap());
        let variance = sigmas.map(|sigma| sigma * sigma).sum::<f64>() / count;
        self.ratios += squares / variance;
        self.freedom += count - 1.0;
        for found in &found {
            let error = found.value.unwrap() - truth;
            let u = found.uncertainty.unwrap();
            self.errors += 1.0;
            self.within += f64::from(u8::from(error.abs() <= u));
            if error.abs() > 2.0 * u {
                println!("   {name}: off by {error:.4} of U {u:.4}");
                self.far.push(name.into());
            }
            self.squares += error * error;
            self.stated += u * u;
        }
        let error = mean - truth;
        *sum = [sum[0] + error, sum[1] + error * error, sum[2] + 1.0];
    }

    /// Scatter over σ, the share of errors within U, and RMS of U over RMS error.
    pub(super) fn figures(&self) -> [f64; 3] {
        let scatter = (self.ratios / self.freedom).sqrt();
        let figures = [
            scatter,
            self.within / self.errors,
            (self.stated / self.squares).sqrt(),
        ];
        let least = self.rims.iter().copied().fold(1.0, f64::min);
        println!(
            "bias ≤ {:.1} µm, scatter/σ {:.2}, within U {:.3} of {}, U/RMS {:.2}, rims ≥ {least:.2}, {} missing",
            self.bias, figures[0], figures[1], self.errors, figures[2], self.missing
        );
        figures
    }
}
