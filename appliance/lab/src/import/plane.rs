//! The plane z = 0 of models that state none: the one that fits the measured points best.

use crate::Failed;
use algo::geometry::{Pinhole, Vector};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use appliance::head::channel::Channel;
use appliance::head::code::CodeAlone;
use appliance::head::seam;
use appliance::measure::least_modulation;
use hal::model::DeviceModel;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;

/// Most pixels that are used, about.
const MOST: usize = 40_000;
/// Fewer points make no plane.
const LEAST: usize = 100;
/// How far from the camera points are sought first, in baselines.
const BASELINES: f64 = 4.0;
/// Newton steps to a point of a ray; ξ is nearly linear in the depth's reciprocal.
const STEPS: usize = 6;
/// Step of the numeric derivative along the ray, as a share of the depth.
const SHARE: f64 = 1e-5;
/// Fits of the plane; each leaves out the points that were far off the one before.
const FITS: usize = 12;
/// A point is far off if its distance is more than this many times the median distance.
const FAR: f64 = 4.0;

/// Moves the world of a recording's models, whose camera stands at the origin and looks along −z,
/// so that the plane that fits the measured points best is z = 0, and says where that is.
///
/// # Errors
/// In words: there are no absolute phases or too few points in front of both devices.
pub(super) fn fit(recording: &mut Recording) -> Result<String, Failed> {
    let remedy = "give the distance of the plane z = 0 from the camera with --plane-at";
    let points = points(recording).map_err(|error| {
        format!("the models state no plane z = 0, and none can be fitted to the measurement ({error}): {remedy}")
    })?;
    let [height, right, down] = plane(points);
    let normal = Vector::new(-right, -down, 1.0);
    let z = normal * (1.0 / normal.length());
    let along = Vector::new(1.0, 0.0, 0.0);
    let x = along - z * along.dot(z);
    let x = x * (1.0 / x.length());
    let axes = [x, z.cross(x), z];
    let origin = Vector::new(0.0, 0.0, height);
    let models = [&mut recording.camera_model, &mut recording.projector.model];
    for model in models.into_iter().flatten() {
        move_world(model, axes, origin);
    }
    Ok(format!(
        "the models state no plane z = 0, and the one that fits the measured points best was taken: {:.1} mm from the camera along its \
         axis, tilted by {:.1}° against its picture: {remedy}, or the pose of a plate in plate_R and plate_T",
        -height,
        z.z.acos().to_degrees()
    ))
}

/// The device in a world with these axes and this origin.
fn move_world(model: &mut DeviceModel, axes: [Vector; 3], origin: Vector) {
    let rows: [Vector; 3] = std::array::from_fn(|row| {
        let [x, y, z] = std::array::from_fn(|column| model.rotation[3 * row + column]);
        Vector::new(x, y, z)
    });
    for (row, old) in rows.into_iter().enumerate() {
        model.translation_mm[row] += old.dot(origin);
        for (column, axis) in axes.into_iter().enumerate() {
            model.rotation[3 * row + column] = old.dot(axis);
        }
    }
}

/// Measured points of the world.
fn points(recording: &Recording) -> Result<Vec<Vector>, Failed> {
    let raster = &recording.projector;
    let frames = (recording.width, recording.height);
    let models = recording.camera_model.as_ref().zip(raster.model.as_ref());
    let (camera, projector) = models.ok_or("there are no models")?;
    let camera = seam::pinhole("camera", camera, frames)?;
    let projector = seam::pinhole("projector", projector, (raster.width, raster.height))?;
    let straight = recording.patterns.iter().enumerate();
    let straight = straight.filter_map(|(at, spec)| match spec {
        PatternSpec::Vertical { fringes } => Some((at, true, f64::from(raster.width) / fringes)),
        PatternSpec::Horizontal { fringes } => {
            Some((at, false, f64::from(raster.height) / fringes))
        }
        PatternSpec::File { .. } => None,
    });
    let telling = |vertical: bool, pitch: f64| {
        change(&camera, &projector, vertical).map_or(0.0, |pixels| pixels / pitch)
    };
    let (pattern, vertical, pitch) = straight
        .max_by(|a, b| telling(a.1, a.2).total_cmp(&telling(b.1, b.2)))
        .ok_or("its fringes are not straight")?;
    let map = absolute(recording, pattern)?;
    let every = map.phase.len().div_ceil(MOST).max(1);
    let resolved = (0..map.phase.len())
        .step_by(every)
        .filter(|&at| map.trust[at] == Trust::Resolved);
    let (mut seen, mut found) = (0, Vec::new());
    for at in resolved {
        seen += 1;
        let pixel = ((at % map.width) as f64, (at / map.width) as f64);
        let place = map.phase[at].turns() * pitch;
        found.extend(point(&camera, &projector, pixel, (vertical, place)));
    }
    match seen {
        0..LEAST => Err(format!("only {seen} of the pixels looked at are resolved").into()),
        _ if 2 * found.len() < seen => Err(format!(
            "{} of {seen} measured points would lie behind the camera: are R and T from the camera to the projector?",
            seen - found.len()
        )
        .into()),
        _ => Ok(found),
    }
}

