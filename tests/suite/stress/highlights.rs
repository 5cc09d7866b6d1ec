//! Highlights of shiny parts: pixels with samples at full scale, against frames of less light that have
//! none.

use super::stack::Stack;
use crate::placement::square_pixels;
use algo::pattern::Shot;
use algo::phase::{LeastModulation, Trust};
use algo::units::AbsolutePhase;
use hal::frame::Samples;
use hal::projector::Raster;
use sim::parts::{Cone, SheetMetal};
use sim::{Material, Part, Scenario, head};
use std::f64::consts::TAU;
use std::time::Duration;

/// Half width of the noise of a sample, counts of 255.
const NOISE: f64 = 3.1;
/// Projector columns of a fringe.
const PITCH: f64 = 16.0;

/// A part of a material, in N shifts of a sine.
fn stack(
    part: &Part,
    material: Material,
    shifts: usize,
    (gain, noise, bits): (f64, f64, u8),
) -> Stack {
    let mut scenario = Scenario {
        part: part.clone(),
        material: Some(material),
        sub_rays: 2,
        bit_depth: bits,
        ..Scenario::default()
    };
    square_pixels(&mut scenario.rig.camera, (256, 256));
    scenario.noise.noise_counts = Some(noise);
    scenario.optics.gain = gain;
    let (mut head, _) = head(&scenario).unwrap();
    let (width, height) = head.projector_size();
    let shots: Vec<Shot> = (0..shifts)
        .map(|k| Shot::sine(1.0, k as f64 / shifts as f64))
        .collect();
    let rasters = shots.iter().map(|shot| {
        let grey = |at: u32| {
            let turns = f64::from(at % width) / PITCH + shot.shift;
            (127.5 * (1.0 + (TAU * turns).sin())).round() as u8
        };
        Raster::new(width, height, (0..width * height).map(grey).collect()).unwrap()
    });
    head.load(rasters.collect()).unwrap();
    let mut stack = Stack::dark((256, 256), bits, shots.clone(), (0.0, 60.0));
    stack.map = Some(vec![AbsolutePhase::from_turns(0.0); stack.pixels()]);
    stack.least = LeastModulation::of_noise(scenario.noise_sigma_counts().max(0.2), bits);
    let indices: Vec<usize> = (0..shifts).collect();
    head.acquire(&indices, Duration::from_secs(2), &mut |frame, taken| {
        for pixel in 0..stack.pixels() {
            let sample = match taken.samples() {
                Samples::Eight(samples) => samples[pixel].into(),
                Samples::Sixteen(samples) => samples[pixel],
            };
            stack.set(frame, pixel, sample);
        }
    })
    .unwrap();
    stack
}

/// Pixels, and their errors over σ.
#[derive(Default)]
struct Tally {
    seen: usize,
    resolved: usize,
    squares: f64,
    far: usize,
}

impl Tally {
    fn scatter(&self) -> f64 {
        (self.squares / self.resolved as f64).sqrt()
    }
}

#[test]
fn clipped_pixels_of_highlights_are_as_true_as_sigma_says() {
    for part in [
        Part::SheetMetal(SheetMetal::default()),
        Part::Cone(Cone::default()),
    ] {
        for material in [Material::RolledSteel, Material::Oiled] {
            let truth = stack(&part, material, 9, (0.3, 0.0, 12)).decode();
            for shifts in [4, 9] {
                let frames = stack(&part, material, shifts, (1.0, NOISE, 8));
                let found = frames.decode();
                let mut all = [Tally::default(), Tally::default()];
                for pixel in 0..frames.pixels() {
                    // The light of a whole pixel.
                    if truth.trust[pixel] != Trust::Resolved
                        || truth.modulation[pixel].counts(255) < 5.0
                    {
                        continue;
                    }
                    let clipped = (0..shifts).any(|frame| frames.sample(frame, pixel) == 255);
                    let tally = &mut all[usize::from(clipped)];
                    tally.seen += 1;
                    if found.trust[pixel] != Trust::Resolved {
                        continue;
                    }
                    tally.resolved += 1;
                    let counts = found.modulation[pixel].counts(255);
                    let sigma = (NOISE * NOISE / 3.0 + 1.0 / 12.0).sqrt() / TAU / counts;
                    let off = found.phase[pixel].turns() - truth.phase[pixel].turns();
                    let error = (off - off.round()) / (sigma * (2.0 / shifts as f64).sqrt());
                    tally.squares += error * error;
                    tally.far += usize::from(error.abs() > 4.0);
                }
                let [whole, clipped] = all;
                let scatter = [whole.scatter(), clipped.scatter()];
                println!(
                    "{material:?}, N = {shifts}: {} of {} clipped pixels; scatter/σ of whole and of clipped ones {scatter:.3?}, {} and {} beyond 4 σ",
                    clipped.resolved, clipped.seen, whole.far, clipped.far
                );
                // A modulation of more than half of full scale is held as that: σ is then larger.
                let least = if shifts == 4 { 0.85 } else { 0.9 };
                assert!(scatter.iter().all(|scatter| (least..1.1).contains(scatter)));
                assert!(1000 * clipped.far <= clipped.resolved);
                let least = if shifts == 4 { 0.35 } else { 1.0 };
                assert!(clipped.resolved as f64 >= least * clipped.seen as f64);
            }
        }
    }
}
