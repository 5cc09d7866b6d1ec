//! From views of a board to an adjusted rig, or the pose that does not fit.

use super::adjust::{Adjusted, Undetermined, adjust};
use super::board::{Board, median};
use super::initial::{self, Correspondence, Mirrored};
use super::look::BoardView;
use super::rig::{Pose, Rig, SHARED, ray};
use crate::geometry::Vector;
use crate::math::solve::Normal;
use alloc::vec::Vec;
use core::array::from_fn;

/// Least poses: three determine the models without redundancy.
const LEAST_POSES: usize = 3;
/// Least angle between two of the board's normals, rad: with parallel boards focal lengths and
/// distances cannot be separated.
const LEAST_TILT: f64 = 10.0 / 180.0 * core::f64::consts::PI;
/// Poses from which the board's bow is adjusted: with fewer, it cannot be separated from the
/// lenses' distortion.
const BOWED_FROM: usize = 6;
/// χ² of three degrees of freedom that a flat board exceeds once in 10⁶.
const BOWED: f64 = 31.8;
/// Largest RMS residual of a pose, camera or projector px.
const MOST_RESIDUAL: f64 = 1.0;
/// A pose whose residuals are this many times the median pose's, and above so many px, is not of
/// this board and head.
const OUTLYING: (f64, f64) = (3.0, 0.3);
/// A pose whose blur is this many times the median pose's, and above so many px, is out of focus.
const BLURRED: (f64, f64) = (2.5, 1.0);
/// Largest relative σ of a focal length.
const MOST_FOCAL_SIGMA: f64 = 0.01;

/// Views that give no calibration; poses are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// There are too few poses.
    #[error(
        "{given} poses are given, at least {LEAST_POSES} are needed and 6 to 10 are recommended: take more, tilted to all sides"
    )]
    Few {
        /// How many poses there are.
        given: usize,
    },
    /// The board lies parallel in all poses.
    #[error(
        "the board is tilted by {degrees:.1}° between the poses at most: tilt it by 20 to 40° to all sides"
    )]
    NotTilted {
        /// The largest angle between two normals, degrees.
        degrees: f64,
    },
    /// One pose is blurred.
    #[error(
        "its picture is blurred: edges have a σ of {blur:.1} px, {median:.1} px in the other poses: hold the board still and in focus"
    )]
    Blurred {
        /// The pose.
        pose: usize,
        /// σ of its edges, px.
        blur: f64,
        /// Median of all poses, px.
        median: f64,
    },
    /// One pose does not fit the others.
    #[error(
        "its residuals are {camera:.2} camera px and {projector:.2} projector px, {median:.2} and less in the other poses: the board moved or was bent, or it is another one: take this pose again"
    )]
    Outlying {
        /// The pose.
        pose: usize,
        /// RMS in the camera, px.
        camera: f64,
        /// RMS in the projector, px.
        projector: f64,
        /// Median of the larger of both over the poses, px.
        median: f64,
    },
    /// All poses together do not fit.
    #[error(
        "the residuals are {camera:.2} camera px and {projector:.2} projector px, largest in this pose: check focus, that frames and patterns belong together, and that the board is flat"
    )]
    Residual {
        /// The pose with the largest residuals.
        pose: usize,
        /// RMS in the camera, px.
        camera: f64,
        /// RMS in the projector, px.
        projector: f64,
    },
    /// All poses fit if one axis of the projector's raster is reversed.
    #[error(
        "the picture of the camera or of the projector is mirrored: all poses fit if one of them is reversed: turn off its mirroring (flip, rear projection), and take all poses again"
    )]
    Mirrored,
    /// All poses fit if ξ and η are exchanged.
    #[error(
        "vertical and horizontal fringes have changed places: all poses fit if they are exchanged: record or import the frames of the vertical fringes first, or turn off the mirroring of camera or projector if they are"
    )]
    Swapped,
    /// The poses do not determine the models.
    #[error(transparent)]
    Undetermined(#[from] Undetermined),
}

impl CalibrationError {
    /// The pose at fault, if a single one is.
    pub fn pose(&self) -> Option<usize> {
        match self {
            Self::Blurred { pose, .. }
            | Self::Outlying { pose, .. }
            | Self::Residual { pose, .. } => Some(*pose),
            _ => None,
        }
    }
}

/// Calibrates camera and projector with all views of a board. `frame` is the size of the camera's
/// picture.
///
/// # Errors
/// If the views do not determine the models, one of them does not fit the others, or a picture is
/// mirrored.
pub fn calibrate(
    board: &Board,
    frame: (usize, usize),
    views: &[BoardView],
) -> Result<Adjusted, CalibrationError> {
    if views.len() < LEAST_POSES {
        return Err(CalibrationError::Few { given: views.len() });
    }
    sharp(views)?;
    match first(board, frame, views).ok_or(Undetermined)? {
        Ok(rig) => adjusted(rig, views),
        // The finding is named only if nothing else is wrong.
        Err(mirrored) => {
            let righted: Vec<BoardView> = views.iter().map(|view| mirrored.righted(view)).collect();
            let rig = first(board, frame, &righted).and_then(Result::ok);
            adjusted(rig.ok_or(Undetermined)?, &righted)?;
            Err(match mirrored {
                Mirrored::Axis => CalibrationError::Mirrored,
                Mirrored::Swapped => CalibrationError::Swapped,
            })
        }
    }
}

