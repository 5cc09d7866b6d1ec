//! Options for the part in front of a simulated head.

use super::numbers::{number, numbers};
use crate::config::{Backend, HeadConfig};
use crate::error::{Exit, Failure, Result};
use crate::head::placed::Placed;
use crate::production::backend;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use hal::bounds::{MAX_PLACEMENT_MM, MAX_ROTATION_DEG, MAX_TILT_DEG, clipped};
use sim::Material;
use sim::parts::Board;

/// The part in front of a simulated head, if not the scenario's.
#[derive(Clone, Debug, Default, PartialEq, clap::Args)]
pub struct SimulatedPart {
    /// Put this stock part in front of the simulated head: sheet_metal, flowerpot, cone, sawtooth,
    /// sphere, tube, spline, face, handset, plane, board or empty.
    #[arg(long, value_name = "KIND")]
    part: Option<String>,
    /// Give the simulated part a defect: dent:X,Y,DEPTH,DIAMETER in mm along its normal, or of
    /// sheet_metal missing_hole:INDEX or bent_flange:DEGREES; more than once for more.
    #[arg(long, value_name = "KIND:NUMBERS")]
    defect: Vec<String>,
    /// What the simulated part is made of: matte, rolled_steel or oiled. If it is left out, the
    /// scenario's light says how a part reflects.
    #[arg(long, value_name = "NAME", value_parser = material())]
    material: Option<Material>,
    /// Place the simulated board in this one of the ten poses that are recommended for a
    /// calibration; 10 lies in z = 0.
    #[arg(long, value_name = "NUMBER", value_parser = number(1, Board::POSES.len() as u8), conflicts_with_all = ["shift", "tilt", "rotate"])]
    pose: Option<u8>,
    /// Move the simulated part by this, mm.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>(MAX_PLACEMENT_MM), allow_hyphen_values = true)]
    shift: Option<[f64; 3]>,
    /// Tilt the simulated part about x and y, degrees.
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>(MAX_TILT_DEG), allow_hyphen_values = true)]
    tilt: Option<[f64; 2]>,
    /// Turn the simulated part about z, degrees.
    #[arg(long, value_name = "DEGREES", value_parser = number(-MAX_ROTATION_DEG, MAX_ROTATION_DEG), allow_hyphen_values = true)]
    rotate: Option<f64>,
}

impl SimulatedPart {
    /// The part that the options describe, if any is given.
    ///
    /// # Errors
    /// If the configured head is not simulated, or there is no such part, defect or placement (64).
    pub fn placed(&self, head: &HeadConfig) -> Result<Option<Placed>> {
        if *self == Self::default() {
            return Ok(None);
        }
        let usage =
            |words: String| Failure::because(Exit::Usage, "put a part in front of the head", words);
        if head.backend != Backend::Sim {
            return Err(usage(
                "the configured head is not simulated: leave out --part, --defect, --material, --pose, --shift, --tilt and --rotate".into(),
            ));
        }
        let scenario = backend::scenario(head.scenario.as_deref())?;
        let mut placed = match &self.part {
            Some(kind) => Placed::stock(kind).map_err(usage)?,
            None => Placed {
                part: scenario.part,
                material: scenario.material,
                placement: scenario.placement,
            },
        };
        placed.material = self.material.or(placed.material);
        for defect in &self.defect {
            let added = placed.add_defect(defect).and_then(|()| placed.check());
            added.map_err(|words| usage(format!("--defect {}: {words}", clipped(defect))))?;
        }
        if let Some(pose) = self.pose {
            let posed = placed.pose(pose);
            posed.map_err(|words| usage(format!("--pose: {words}")))?;
        }
        let place = &mut placed.placement;
        place.shift_mm = self.shift.unwrap_or(place.shift_mm);
        place.tilt_deg = self.tilt.unwrap_or(place.tilt_deg);
        place.rotation_deg = self.rotate.unwrap_or(place.rotation_deg);
        placed.check().map_err(usage)?;
        Ok(Some(placed))
    }
}

/// A material by its name.
fn material() -> impl TypedValueParser<Value = Material> {
    let names = Material::ALL.map(|(_, name)| name);
    PossibleValuesParser::new(names).try_map(|name| {
        let known = Material::ALL.iter().find(|(_, known)| *known == name);
        known
            .map(|(material, _)| *material)
            .ok_or("no such material")
    })
}
