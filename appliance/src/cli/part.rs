//! Options for the part in front of a simulated head.

use super::numbers::{number, numbers};
use crate::config::{Backend, HeadConfig};
use crate::error::{Exit, Failure, Result};
use crate::head::placed::Placed;
use crate::production::backend;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use hal::bounds::{Bound, Fields, MAX_PLACEMENT_MM, MAX_ROTATION_DEG, MAX_TILT_DEG, clipped};
use sim::parts::Board;
use sim::{Ground, Material};

/// The part in front of a simulated head, if not the scenario's.
#[derive(Clone, Debug, Default, PartialEq, clap::Args)]
pub struct SimulatedPart {
    /// Put this stock part in front of the simulated head: sheet_metal, flowerpot, cone, sawtooth,
    /// sphere, tube, spline, face, handset, plane, board, empty, plate or joint.
    #[arg(long, value_name = "KIND")]
    part: Option<String>,
    /// Give the simulated part a defect: dent:X,Y,DEPTH,DIAMETER in mm along its normal, of sheet_metal and plate
    /// missing_hole:INDEX, of sheet_metal bent_flange:DEGREES, of plate displaced_hole:INDEX,DX,DY or
    /// hole_radius:INDEX,RADIUS; more than once for more.
    #[arg(long, value_name = "KIND:NUMBERS")]
    defect: Vec<String>,
    /// What the simulated part is made of: matte, rolled_steel or oiled. If it is left out, the
    /// scenario's light says how a part reflects.
    #[arg(long, value_name = "NAME", value_parser = material())]
    material: Option<Material>,
    /// Lay the simulated part over a floor that reflects ALBEDO, 0 to 1, so many mm below its lowest point; "none" is
    /// black space. If it is left out, the floor is the scenario's.
    #[arg(long, value_name = "ALBEDO,DEPTH", value_parser = floor)]
    floor: Option<Lies>,
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
                "the configured head is not simulated: leave out --part, --defect, --material, --floor, --pose, --shift, --tilt and --rotate".into(),
            ));
        }
        let scenario = backend::scenario(head.scenario.as_deref())?;
        let mut placed = match &self.part {
            Some(kind) => Placed::stock(kind).map_err(usage)?,
            None => Placed {
                part: scenario.part,
                material: scenario.material,
                placement: scenario.placement,
                floor: None,
            },
        };
        placed.material = self.material.or(placed.material);
        placed.floor = self.floor.clone().map(|lies| lies.0);
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

/// A floor below a part, or none.
#[derive(Clone, Debug, PartialEq)]
struct Lies(Option<Ground>);

fn floor(given: &str) -> Result<Lies, String> {
    if given == "none" {
        return Ok(Lies(None));
    }
    let pair = given.split_once(',');
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let pair = pair.and_then(|(albedo, depth)| number(albedo).zip(number(depth)));
    let (albedo, depth_mm) = pair.ok_or("write ALBEDO,DEPTH as in 0.35,20, or none")?;
    let ground = Ground {
        albedo,
        depth_mm,
        ..Ground::default()
    };
    Fields.check("floor", &ground)?;
    Ok(Lies(Some(ground)))
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
