//! A head, a part and the measurements that teaching and experiments are made of.

use crate::head::calibration::Calibration;
use crate::head::scan::{self, Scan};
use algo::geometry::{HeightRange, Reference, Triangulator};
use algo::pattern::{PhaseFunction, Shot};
use algo::phase::Decoder;
use algo::pipeline::{HeightMap, PhaseMap};
use algo::units::AbsolutePhase;
use hal::frame::Frame;
use hal::head::DynHead;
use std::time::Duration;

/// A head with its calibration, for measurements that no recipe describes yet.
pub struct Rig<'a> {
    /// The devices.
    pub head: &'a mut DynHead,
    /// What is known of them.
    pub calibration: &'a Calibration,
    /// Working range; none = the default.
    pub range: Option<HeightRange>,
    /// Longest wait for a device.
    pub timeout: Duration,
}

/// What a sequence is unwrapped about.
#[derive(Clone, Copy, Debug)]
pub enum About<'a> {
    /// Nothing: the sequence is absolute, or is unwrapped about the reference phase map.
    Reference,
    /// A known map, row-major.
    Map(&'a [AbsolutePhase]),
}

/// A measured part.
#[derive(Debug)]
pub struct Measured {
    /// Phase, modulation and trust.
    pub phases: PhaseMap,
    /// Height and σ_z.
    pub heights: HeightMap,
    /// How it was decoded.
    pub decoder: Decoder,
    /// The geometry with its phase function.
    pub triangulator: Triangulator,
    /// The frames, in the order of the sequence.
    pub frames: Vec<Frame>,
}

/// A measurement that failed.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// A device failed.
    #[error(transparent)]
    Device(#[from] hal::error::Error),
    /// The pattern, the sequence or the rig is impossible.
    #[error("{0}")]
    Impossible(String),
}

fn rig(error: impl std::fmt::Display) -> RigError {
    RigError::Impossible(error.to_string())
}

impl Rig<'_> {
    /// The geometry for a phase function.
    ///
    /// # Errors
    /// If the devices do not look down at the plane from two places, or the range is unusable.
    pub fn triangulator(&self, function: &PhaseFunction) -> Result<Triangulator, RigError> {
        Triangulator::new(
            self.calibration.camera.clone(),
            self.calibration.projector.clone(),
            Reference::Models,
            function.clone(),
            self.range,
        )
        .map_err(rig)
    }

    /// Projects the shots of a phase function and measures the part.
    /// `progress` is told the share of the frames taken.
    ///
    /// # Errors
    /// If a device fails or the sequence cannot be decoded.
    pub fn measure(
        &mut self,
        function: &PhaseFunction,
        shots: &[Shot],
        about: About<'_>,
        progress: &dyn Fn(f64),
    ) -> Result<Measured, RigError> {
        let triangulator = self.triangulator(function)?;
        let (calibration, timeout) = (self.calibration, self.timeout);
        let frames = scan::take(self.head, calibration, function, shots, timeout, progress)?;
        let scan = Scan::new(function.range(), shots, &frames).map_err(rig)?;
        let reference;
        let map = match about {
            _ if !scan.needs_map() => None,
            About::Map(map) => Some(map),
            About::Reference => {
                reference = triangulator.reference_map();
                Some(&reference[..])
            }
        };
        let mut phases = scan.phases(map).map_err(rig)?;
        let noise = Some(calibration.noise_counts);
        let heights = scan.heights(&triangulator, noise, &mut phases);
        Ok(Measured {
            phases,
            heights,
            decoder: scan.decoder,
            triangulator,
            frames,
        })
    }
}
