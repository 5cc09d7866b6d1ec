//! Makes a phase function for the part of a preliminary recording (`fringed-lab adapt`).

use algo::adaptive::noise::Light;
use algo::adaptive::{FringeOptics, ProjectorMap, noise, paper};
use algo::pattern::PhaseFunction;
use algo::units::AbsolutePhase;
use appliance::error::Result;
use appliance::head::{direction, seam};
use appliance::measure::{measure, wrong};
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use serde::Serialize;
use std::path::Path;

/// The method and its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptOptions {
    /// The method.
    pub method: Method,
    /// Blur and smallest pitches. The paper's method uses only the image pitch: its projector pitch
    /// is [`paper::PROJECTOR_PITCH`], and the blur only enters the prediction.
    pub optics: FringeOptics,
}

/// A method of making a pattern for a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Peng & Gupta (2008), from vertical and horizontal fringes.
    Paper,
    /// Least error for the light and the contrast that there are, from vertical fringes alone.
    Fringed,
}

/// A phase function that was made for a part.
#[derive(Clone, Debug)]
pub struct Adapted {
    /// Φ_P over the projector's raster.
    pub function: PhaseFunction,
    /// Φ that the preliminary measurement expects in each camera pixel under this pattern, unknown
    /// where it was not resolved.
    pub expected: Vec<AbsolutePhase>,
    /// The summary.
    pub report: Report,
}

/// The summary of an adaptation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The method by which the phase function was made.
    pub method: Method,
    /// Rows and columns of the phase function: the projector's.
    pub shape: [usize; 2],
    /// Camera pixels whose projector point is known and on the raster.
    pub pixels_used: usize,
    /// Smallest and largest local pitch along ξ over the whole raster, projector pixels.
    pub pitch_px: [f64; 2],
    /// Largest Φ_P in turns; the smallest is 0.
    pub max_turns: f64,
    /// RMS of the preliminary measurement's σ_z, mm; `None` if the noise is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preliminary_sigma_mm: Option<f64>,
    /// RMS of σ_z that is predicted for the new phase function with the levels and shifts of the
    /// preliminary sequence, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_sigma_mm: Option<f64>,
}

/// Measures a preliminary recording and makes a phase function for its part.
///
/// # Errors
/// If it cannot be measured, lacks a pattern or a model that the method needs, or has no resolved
/// pixels.
pub fn adapt(recording: &Recording, folder: &Path, options: &AdaptOptions) -> Result<Adapted> {
    let crossed = crossed(recording, options.method).map_err(wrong(folder))?;
    let measurement = measure(recording, folder)?;
    if direction::word(&recording.patterns[measurement.primary]) != "vertical" {
        return Err(wrong(folder)(
            &"patterns are adapted along the rows of the projector, and its fringes along the columns hardly depend on the height here: stand the projector beside the camera",
        ));
    }
    let decoder = measurement.decoder.as_ref().ok_or_else(|| {
        wrong(folder)("a Gray code alone has no modulation of fringes to go by: record fringes with fringed record")
    })?;
    let surface = measurement.heights.as_ref().map_err(|missing| {
        wrong(folder)(format!(
            "{missing}: calibrate the head and add both models, or record with fringed record"
        ))
    })?;
    let projector = &recording.projector;
    let (columns, rows) = (projector.width as usize, projector.height as usize);
    let map = match crossed {
        None => ProjectorMap::from_heights(&surface.triangulator, &surface.map),
        Some(Crossed { at, pitch }) => {
            let phases = at.map(|at| &measurement.phases[at].phase[..]);
            ProjectorMap::from_phases(phases, pitch, surface.map.width)
        }
    };
    let spec = &recording.patterns[measurement.primary];
    let before = seam::phase_function(spec, columns, rows).map_err(wrong(folder))?;
    let made = match options.method {
        Method::Fringed => {
            let slopes = map.slopes(noise::MAX_SLOPE);
            let light = Light::of(
                &measurement.phases[measurement.primary],
                decoder,
                &slopes,
                1.0 / before.pitches()[0],
                &options.optics.blur,
                measurement.report.noise_counts,
                &|_| (),
            );
            noise::adapt(&map, columns, rows, &options.optics, &light, &|_| ())
        }
        Method::Paper => paper::adapt(&map, columns, rows, options.optics.image_pitch),
    };
    let function = made.map_err(wrong(folder))?;
    let sigmas = noise::predict(
        &surface.map.sigma,
        &map,
        &before,
        &function,
        &options.optics.blur,
    );
    let on_raster = |point: &&[f64; 2]| {
        let inside = |x: f64, count: usize| x > -0.5 && x < count as f64 - 0.5;
        inside(point[0], columns) && inside(point[1], rows)
    };
    let report = Report {
        method: options.method,
        shape: [rows, columns],
        pixels_used: map.points.iter().filter(on_raster).count(),
        pitch_px: function.pitches(),
        max_turns: function.range().max,
        preliminary_sigma_mm: sigmas.map(|[before, _]| before),
        predicted_sigma_mm: sigmas.map(|[_, after]| after),
    };
    let trusted = match options.method {
        Method::Fringed => map.without_blurred_silhouettes(options.optics.blur.camera),
        Method::Paper => map,
    };
    Ok(Adapted {
        expected: trusted.expected_phase(&function),
        function,
        report,
    })
}

