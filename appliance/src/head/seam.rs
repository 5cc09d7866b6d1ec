//! Converts between devices and computation: `hal`'s frames, models and patterns, and the types of
//! `algo`.

use crate::error::{Exit, Failure};
use algo::frame::{FrameError, FrameView, Samples};
use algo::geometry::{FittedMap, ModelError, Pinhole, PinholeModel, Reference};
use algo::pattern::{PhaseFunction, PhaseFunctionError, Shot, Waveform};
use hal::error::Error;
use hal::frame::Frame;
use hal::model::{DeviceModel, PlaneModel};
use hal::replay::recording::{PatternSpec, RecordedFrame};

/// Borrows a device's frame without a copy.
///
/// # Errors
/// If the frame's samples do not make up its size.
pub fn view(frame: &Frame) -> Result<FrameView<'_>, FrameError> {
    let format = frame.format();
    let samples = match frame.samples() {
        hal::frame::Samples::Eight(samples) => Samples::Eight(samples),
        hal::frame::Samples::Sixteen(samples) => Samples::Sixteen(samples),
    };
    FrameView::new(
        samples,
        format.width as usize,
        format.height as usize,
        format.stride,
    )
}

/// A device with frames or rasters of `(columns, rows)`, its model checked: each pixel has one ray.
///
/// # Errors
/// A number of the model is absurd.
pub fn pinhole(
    device: &'static str,
    model: &DeviceModel,
    (columns, rows): (u32, u32),
) -> Result<Pinhole, Failure> {
    Pinhole::new(pinhole_model(model), columns as usize, rows as usize)
        .map_err(|error| absurd(device, &error))
}

/// The failure of a device, camera or projector, whose model has an absurd number.
pub fn absurd(device: &str, error: &ModelError) -> Failure {
    Failure::new(Exit::Content, format!("the {device}'s model: {error}"))
}

/// A device model as geometry takes it.
pub fn pinhole_model(model: &DeviceModel) -> PinholeModel {
    PinholeModel {
        fx: model.fx,
        fy: model.fy,
        cx: model.cx,
        cy: model.cy,
        distortion: model.distortion,
        rotation: model.rotation,
        translation: model.translation_mm,
    }
}

/// The model of a checked device, as files store it.
pub fn device_model(device: &Pinhole) -> DeviceModel {
    let model = device.model();
    DeviceModel {
        fx: model.fx,
        fy: model.fy,
        cx: model.cx,
        cy: model.cy,
        distortion: model.distortion,
        rotation: model.rotation,
        translation_mm: model.translation,
    }
}

/// How projector points on the reference plane are found: by the models, and by what measured ones
/// over frames of `(columns, rows)` are off them.
pub fn reference(plane: Option<&PlaneModel>, (columns, rows): (u32, u32)) -> Reference {
    let map = |coefficients| FittedMap::new(columns as usize, rows as usize, coefficients);
    match plane {
        Some(plane) => Reference::Measured {
            xi: map(plane.xi),
            eta: map(plane.eta),
        },
        None => Reference::Models,
    }
}

/// The phase function of a recorded pattern on a projector of `columns` × `rows` pixels.
///
/// # Errors
/// If no projector can show it.
pub fn phase_function(
    spec: &PatternSpec,
    columns: usize,
    rows: usize,
) -> Result<PhaseFunction, PhaseFunctionError> {
    match spec {
        PatternSpec::Vertical { fringes } => PhaseFunction::vertical(columns, rows, *fringes),
        PatternSpec::Horizontal { fringes } => PhaseFunction::horizontal(columns, rows, *fringes),
        PatternSpec::File { turns, .. } => PhaseFunction::sampled(columns, rows, turns.clone()),
    }
}

/// Vertical or else horizontal fringes of `pitch` pixels on a projector of `(columns, rows)`.
///
/// # Errors
/// `Unsupported` if the projector is too small for them.
pub fn fringes(
    vertical: bool,
    (columns, rows): (u32, u32),
    pitch: f64,
) -> Result<PhaseFunction, Error> {
    let (width, height) = (columns as usize, rows as usize);
    let function = match vertical {
        true => PhaseFunction::vertical(width, height, f64::from(columns) / pitch),
        false => PhaseFunction::horizontal(width, height, f64::from(rows) / pitch),
    };
    function.map_err(|error| small(pitch, &error))
}

/// That a projector is too small for fringes of `pitch` pixels.
pub fn small(pitch: f64, problem: &dyn std::fmt::Display) -> Error {
    Error::unsupported(
        format!("fringes of {pitch} px: {problem}, which"),
        "use a projector of more pixels",
    )
}

/// What a recorded frame shows.
pub fn shot(recorded: &RecordedFrame) -> Shot {
    Shot {
        ratio: recorded.ratio,
        shift: recorded.shift_turns,
        waveform: Waveform::of(&recorded.harmonics),
    }
}

/// A frame as a recording of one pattern holds it.
pub fn recorded(shot: Shot, frame: Frame) -> RecordedFrame {
    RecordedFrame {
        ratio: shot.ratio,
        shift_turns: shot.shift,
        harmonics: shot.waveform.harmonics().collect(),
        pattern: 0,
        timestamp_ns: Some(frame.timestamp().0),
        frame,
    }
}
