//! The fixed-point code compared with its `f64` twin on the same frames.

use crate::cases;
use crate::measured::{BOARD, CONE, Measured, SKULL, SPHERE, SPLINE, shared_recording};
use algo::phase::Trust;
use rayon::prelude::*;
use tests::oracle::height::sigma_z;
use tests::oracle::{self, Pattern, PhaseTwin, Reason, Rig, levels_of};
use tests::score::rms;

/// 1 % of the noise of one 4-frame level in the study, 7.4e-3 turn (docs/measurement.md, *Noise*).
const PHASE_RMS_TURNS: f64 = 7.4e-5;
/// Share of the pixels whose mask may differ, because a modulation or residual is so near its
/// threshold that the last bit of the fixed point decides. In a small recording one such pixel is
/// allowed.
const MASK_SHARE: f64 = 1e-4;
/// A quarter of the residual error of the reference method in the study's best case. Both sides
/// solve the same equation to 1e-7 mm; heights are stored in nm.
const HEIGHT_RMS_MM: f64 = 5e-4;
/// Relative error of σ_z: the fixed-point code rounds B to 12 bits and then takes an integer root
/// of the mean power, rounding down both times. At the smallest modulation, 16/255 (257 of 4095
/// units), this is up to two units.
const SIGMA_SHARE: f64 = 2.0 / 257.0;
/// σ_z is written as f32.
const NOISE_SHARE: f64 = 1e-6;

/// The differences for one pattern of a recording.
#[derive(Debug)]
struct Difference {
    compared: usize,
    phase_rms: f64,
    orders: usize,
    masks: usize,
}

fn same(trust: Trust, reason: Reason) -> bool {
    trust.word() == reason.word()
}

/// Compares the phases of pixels that both resolve, and the masks of all pixels. `reason` has the
/// twin's masks; whether they include heights follows `trust`.
fn compare(measured: &Measured, at: usize, twin: &PhaseTwin, reason: &[Reason]) -> Difference {
    let found = &measured.result.phases[at];
    let finest = levels_of(&measured.recording, at).last().unwrap().ratio;
    let mut errors = Vec::new();
    let (mut orders, mut masks) = (0, 0);
    for (pixel, reason) in reason.iter().enumerate() {
        if !same(found.trust[pixel], *reason) {
            masks += 1;
        }
        if found.trust[pixel].has_phase() && reason.has_phase() {
            let error = found.phase[pixel].turns() - twin.phase[pixel];
            // Compares the order of the finest level's fringe; wraps of equal phases do not count.
            if (error * finest).abs() > 0.5 {
                orders += 1;
            } else {
                errors.push(error);
            }
        }
    }
    Difference {
        compared: errors.len(),
        phase_rms: rms(&errors),
        orders,
        masks,
    }
}

/// Compares heights and σ_z with the twin's geometry at the fixed-point phases; returns the twin's
/// own mask, which includes heights.
fn check_heights(name: &str, measured: &Measured, twin: &PhaseTwin) -> Vec<Reason> {
    let recording = &measured.recording;
    let at = measured.result.primary;
    let (Some(rig), Ok(surface)) = (Rig::of(recording), &measured.result.heights) else {
        assert!(measured.result.heights.is_err() && Rig::of(recording).is_none());
        return twin.reason.clone();
    };
    let pattern = Pattern::of(recording, at);
    let noise = oracle::sample_noise(recording, at, &twin.reason);
    let found = &measured.result.phases[at];
    let solve = |pixel: usize, phase: f64| {
        let (u, v) = (pixel % found.width, pixel / found.width);
        rig.height(&pattern, u as f64, v as f64, phase)
    };
    let pixels: Vec<_> = (0..found.trust.len())
        .into_par_iter()
        .map(|pixel| {
            let reason = match twin.reason[pixel] {
                Reason::Resolved if solve(pixel, twin.phase[pixel]).is_none() => Reason::OutOfRange,
                reason => reason,
            };
            let mut errors = None;
            if found.trust[pixel] == Trust::Resolved {
                let (z, slope) = solve(pixel, found.phase[pixel].turns())
                    .unwrap_or_else(|| panic!("{name}: the twin has no height at {pixel}"));
                let height = surface.map.height[pixel].mm() - z;
                // More modulation than words hold, of clipped samples, is stated as less.
                let held = reason == Reason::Resolved && twin.modulation[pixel] < 0.49;
                let sigma = noise.filter(|_| held).map(|noise| {
                    let sigma = sigma_z(noise, slope, twin.information[pixel]);
                    f64::from(surface.map.sigma[pixel]) / sigma - 1.0
                });
                errors = Some((height, sigma));
            }
            (reason, errors)
        })
        .collect();
    let errors: Vec<f64> = pixels.iter().filter_map(|p| p.1).map(|e| e.0).collect();
    let sigmas: Vec<f64> = pixels.iter().filter_map(|p| p.1?.1).collect();
    let worst = sigmas.iter().fold(0.0_f64, |worst, s| worst.max(s.abs()));
    println!(
        "{name}: heights differ by {:.2e} mm RMS over {} px, sigma by at most {:.2e}",
        rms(&errors),
        errors.len(),
        worst
    );
    assert!(rms(&errors) <= HEIGHT_RMS_MM, "{name}: {}", rms(&errors));
    assert!(worst <= SIGMA_SHARE, "{name}: sigma is off by {worst}");
    match (measured.result.report.noise_counts, noise) {
        (Some(found), Some(noise)) => {
            // Where masks differ, the pixels are not the same.
            assert!((found / noise - 1.0).abs() < 1e3 * NOISE_SHARE, "{name}");
            assert_eq!(sigmas.is_empty(), errors.is_empty(), "{name}");
        }
        (None, None) => {}
        other => panic!("{name}: noise {other:?}"),
    }
    pixels.iter().map(|p| p.0).collect()
}

