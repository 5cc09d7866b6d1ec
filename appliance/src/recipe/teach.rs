//! Teaching: from a good part in front of the head to a recipe.

use super::archive::{self, Arrays};
use super::file::{CameraFile, FORMAT, RasterFile, VERSION};
use super::{GaugeFile, GaugeKind, PatternFile, Recipe, RecipeFile, RegionFile, SequenceFrame};
use crate::calibration::Calibration;
use crate::plan::rasters;
use crate::seam;
use algo::geometry::{Reference, Triangulator};
use algo::inspect::openings;
use algo::pattern::{PhaseFunction, Sequence};
use algo::phase::{Decoder, Trust};
use algo::pipeline::{self, HeightMap, PhaseMap};
use hal::head::DynHead;
use std::time::Duration;

/// Projector pitch of the taught pattern, in pixels.
const PITCH_PX: f64 = 12.0;
/// Levels and steps of the taught sequence.
const LEVELS: usize = 3;
const STEPS: usize = 4;
/// A scene that resolves less than this share of the frame cannot be taught.
const LEAST_RESOLVED: f64 = 0.005;
/// Pixels at silhouettes mix two surfaces: the golden map is eroded by this much.
const EROSION_PX: usize = 2;
/// Pixels whose taught height is less certain than this are not compared, mm (1 σ).
const MAX_SIGMA_MM: f64 = 0.25;
/// Deviations are averaged over squares of this many camera pixels.
const SMOOTHING_PX: usize = 9;
/// Limit of the deviation, mm.
const DEVIATION_MM: f64 = 0.25;
/// Limit of the change of the part's coverage, as a share of the frame.
const COVERAGE_CHANGE: f64 = 0.01;
/// Least share of the golden surface that must be resolved.
const MIN_COVERAGE: f64 = 0.80;
/// An opening has at least this many pixels, and at most this share of it may be resolved.
const OPENING_PIXELS: usize = 60;
const OPENING_COVERAGE: f64 = 0.25;
/// Openings that get a gauge of their own, and the least reach of their regions in pixels.
const MAX_OPENINGS: usize = 8;
const OPENING_REACH: usize = 4;

/// What to call the recipe.
#[derive(Clone, Debug)]
pub struct Naming {
    /// 1–9999.
    pub number: u16,
    /// The key for a PLC.
    pub part_number: String,
    /// For people.
    pub name: String,
    /// When, in seconds since 1970 UTC; 0 if not known.
    pub taught_at_unix_s: u64,
}

