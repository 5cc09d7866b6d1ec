//! A head, a part and the measurements that teaching and experiments are made of.

use crate::head::calibration::Calibration;
use crate::head::rasters::rasters;
use crate::head::seam;
use algo::geometry::{HeightRange, Reference, Triangulator};
use algo::pattern::{PhaseFunction, Sequence, Shot};
use algo::phase::Decoder;
use algo::pipeline::{self, HeightMap, PhaseMap};
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
    /// If the calibration is absurd.
    pub fn triangulator(&self, function: &PhaseFunction) -> Result<Triangulator, RigError> {
        let (camera, projector) = self.calibration.devices().map_err(rig)?;
        Triangulator::new(
            camera,
            projector,
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
        let sequence = Sequence::from_frames(shots).map_err(rig)?;
        let bit_depth = self.calibration.camera.2;
        let decoder = Decoder::new(&sequence, function.range(), bit_depth).map_err(rig)?;
        let triangulator = self.triangulator(function)?;
        self.head
            .load(rasters(function, shots, self.calibration)?)?;
        let mut taken = Vec::with_capacity(shots.len());
        let indices: Vec<usize> = (0..shots.len()).collect();
        self.head.acquire(&indices, self.timeout, &mut |_, frame| {
            taken.push(frame);
            progress(taken.len() as f64 / shots.len() as f64);
        })?;
        let views = taken
            .iter()
            .map(seam::view)
            .collect::<Result<Vec<_>, _>>()
            .map_err(rig)?;
        let reference;
        let map = match about {
            _ if !decoder.unwrapping().needs_map() => None,
            About::Map(map) => Some(map),
            About::Reference => {
                reference = triangulator.reference_map();
                Some(&reference[..])
            }
        };
        let mut phases = pipeline::decode(&decoder, &views, map, None).map_err(rig)?;
        let noise = Some(self.calibration.noise_counts);
        let heights =
            pipeline::triangulate(&triangulator, &decoder, noise, None, None, &mut phases);
        Ok(Measured {
            phases,
            heights,
            decoder,
            triangulator,
            frames: taken,
        })
    }
}