/// Vertical and horizontal fringes of a recording.
struct Crossed {
    /// Indices of the vertical and the horizontal pattern.
    at: [usize; 2],
    /// Pitch of each, projector pixels.
    pitch: [f64; 2],
}

/// Checks that a recording has the patterns that a method needs; those of the paper's method are
/// returned. The vertical pattern is the measurement's primary one.
fn crossed(recording: &Recording, method: Method) -> Result<Option<Crossed>, &'static str> {
    let projector = &recording.projector;
    let find = |pitch: &dyn Fn(&PatternSpec) -> Option<f64>| {
        let mut patterns = recording.patterns.iter().enumerate();
        patterns.find_map(|(at, spec)| pitch(spec).map(|pitch| (at, pitch)))
    };
    let vertical = find(&|spec| match spec {
        PatternSpec::Vertical { fringes } => Some(f64::from(projector.width) / fringes),
        _ => None,
    });
    let horizontal = find(&|spec| match spec {
        PatternSpec::Horizontal { fringes } => Some(f64::from(projector.height) / fringes),
        _ => None,
    });
    match (method, vertical, horizontal) {
        (Method::Fringed, Some(_), _) => Ok(None),
        (Method::Paper, Some((vertical, across)), Some((horizontal, down))) => Ok(Some(Crossed {
            at: [vertical, horizontal],
            pitch: [across, down],
        })),
        (Method::Paper, Some(_), None) => Err(
            "the paper's method needs vertical and horizontal fringes, and the recording has no \
             horizontal pattern: record both, or use --method fringed",
        ),
        (Method::Paper, None, _) => Err(
            "the paper's method needs vertical and horizontal fringes, and the recording has no \
             vertical pattern: record both",
        ),
        (Method::Fringed, None, _) => Err(
            "the recording has no vertical pattern, which the heights come from: record one with \
             fringed record",
        ),
    }
}

impl Report {
    /// The report as lines of a name and a value.
    pub fn table(&self) -> String {
        let [rows, columns] = self.shape;
        let [low, high] = self.pitch_px;
        let mut lines = vec![
            ("phase function", format!("{rows} rows x {columns} columns")),
            ("pixels used", format!("{} px", self.pixels_used)),
            ("local pitch", format!("{low:.2} to {high:.2} px")),
            ("largest phase", format!("{:.3} turns", self.max_turns)),
        ];
        let sigmas = self.preliminary_sigma_mm.zip(self.predicted_sigma_mm);
        if let Some((before, after)) = sigmas {
            let text = format!("{after:.4} mm RMS, was {before:.4} mm with the same levels");
            lines.push(("predicted error (1 σ)", text));
        }
        let lines = lines
            .iter()
            .map(|(name, value)| format!("{name:<26}{value}\n"));
        lines.collect()
    }
}
