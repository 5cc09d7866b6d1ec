//! Inputs of a contour's uncertainty beside noise: by how much its parameters are off for one
//! standard uncertainty of each.

use super::associate::EdgePoint;
use super::beyond::{Wall, slope};
use super::find::Contour;
use super::light::Setup;
use super::piece::dot;
use super::shape::{Parameters, Shape};
use alloc::vec::Vec;

/// A shift of every edge towards its material, px: by the model of the edge. Diameters of rendered
/// holes of 3 and 5 mm at 0.41 mm per px, and of 3 mm at 0.145, are off by −0.003 to 0.008 px in the
/// mean of their placements, above a dark and a bright floor, before sharp and blurred cameras.
const EDGE_PX: f64 = 0.0025;
/// What the edge of one piece is off by how it lies among the pixels, px: different in each piece.
/// Diameters and centres of these holes scatter from placement to placement by 0.0075 px of a piece,
/// above a bright floor by a quarter more.
pub const PIECE_PX: f64 = 0.01;
/// The shift of edges, px, where as much light as the material's is not explained. Above floors 1 and
/// 2 fringes lower, where 2 % are not, centres and radii are off by 2 to 8 µm at 0.41 mm per px.
const LIGHT_PX: f64 = 0.6;
/// The shift of edges beside a wall, px for a wall as bright as the face. Tilted
/// by 12°, where walls have 0.09 of the light, edges are off by 0.005 to 0.008 px.
const WALL_PX: f64 = 0.07;
/// The share of the radius of a rounded rim by which its far side is uncertain: the light has
/// fallen by half there.
const FAR_SIDE: f64 = 0.2;

/// What is uncertain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContourSource {
    /// Every edge of the part lies towards its material.
    Edge,
    /// The radius of the rim.
    Rim,
    /// How an edge lies among the pixels, and light there that is not explained.
    Pixels,
    /// What is seen of a wall.
    Wall,
}

impl ContourSource {
    /// Whether it is another one wherever the part lies.
    pub fn is_of_place(self) -> bool {
        matches!(self, Self::Pixels | Self::Wall)
    }
}

/// An input of the uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourInput {
    /// What is uncertain.
    pub source: ContourSource,
    /// By how much each parameter is off for one standard uncertainty.
    pub off: Parameters,
}

/// The inputs of a contour that was found, whose rim has this radius, mm. What is uncertain of the
/// plane and of all lengths is not among them: it is the same for planes and contours
/// (`gauge/propagate.rs`).
pub fn inputs(shape: &dyn Shape, contour: &Contour, setup: &Setup, rim: f64) -> Vec<ContourInput> {
    let p = &contour.parameters;
    let into = |point: &EdgePoint| {
        let along = shape.along(p, point.x, point.y).unwrap_or(0.0);
        shape.foot(p, along).normal
    };
    let lean = |point: &EdgePoint| slope(setup.camera, point.x, point.y);
    let of = |source, shift: &dyn Fn(&EdgePoint) -> f64| ContourInput {
        source,
        off: contour.response(shape, shift),
    };
    let mut inputs = Vec::new();
    let pixel = contour.pixel;
    inputs.push(of(ContourSource::Edge, &|_| EDGE_PX * pixel));
    inputs.push(of(ContourSource::Rim, &|point| {
        // α is how far the line of sight leans over the material.
        let lean = dot(lean(point), into(point)).max(0.0);
        let near = 1.0 + lean - libm::sqrt(1.0 + lean * lean);
        rim * near.max(FAR_SIDE) / libm::sqrt(3.0)
    }));
    if rim > 0.0 {
        // The side that leans towards the camera is seen farther around than the other.
        let aside = |point: &EdgePoint| rim * dot(lean(point), into(point)) / libm::sqrt(3.0);
        inputs.push(of(ContourSource::Rim, &aside));
    }
    for i in 0..shape.count() {
        let rate = |point: &EdgePoint| shape.derivative(p, point.x, point.y)[i];
        let squares = contour.points.iter().map(|point| rate(point) * rate(point));
        let mut off = Parameters::default();
        // Of light that is not explained all pieces of a side may be off alike.
        let light = LIGHT_PX * contour.unexplained;
        let of_all = PIECE_PX * PIECE_PX + light * light * contour.points.len() as f64;
        off[i] = pixel * libm::sqrt(of_all / squares.sum::<f64>());
        inputs.push(ContourInput {
            source: ContourSource::Pixels,
            off,
        });
    }
    // Where it is not known whether there is a wall there may be one.
    let thickness = setup.thickness.unwrap_or(1.0);
    inputs.push(of(ContourSource::Wall, &|point| {
        let wall = Wall::at(setup, thickness, (point.x, point.y), into(point));
        WALL_PX * contour.pixel * wall.map_or(0.0, |wall| wall.brightness)
    }));
    if let Some(off) = contour.wall {
        inputs.push(ContourInput {
            source: ContourSource::Wall,
            off,
        });
    }
    inputs
}