/// A part that could not be taught.
#[derive(Debug, thiserror::Error)]
pub enum TeachError {
    /// A device failed.
    #[error("teach: {0}")]
    Device(#[from] hal::error::Error),
    /// The scene does not make a recipe.
    #[error("teach: {0}")]
    Scene(String),
    /// The rig or the pattern is impossible.
    #[error("teach: {0}")]
    Rig(String),
}

fn rig(error: impl std::fmt::Display) -> TeachError {
    TeachError::Rig(error.to_string())
}

/// Measures the part in front of the head with a fixed pattern and makes it a recipe: its bytes and
/// its checked form.
///
/// Gauges are made for what the part shows: deviation from golden and coverage of the whole part,
/// and that each of its openings stays open. `progress` is told the share done and what is being
/// done.
///
/// # Errors
/// If a device fails or the scene cannot be taught. Nothing is stored here.
pub fn teach(
    head: &mut DynHead,
    calibration: &Calibration,
    naming: &Naming,
    timeout: Duration,
    progress: &dyn Fn(f64, &str),
) -> Result<(Vec<u8>, Recipe), TeachError> {
    progress(0.0, "making the pattern");
    let (columns, rows) = calibration.projector;
    let fringes = f64::from(columns) / PITCH_PX;
    let function =
        PhaseFunction::vertical(columns as usize, rows as usize, fringes).map_err(rig)?;
    let frames = Sequence::geometric(function.range(), LEVELS, STEPS);
    head.load(rasters(&function, frames.iter().copied(), calibration)?)?;
    let mut taken = Vec::with_capacity(frames.len());
    let indices: Vec<usize> = (0..frames.len()).collect();
    head.acquire(&indices, timeout, &mut |_, frame| {
        taken.push(frame);
        progress(
            0.1 + 0.5 * taken.len() as f64 / frames.len() as f64,
            "measuring the part",
        );
    })?;
    progress(0.6, "computing the golden map");
    let views = taken
        .iter()
        .map(seam::view)
        .collect::<Result<Vec<_>, _>>()
        .map_err(rig)?;
    let sequence = Sequence::from_frames(&frames).map_err(rig)?;
    let decoder = Decoder::new(&sequence, function.range(), calibration.camera.2).map_err(rig)?;
    let (camera, projector) = calibration.devices().map_err(rig)?;
    let triangulator =
        Triangulator::new(camera, projector, Reference::Models, function, None).map_err(rig)?;
    let mut phases = pipeline::decode(&decoder, &views, None).map_err(rig)?;
    let noise = calibration.noise_counts;
    let heights = pipeline::triangulate(&triangulator, &decoder, Some(noise), &mut phases);
    refuse_empty(&phases)?;
    progress(0.8, "working out the expansion");
    let arrays = arrays(&triangulator, &decoder, &phases, &heights);
    let resolved: Vec<bool> = phases
        .trust
        .iter()
        .map(|trust| *trust == Trust::Resolved)
        .collect();
    let (regions, gauges) = gauges(&resolved, phases.width);
    let range = triangulator.range();
    let file = RecipeFile {
        format: FORMAT.into(),
        version: VERSION,
        fingerprint: String::new(),
        number: naming.number,
        part_number: naming.part_number.clone(),
        name: naming.name.clone(),
        taught_by: concat!("fringed ", env!("CARGO_PKG_VERSION")).into(),
        taught_at_unix_s: naming.taught_at_unix_s,
        calibration: calibration.fingerprint(),
        camera: CameraFile {
            width: calibration.camera.0,
            height: calibration.camera.1,
            bit_depth: calibration.camera.2,
        },
        projector: RasterFile {
            width: columns,
            height: rows,
        },
        pattern: PatternFile::Vertical { fringes },
        sequence: frames
            .iter()
            .map(|&(ratio, shift_turns)| SequenceFrame {
                ratio,
                shift_turns,
                production: true,
            })
            .collect(),
        range_mm: [range.low, range.high],
        exposure_us: None,
        noise_counts: noise,
        expansion_range_turns: 0.5,
        min_coverage: MIN_COVERAGE,
        regions,
        gauges,
    };
    let (bytes, _) = archive::pack(&file, &arrays).map_err(rig)?;
    // Read back as it will be after a restart: what was just taught is known to load.
    let recipe = Recipe::from_bytes(&bytes).map_err(rig)?;
    progress(1.0, "taught");
    Ok((bytes, recipe))
}

/// Says what keeps an unusable scene from being taught.
fn refuse_empty(phases: &PhaseMap) -> Result<(), TeachError> {
    let pixels = phases.trust.len() as f64;
    if phases.count(Trust::Resolved) as f64 >= LEAST_RESOLVED * pixels {
        return Ok(());
    }
    let share = |trust| phases.count(trust) as f64 / pixels * 100.0;
    let reason = [
        (
            Trust::Saturated,
            "is saturated: shorten the exposure or close the aperture",
        ),
        (
            Trust::OutOfRange,
            "lies outside the working range: move the part or widen range_mm",
        ),
        (
            Trust::LowModulation,
            "shows the coarse pattern only: focus camera and projector",
        ),
        (
            Trust::Residual,
            "gives contradicting phases: does the part or the light move?",
        ),
    ]
    .into_iter()
    .filter(|(trust, _)| share(*trust) > 100.0 * LEAST_RESOLVED)
    .max_by(|(a, _), (b, _)| share(*a).total_cmp(&share(*b)));
    Err(TeachError::Scene(match reason {
        Some((trust, words)) => format!("{:.1} % of the frame {words}", share(trust)),
        None => format!(
            "{:.1} % of the frame is dark: is the part in place and the projector on?",
            share(Trust::Dark)
        ),
    }))
}

fn arrays(
    triangulator: &Triangulator,
    decoder: &Decoder,
    phases: &PhaseMap,
    heights: &HeightMap,
) -> Arrays {
    let width = phases.width;
    let mut expansions = vec![[f32::NAN; 2]; phases.phase.len()];
    pipeline::for_each_row(&mut expansions, width, |v, row| {
        for (u, [first, second]) in row.iter_mut().enumerate() {
            let at = v * width + u;
            if phases.trust[at] != Trust::Resolved {
                continue;
            }
            let phase = phases.phase[at].turns();
            if let Some(expansion) = triangulator.expand(u as f64, v as f64, phase) {
                (*first, *second) = (expansion.first as f32, expansion.second as f32);
            }
        }
    });
    let resolved = |at: &usize| phases.trust[*at] == Trust::Resolved;
    let certain = |at: usize| resolved(&at) && f64::from(heights.sigma[at]) <= MAX_SIGMA_MM;
    let certain: Vec<bool> = (0..phases.phase.len()).map(certain).collect();
    let valid = eroded(&certain, width, EROSION_PX);
    Arrays {
        phase_function: Vec::new(),
        golden_phase: (0..phases.phase.len())
            .map(|at| {
                if resolved(&at) {
                    phases.phase[at].turns()
                } else {
                    f64::NAN
                }
            })
            .collect(),
        golden_height: heights
            .height
            .iter()
            .map(|height| height.mm() as f32)
            .collect(),
        height_slope: expansions.iter().map(|[first, _]| *first).collect(),
        height_curvature: expansions.iter().map(|[_, second]| *second).collect(),
        valid: valid.into_iter().map(u8::from).collect(),
        modulation: phases
            .modulation
            .iter()
            .map(|modulation| modulation.counts(decoder.full_scale()) as f32)
            .collect(),
    }
}

/// Takes `by` pixels off every edge of a mask (square neighbourhood); the frame's border is an edge.
fn eroded(mask: &[bool], width: usize, by: usize) -> Vec<bool> {
    let rows = mask.len() / width.max(1);
    let inside = |column: usize, row: usize| {
        let fits = column >= by && row >= by && column + by < width && row + by < rows;
        fits && (row - by..=row + by).all(|v| {
            mask[v * width + column - by..=v * width + column + by]
                .iter()
                .all(|on| *on)
        })
    };
    (0..mask.len())
        .map(|at| inside(at % width, at / width))
        .collect()
}

/// The regions and gauges that a taught part gets by itself.
fn gauges(resolved: &[bool], width: usize) -> (Vec<RegionFile>, Vec<GaugeFile>) {
    let rows = resolved.len() / width.max(1);
    let (right, bottom) = (width as f64 - 0.5, rows as f64 - 0.5);
    let mut regions = vec![RegionFile {
        name: "frame".into(),
        polygon: vec![[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]],
    }];
    let coverage = resolved.iter().filter(|on| **on).count() as f64 / resolved.len().max(1) as f64;
    let mut gauges = vec![
        GaugeFile {
            name: "deviation".into(),
            region: "frame".into(),
            measures: GaugeKind::Deviation {
                smoothing_px: SMOOTHING_PX,
            },
            low: Some(-DEVIATION_MM),
            high: Some(DEVIATION_MM),
        },
        GaugeFile {
            name: "coverage".into(),
            region: "frame".into(),
            measures: GaugeKind::Coverage,
            low: Some((coverage - COVERAGE_CHANGE).max(0.0)),
            high: Some((coverage + COVERAGE_CHANGE).min(1.0)),
        },
    ];
    let found = openings(resolved, width, OPENING_PIXELS);
    let usable = found
        .iter()
        .filter(|opening| opening.reach >= OPENING_REACH);
    for (at, opening) in usable.take(MAX_OPENINGS).enumerate() {
        let name = format!("opening {}", at + 1);
        let ((u, v), reach) = (opening.centre, opening.reach as f64);
        regions.push(RegionFile {
            name: name.clone(),
            polygon: vec![
                [u - reach, v],
                [u, v - reach],
                [u + reach, v],
                [u, v + reach],
            ],
        });
        gauges.push(GaugeFile {
            name: name.clone(),
            region: name,
            measures: GaugeKind::Coverage,
            low: None,
            high: Some(OPENING_COVERAGE),
        });
    }
    (regions, gauges)
}