/// First values of the geometry of these views, with angles right within a few degrees; `None` if
/// the views are too few or do not determine it.
pub fn estimate(board: &Board, frame: (usize, usize), views: &[BoardView]) -> Option<Rig> {
    if views.len() < LEAST_POSES {
        return None;
    }
    first(board, frame, views)?.ok()
}

/// Adjusts a rig from first values, and checks what is left.
fn adjusted(first: Rig, views: &[BoardView]) -> Result<Adjusted, CalibrationError> {
    let flat = adjust(first, views, false)?;
    fits(&flat)?;
    let bowed = (views.len() >= BOWED_FROM)
        .then(|| adjust(flat.rig.clone(), views, true).ok())
        .flatten()
        .filter(|bowed| bowed.bow_chi_square() > BOWED);
    let adjusted = bowed.unwrap_or(flat);
    let degrees = adjusted.largest_tilt().to_degrees();
    if degrees < LEAST_TILT.to_degrees() {
        return Err(CalibrationError::NotTilted { degrees });
    }
    let focal = adjusted.rig.camera.fx;
    if !(adjusted.sigma_of(0) <= MOST_FOCAL_SIGMA * focal) {
        return Err(Undetermined.into());
    }
    Ok(adjusted)
}

/// First values in closed form; the error says how one picture is mirrored, `None` that the views
/// do not determine them.
fn first(
    board: &Board,
    frame: (usize, usize),
    views: &[BoardView],
) -> Option<Result<Rig, Mirrored>> {
    let pairs: Vec<Vec<Correspondence>> = views
        .iter()
        .map(|view| {
            let corners = view.found.corners.iter().enumerate();
            let pair = corners.filter_map(|(at, corner)| {
                corner.map(|corner| (board.place(at), (corner.u, corner.v)))
            });
            pair.collect()
        })
        .collect();
    let (camera, poses) = initial::camera(board, frame, &pairs)?;
    let mut points = Vec::new();
    for (view, pose) in views.iter().zip(&poses) {
        let back = pose.inverse();
        for node in &view.nodes {
            let ray = ray(&camera, node.at)?;
            let (from, along) = (back.shift, back.turned(ray));
            points.push((ray * (-from.z / along.z), node.lit_by));
        }
    }
    let rig = initial::projector(&points)?.map(|(projector, relative)| Rig {
        board: *board,
        camera,
        projector,
        relative,
        poses,
        bow: [0.0; 3],
    });
    Some(rig)
}

impl Mirrored {
    /// The view by a projector that is not mirrored.
    fn righted(self, view: &BoardView) -> BoardView {
        let mut righted = view.clone();
        for node in &mut righted.nodes {
            let (xi, eta) = node.lit_by;
            node.lit_by = match self {
                Self::Axis => (-xi, eta),
                Self::Swapped => (eta, xi),
            };
        }
        righted
    }
}

/// Checks that no pose is much less sharp than the others.
fn sharp(views: &[BoardView]) -> Result<(), CalibrationError> {
    let median = median(views.iter().map(|view| view.found.blur()));
    for (pose, view) in views.iter().enumerate() {
        let blur = view.found.blur();
        if blur > BLURRED.0 * median && blur > BLURRED.1 {
            return Err(CalibrationError::Blurred { pose, blur, median });
        }
    }
    Ok(())
}

/// Checks that the residuals are small, and those of no pose much larger than the others'.
fn fits(adjusted: &Adjusted) -> Result<(), CalibrationError> {
    let each: Vec<[f64; 2]> = adjusted
        .residuals
        .iter()
        .map(|pose| pose.map(|residuals| residuals.rms()))
        .collect();
    let larger = |rms: &[f64; 2]| rms[0].max(rms[1]);
    let worst = (0..each.len()).max_by(|&a, &b| larger(&each[a]).total_cmp(&larger(&each[b])));
    let Some(pose) = worst else { return Ok(()) };
    let [camera, projector] = each[pose];
    let median = median(each.iter().map(larger));
    let rms = larger(&each[pose]);
    if rms > OUTLYING.0 * median && rms > OUTLYING.1 {
        return Err(CalibrationError::Outlying {
            pose,
            camera,
            projector,
            median,
        });
    }
    if rms > MOST_RESIDUAL {
        return Err(CalibrationError::Residual {
            pose,
            camera,
            projector,
        });
    }
    Ok(())
}

impl Adjusted {
    /// The largest angle between the board's normals in two poses, rad.
    pub fn largest_tilt(&self) -> f64 {
        let normal = |pose: &Pose| pose.turned(Vector::new(0.0, 0.0, 1.0));
        let normals: Vec<Vector> = self.rig.poses.iter().map(normal).collect();
        let mut largest = 0.0_f64;
        for (i, a) in normals.iter().enumerate() {
            for b in &normals[i + 1..] {
                largest = largest.max(libm::atan2(a.cross(*b).length(), a.dot(*b)));
            }
        }
        largest
    }

    /// σ of one of the rig's numbers.
    fn sigma_of(&self, number: usize) -> f64 {
        libm::sqrt(self.covariance[number * self.rig.numbers() + number])
    }

    /// The squared length of the board's bow in its own standard deviations: χ² of three degrees of
    /// freedom if the board is flat.
    fn bow_chi_square(&self) -> f64 {
        let all = self.rig.numbers();
        let row = |i| from_fn(|j| self.covariance[(SHARED - 3 + i) * all + SHARED - 3 + j]);
        let (matrix, right) = (from_fn(row), self.rig.bow);
        Normal { matrix, right }.solve().map_or(0.0, |solved| {
            solved.iter().zip(&self.rig.bow).map(|(a, b)| a * b).sum()
        })
    }
}
