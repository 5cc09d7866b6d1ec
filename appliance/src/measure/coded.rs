//! Measures a recording of Gray codes without fringes.

use super::{
    Manner, MeasuredRecording, MeasurementReport, NO_PATTERN, RecordedRig, StageTimes, Truth,
    least_modulation, primary_of,
};
use crate::error::{Exit, Failure, Result};
use crate::head::code::CodeAlone;
use crate::head::direction::Sensitivity;
use crate::head::seam;
use crate::output::cloud::Surface;
use algo::chain::{CodePhases, SIGMA_CELLS};
use algo::pipeline::{PhaseMap, triangulate_with};
use algo::units::{AbsolutePhase, WrappedPhase};
use hal::replay::Recording;

/// Measures every code; the one whose place changes most with the height gives it.
///
/// # Errors
/// A code cannot be decoded, or a model is absurd.
pub(super) fn measure(recording: &Recording) -> Result<MeasuredRecording> {
    let least = least_modulation(recording);
    let mut stages = StageTimes::default();
    let mut codes = Vec::new();
    let read = stages.time("phase", || {
        for pattern in 0..recording.patterns.len() {
            let Some(code) = CodeAlone::of(recording, pattern)? else {
                return Exit::Content
                    .fail("it has neither fringes nor a Gray code: record one of both");
            };
            codes.push(code);
        }
        let phases = codes.iter().map(|code| code.read(least));
        Ok::<_, Failure>(phases.collect::<Result<Vec<_>, _>>()?)
    })?;
    let (mut phases, missing): (Vec<PhaseMap>, Vec<Vec<u8>>) = read
        .into_iter()
        .map(|CodePhases { map, missing }| (map, missing))
        .unzip();
    let devices = RecordedRig::of(recording, None)?;
    let raster = &recording.projector;
    let (columns, rows) = (raster.width as usize, raster.height as usize);
    let geometries = recording.patterns.iter().map(|spec| {
        let function =
            seam::phase_function(spec, columns, rows).map_err(Exit::Content.failure())?;
        let geometry = devices.triangulator(&function);
        geometry.map_err(Exit::Content.failure())
    });
    let mut geometries: Vec<_> = geometries.collect::<Result<_, _>>()?;
    let sensitivities: Vec<_> = geometries
        .iter()
        .map(|geometry| Sensitivity::of(geometry.as_ref().ok()?))
        .collect();
    let primary = primary_of(recording, &sensitivities);
    let Some(code) = codes.get(primary) else {
        return Exit::Content.fail(NO_PATTERN);
    };
    let geometry = geometries.swap_remove(primary);
    let sigma = SIGMA_CELLS * code.cells.width;
    let heights = stages.time("height", || {
        geometry.map(|triangulator| {
            let known = |_| Some(sigma);
            let mut map = triangulate_with(&triangulator, &mut phases[primary], known, &|_| ());
            for (sigma, missing) in map.sigma.iter_mut().zip(&missing[primary]) {
                *sigma *= (1_u32 << missing) as f32;
            }
            Surface { map, triangulator }
        })
    });
    let report = MeasurementReport::new(
        &phases[primary],
        &heights,
        Manner {
            kind: "gray code alone",
            ratios: Vec::new(),
            chain: Some(vec![format!("{} cells", code.cells.count)]),
            map: None,
            recipe: None,
        },
        recording.noise_counts,
        &Truth::of(recording),
        stages.0,
    );
    let full_scale = recording.format().full_scale();
    Ok(MeasuredRecording {
        wrapped: phases.iter().map(wrapped).collect(),
        wrapped_only: vec![None; phases.len()],
        phases,
        primary,
        heights,
        decoder: None,
        shots: Vec::new(),
        full_scale,
        places: codes
            .iter()
            .map(|code| (if code.vertical { "column" } else { "row" }, code.pitch))
            .collect(),
        // σ follows from the cells, not from the noise.
        report: MeasurementReport {
            no_sigma: None,
            notes: recording.notes.clone(),
            ..report.by(recording, primary, sensitivities[primary])
        },
        intensity: algo::frame::mean(&code.even(), full_scale),
    })
}

/// The phases without their fringe orders.
fn wrapped(map: &PhaseMap) -> PhaseMap {
    let phase = map.phase.iter().map(|phase| match phase.is_known() {
        true => AbsolutePhase::from_turns(WrappedPhase::from_turns(phase.turns()).turns()),
        false => *phase,
    });
    PhaseMap {
        phase: phase.collect(),
        ..map.clone()
    }
}