/// The absolute phase of a pattern by its own levels or code.
///
/// # Errors
/// In words: it has none, and what to add.
pub(super) fn absolute(recording: &Recording, pattern: usize) -> Result<PhaseMap, Failed> {
    let least = least_modulation(recording);
    if let Some(code) = CodeAlone::of(recording, pattern)? {
        return Ok(code.phases(least)?);
    }
    let channel = Channel::new(recording, pattern, least)?;
    let by_itself = channel.unwrapping(None, &Err("there is no known map".into()))?;
    match by_itself.missing() {
        None => Ok(channel.decode(&by_itself)?.absolute),
        Some(missing) => Err(missing.into()),
    }
}

/// By how many pixels the projector's column or row changes along the ray of the frame's middle,
/// from a few baselines to twice as far.
fn change(camera: &Pinhole, projector: &Pinhole, vertical: bool) -> Option<f64> {
    let (width, height) = (camera.width() as f64, camera.height() as f64);
    let (centre, ray) = (camera.centre(), camera.ray(width / 2.0, height / 2.0)?);
    let near = BASELINES * (projector.centre() - centre).length();
    let (from, to) = (
        projector.project(centre + ray * near)?,
        projector.project(centre + ray * (2.0 * near))?,
    );
    let change = if vertical {
        to.0 - from.0
    } else {
        to.1 - from.1
    };
    Some(change.abs())
}

/// The point of a pixel's ray that the projector sees in this column or row; `None` if it is not in
/// front of both.
fn point(
    camera: &Pinhole,
    projector: &Pinhole,
    (u, v): (f64, f64),
    (vertical, place): (bool, f64),
) -> Option<Vector> {
    let (centre, ray) = (camera.centre(), camera.ray(u, v)?);
    let beside = (projector.centre() - centre).length();
    let off = |depth: f64| {
        let (xi, eta) = projector.project(centre + ray * depth)?;
        Some(if vertical { xi } else { eta } - place)
    };
    // In 1 / depth, in which a projector's coordinate is nearly linear; from a depth of a few
    // baselines.
    let mut near = 1.0 / (BASELINES * beside);
    for _ in 0..STEPS {
        let step = SHARE * near;
        let (here, next) = (off(1.0 / near)?, off(1.0 / (near + step))?);
        near -= here * step / (next - here);
        if !(near > 0.0) {
            return None;
        }
    }
    let left = off(1.0 / near)?;
    (left.abs() < 1e-3).then(|| centre + ray * (1.0 / near))
}

/// a, b, c of the plane z = a + b x + c y by least squares over the points that lie near it.
fn plane(points: Vec<Vector>) -> [f64; 3] {
    let mut near = points.clone();
    let mut found = [0.0; 3];
    for _ in 0..FITS {
        found = least_squares(&near);
        let [a, b, c] = found;
        let off = |point: &Vector| (point.z - a - b * point.x - c * point.y).abs();
        let mut offs: Vec<f64> = points.iter().map(off).collect();
        let middle = offs.len() / 2;
        let (_, median, _) = offs.select_nth_unstable_by(middle, f64::total_cmp);
        let limit = FAR * *median + 1e-9;
        near = points
            .iter()
            .filter(|point| off(point) <= limit)
            .copied()
            .collect();
    }
    found
}

fn least_squares(points: &[Vector]) -> [f64; 3] {
    let share = 1.0 / points.len().max(1) as f64;
    let sum = points
        .iter()
        .fold(Vector::default(), |sum, point| sum + *point);
    let mean = sum * share;
    let (mut xx, mut xy, mut yy, mut xz, mut yz) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for point in points {
        let p = *point - mean;
        xx += p.x * p.x;
        xy += p.x * p.y;
        yy += p.y * p.y;
        xz += p.x * p.z;
        yz += p.y * p.z;
    }
    let determinant = xx * yy - xy * xy;
    let (b, c) = match determinant > 1e-9 * (xx + yy) * (xx + yy) {
        true => (
            (xz * yy - yz * xy) / determinant,
            (yz * xx - xz * xy) / determinant,
        ),
        false => (0.0, 0.0),
    };
    [mean.z - b * mean.x - c * mean.y, b, c]
}