fn check(name: &str, measured: &Measured) {
    for at in 0..measured.recording.patterns.len() {
        let twin = oracle::decode(&measured.recording, at);
        let reason = if at == measured.result.primary {
            check_heights(name, measured, &twin)
        } else {
            twin.reason.clone()
        };
        let difference = compare(measured, at, &twin, &reason);
        println!("{name}, pattern {at}: {difference:?}");
        assert!(difference.compared * 4 > reason.len() / 2 || name == SKULL);
        assert!(
            difference.phase_rms <= PHASE_RMS_TURNS,
            "{name}: {difference:?}"
        );
        assert_eq!(difference.orders, 0, "{name}: {difference:?}");
        let allowed = (reason.len() as f64 * MASK_SHARE).ceil() as usize;
        assert!(difference.masks <= allowed, "{name}: {difference:?}");
    }
}

fn check_shared(name: &str) {
    if let Some(measured) = shared_recording(name) {
        check(name, measured);
    }
}

#[test]
fn the_fixed_point_equals_its_twin_on_the_skull() {
    check_shared(SKULL);
}

#[test]
fn the_fixed_point_equals_its_twin_on_the_board_in_both_directions() {
    check_shared(BOARD);
}

#[test]
fn the_fixed_point_equals_its_twin_on_the_sphere() {
    check_shared(SPHERE);
}

#[test]
fn the_fixed_point_equals_its_twin_on_the_adaptive_cone() {
    check_shared(CONE);
}

#[test]
fn the_fixed_point_equals_its_twin_on_the_dense_spline() {
    check_shared(SPLINE);
}

#[test]
fn the_fixed_point_equals_its_twin_in_every_form_depth_and_number_of_shifts() {
    for (name, recording) in cases::all() {
        let measured = Measured::new(recording);
        let reasons = &measured.result.report.unresolved;
        // Each case has the reasons that it can have, so results are not equal only because they
        // are empty.
        assert!(reasons["low_modulation"] + reasons["residual"] > 0 || name.starts_with("single"));
        check(name, &measured);
    }
}

#[test]
fn a_modulation_of_exactly_sixteen_counts_is_trusted_with_any_number_of_shifts() {
    let mut measured: Vec<(&str, &Measured)> = Vec::new();
    let own: Vec<_> = cases::all()
        .into_iter()
        .map(|(name, recording)| (name, Measured::new(recording)))
        .collect();
    measured.extend(own.iter().map(|(name, own)| (*name, own)));
    for name in [SKULL, BOARD] {
        measured.extend(shared_recording(name).map(|shared| (name, shared)));
    }
    for (name, measured) in measured {
        for at in 0..measured.recording.patterns.len() {
            let twin = oracle::decode(&measured.recording, at);
            let phases = &measured.result.phases[at];
            let ties: Vec<usize> = (0..twin.tie.len()).filter(|&p| twin.tie[p]).collect();
            let wrong = ties
                .iter()
                .filter(|&&p| phases.trust[p].has_phase() != twin.reason[p].has_phase())
                .count();
            println!(
                "{name}, pattern {at}: {} ties, {wrong} rejected",
                ties.len()
            );
            assert_eq!(wrong, 0, "{name}, pattern {at}");
        }
    }
}
