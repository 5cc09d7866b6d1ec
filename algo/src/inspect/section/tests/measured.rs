//! Errors and their uncertainty.

use super::joint::{Chance, Joint, truth};
use crate::inspect::section::{
    JointValue, Knowledge, Section, Side, Unseen, Why, flush, gap, radius,
};
use std::vec::Vec;

/// Nothing, or depth and light of a floor below.
const FLOORS: [Option<(f64, f64)>; 4] =
    [None, Some((18.0, 1.0)), Some((13.0, 0.5)), Some((4.0, 0.5))];
/// Placements of each floor.
const PLACEMENTS: u64 = 40;
/// The first: the constants of the fit were chosen on others.
const FIRST: u64 = 1000;
const NAMES: [&str; 4] = ["gap", "flush", "left radius", "right radius"];
/// σ of a stated radius, mm.
const STATED: f64 = 0.03;

fn values(
    joint: &Joint,
    rendered: &super::joint::Rendered,
    seed: u64,
    stated: bool,
) -> Result<[JointValue; 4], Unseen> {
    let mut request = joint.request();
    if stated {
        let (left, right) = Chance::new(seed + 7).normal();
        let [one, other] = joint.radii;
        request.edge_mm = [Some(one + STATED * left), Some(other + STATED * right)];
    }
    let section = Section::new(&rendered.capture(seed, 1.0), &request, &joint.optics())?;
    let known = Knowledge {
        radius: Some(STATED),
        ..Knowledge::default()
    };
    let inputs = section.inputs(&known);
    let value = |f: &dyn Fn(&_) -> f64| section.value(f, &inputs).unwrap();
    Ok([
        value(&gap),
        value(&flush),
        value(&|geometry| radius(geometry, Side::Left)),
        value(&|geometry| radius(geometry, Side::Right)),
    ])
}

/// Errors in µm over placements, the share inside U, and the share of sections that are measured.
fn errors(pixel: f64, floor: Option<(f64, f64)>, stated: bool) -> ([Vec<f64>; 4], [f64; 4], f64) {
    let (mut all, mut inside): ([Vec<f64>; 4], _) = (Default::default(), [0.0; 4]);
    for seed in FIRST..FIRST + PLACEMENTS {
        let mut joint = Joint::draw(pixel, &mut Chance::new(seed));
        joint.floor = floor;
        let values = match values(&joint, &joint.rendered(), seed, stated) {
            Ok(values) => values,
            Err(unseen) => {
                std::println!("{seed}: {unseen}, radii {:.2?}", joint.radii);
                continue;
            }
        };
        let (gap, flush) = truth(&joint);
        let is = [gap, flush, joint.radii[0], joint.radii[1]];
        for i in 0..4 {
            let off = values[i].value - is[i];
            all[i].push(off * 1e3);
            inside[i] += f64::from(u8::from(
                off.abs() <= 2.0 * values[i].sigma.hypot(values[i].systematic),
            ));
        }
    }
    let count = all[0].len() as f64;
    (
        all,
        inside.map(|inside| inside / count),
        count / PLACEMENTS as f64,
    )
}

fn check(pixel: f64, stated: bool, most: [f64; 2], least: f64) {
    let (mut within, mut count) = (0.0, 0.0);
    let (mut worst, mut fewest) = ([0.0_f64; 2], 1.0_f64);
    for floor in FLOORS {
        let (all, inside, seen) = errors(pixel, floor, stated);
        for i in 0..4 {
            let n = all[i].len() as f64;
            let bias = all[i].iter().sum::<f64>() / n;
            let rms = (all[i].iter().map(|off| off * off).sum::<f64>() / n).sqrt();
            std::println!(
                "{pixel} stated {stated} floor {floor:?} {}: bias {bias:.1} rms {rms:.1} µm, {:.2} inside U, {seen:.2} seen",
                NAMES[i],
                inside[i]
            );
            // A stated radius says nothing of what is measured.
            if i < 2 || !stated {
                within += inside[i] * n;
                count += n;
            }
            if i < 2 {
                worst[i] = worst[i].max(bias.abs());
            }
        }
        fewest = fewest.min(seen);
    }
    std::println!("{pixel} stated {stated}: {:.3} inside U", within / count);
    assert!(worst[0] <= most[0] && worst[1] <= most[1], "{worst:?} µm");
    assert!(fewest >= least, "{fewest} seen");
    assert!(within >= 0.93 * count);
}

#[test]
fn fine_pixels_measure_gap_and_flush_above_any_floor() {
    check(0.145, false, [30.0, 10.0], 0.9);
}

#[test]
fn coarse_pixels_measure_gap_and_flush_with_stated_radii() {
    check(0.41, true, [40.0, 10.0], 0.9);
}

#[test]
fn coarse_pixels_are_refused_where_no_radius_is_stated() {
    for (floor, rows) in FLOORS
        .into_iter()
        .flat_map(|floor| [(floor, 1), (floor, 4)])
    {
        for seed in FIRST..FIRST + PLACEMENTS {
            let mut joint = Joint::draw(0.41, &mut Chance::new(seed));
            joint.floor = floor;
            // Wide sections have less noise.
            joint.rows *= rows;
            let unseen = values(&joint, &joint.rendered(), seed, false).unwrap_err();
            let is_remedied = std::format!("{unseen}").ends_with("state edge_mm");
            let is_shapeless = matches!(unseen.why, Why::NotRound | Why::Edgeless);
            assert!(is_remedied || is_shapeless, "{unseen}");
        }
    }
}

#[test]
fn the_scatter_of_repeats_is_what_sigma_says() {
    let (mut squares, mut count) = ([0.0; 4], 0.0);
    for seed in 0..6 {
        let joint = Joint::draw(0.145, &mut Chance::new(seed));
        let rendered = joint.rendered();
        let repeats = (0..12).filter_map(|repeat| values(&joint, &rendered, repeat, false).ok());
        let repeats: Vec<_> = repeats.collect();
        let n = repeats.len() as f64;
        for i in 0..4 {
            let mean = repeats.iter().map(|values| values[i].value).sum::<f64>() / n;
            let square =
                |values: &[JointValue; 4]| ((values[i].value - mean) / values[i].sigma).powi(2);
            squares[i] += repeats.iter().map(square).sum::<f64>();
        }
        count += n - 1.0;
    }
    let ratios = squares.map(|sum| (sum / count).sqrt());
    let all = (squares.iter().sum::<f64>() / (4.0 * count)).sqrt();
    std::println!("scatter over σ {ratios:.2?}, of all {all:.2}");
    assert!((0.8..1.25).contains(&all), "{ratios:?}");
}
