//! Flat plates, whose heights leave x, y and the turn about z open, are placed by their holes.

use crate::every_part::{Line, way};
use crate::gauges::frames;
use crate::placement::{bed, one_click};
use crate::surroundings::{everywhere, plate};
use algo::inspect::Placed;
use appliance::head::seam;
use sim::parts::Defect;
use sim::{Ground, Part, Placement, Scenario};
use tests::random::Random;

/// Components of a motion that heights of a flat plate leave open: x, y in mm, the turn about z in degrees.
const OPEN: [usize; 3] = [0, 1, 5];
/// Largest RMS of their errors that is promised.
const LARGEST_RMS: [f64; 3] = [0.01, 0.01, 0.01];
/// So many σ are exceeded by none of a few values.
const SURE: f64 = 4.0;

/// A plate on a floor, taught with one click.
fn line(floor: Option<Ground>) -> Line {
    let mut bed = bed(&Scenario {
        part: plate(),
        floor,
        ..Scenario::default()
    });
    let recipe = one_click(&mut bed).unwrap().recipe;
    Line::of(bed, recipe, 0.15, plate())
}

/// How a part is found to lie.
fn placed(line: &mut Line, part: &Part, lies: &Placement) -> Placed {
    line.bed.stage.place(part, lies).unwrap();
    let frames = frames(&mut line.bed, &line.plan, 0);
    let views: Vec<_> = frames.iter().map(|of| seam::view(of).unwrap()).collect();
    let production = line.plan.production();
    let mut strips = production.strips(64);
    let found = production.inspect(&views, &mut strips, None);
    found.unwrap().placed.unwrap()
}

/// What the open components are off by, and σ; `None` if they are not determined.
fn errors(found: &Placed, lies: &Placement) -> Option<[(f64, f64); 3]> {
    let shift = way(lies, found.motion.centre);
    let truth = [shift.x, shift.y, lies.rotation_deg];
    let error = |at: usize| {
        let (value, sigma) = found.component(OPEN[at])?;
        Some((value - truth[at], sigma))
    };
    Some([error(0)?, error(1)?, error(2)?])
}

/// Fails unless plates that lie at so many places are found there. Returns the scatter of each component over its
/// stated σ.
fn are_found(name: &str, line: &mut Line, placements: usize) -> [f64; 3] {
    let mut random = Random::new(11);
    let mut all = Vec::new();
    for _ in 0..placements {
        let lies = line.placement(&mut random);
        let found = placed(line, &plate(), &lies);
        all.push(errors(&found, &lies).unwrap_or_else(|| panic!("{name}: {lies:?}")));
    }
    std::array::from_fn(|at| {
        let rms = |of: fn((f64, f64)) -> f64| {
            let squares = all.iter().map(|errors| of(errors[at]).powi(2));
            (squares.sum::<f64>() / all.len() as f64).sqrt()
        };
        let (error, sigma) = (rms(|of| of.0), rms(|of| of.1));
        println!("{name}, {}: RMS {error:.5}, σ {sigma:.5}", OPEN[at]);
        assert!(error <= LARGEST_RMS[at], "{name}: {error}");
        error / sigma
    })
}

#[test]
fn a_flat_plate_is_placed_by_its_holes_and_one_that_lies_elsewhere_pulls_it_nowhere() {
    let mut line = line(Some(Ground::default()));
    are_found("grey 20", &mut line, 4);
    let mut part = plate();
    part.defects_mut().unwrap().push(Defect::DisplacedHole {
        index: 0,
        dx: 0.3,
        dy: -0.2,
    });
    let lies = Placement {
        shift_mm: [0.3, -0.2, 0.1],
        ..Placement::default()
    };
    let found = placed(&mut line, &part, &lies);
    for (off, sigma) in errors(&found, &lies).into_iter().flatten() {
        assert!(off.abs() <= SURE * sigma, "{off} ± {sigma}");
    }
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_flat_plate_is_placed_by_its_holes_in_all_surroundings() {
    let all = everywhere().into_iter();
    let ratios = all.map(|(name, floor)| are_found(name, &mut line(floor), 10));
    let ratios: Vec<[f64; 3]> = ratios.collect();
    for at in 0..OPEN.len() {
        let squares = ratios.iter().map(|of| of[at] * of[at]).sum::<f64>();
        let ratio = (squares / ratios.len() as f64).sqrt();
        println!("{}: scatter over σ {ratio:.2}", OPEN[at]);
        assert!(ratio < 1.25, "{ratio}");
    }
}
