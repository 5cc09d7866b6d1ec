//! Holes: errors, scatter, uncertainty, and share of the rim that is seen.

use super::placed::{Figures, Many, figures, sheet};
use super::scene::{Noise, Scene};
use std::vec::Vec;

/// Largest mean error of x, y and diameter in px: 5 µm at 0.41 mm per px, 1.7 at 0.145.
const BIAS_PX: f64 = 0.012;
/// The same where a thick wall is seen and lit.
const BIAS_WALL_PX: f64 = 0.018;
/// Largest mean uncertainty over the root mean square of errors. 2 would be the least that holds.
const WIDE: f64 = 3.5;
const FLOOR: Option<(f64, f64)> = Some((18.0, 1.0));

fn report(name: &str, scene: &Scene<'_>, r: f64, many: Many) -> Figures {
    let all = figures(scene, r, many);
    let Figures {
        bias,
        error,
        u,
        within,
        scatter,
        sigma,
        least,
        rim,
        blur,
    } = all;
    let (px, noise) = (scene.mm_per_px, scene.noise);
    std::println!(
        "{name:14} {px:5} r {r:4} {noise:7?}: bias {bias:4.1} rms {error:4.1} U {u:4.1} µm, \
         within {within:.2}, scatter/σ {scatter:.2}, σ {sigma:3.1}, rim {least:.2} {rim:.2}, \
         blur {blur:.2}"
    );
    all
}

/// Radii of both cameras, with both noises.
fn cases(name: &str, placements: u64, change: impl Fn(&mut Scene<'_>)) -> Vec<(f64, Figures)> {
    let mut all = Vec::new();
    for (px, radii) in [(0.41, &[3.0, 5.0][..]), (0.145, &[2.0][..])] {
        for noise in [Noise::Uniform, Noise::Quiet] {
            for &r in radii {
                let mut scene = sheet(px);
                scene.noise = noise;
                change(&mut scene);
                let many = Many {
                    placements,
                    captures: 4,
                    is_told: true,
                };
                all.push((px, report(name, &scene, r, many)));
            }
        }
    }
    all
}

/// Fails if holes are off by more than `bias` px, less of a rim than `rim` is seen, or scatter or
/// uncertainty are not what was predicted.
fn check(all: &[(f64, Figures)], bias: f64, rim: f64) {
    for (px, figures) in all {
        assert!(figures.bias <= bias * px * 1e3, "{figures:?}");
        assert!(figures.rim >= rim, "{figures:?}");
        // A hole has three numbers, and few captures: single cases scatter by ± 20 %.
        assert!((0.5..1.6).contains(&figures.scatter), "{figures:?}");
    }
    let count = all.len() as f64;
    let mean = |of: fn(&Figures) -> f64| all.iter().map(|(_, f)| of(f)).sum::<f64>() / count;
    let scatter = mean(|f| f.scatter * f.scatter).sqrt();
    let within = mean(|f| f.within);
    let wide = mean(|f| f.u) / mean(|f| f.error);
    std::println!("together: scatter/σ {scatter:.2}, within U {within:.3}, U/error {wide:.1}");
    assert!((0.8..1.2).contains(&scatter), "{scatter}");
    assert!(within >= 0.93, "{within}");
    assert!(wide <= WIDE, "{wide}");
}

#[test]
fn holes_above_nothing() {
    check(&cases("dark", 3, |_| {}), BIAS_PX, 0.95);
}

#[test]
fn holes_in_a_thick_sheet_before_a_real_lens() {
    let change = |scene: &mut Scene<'_>| (scene.thickness, scene.blur) = (1.0, 0.5);
    check(&cases("1 mm, blur", 3, change), BIAS_PX, 0.95);
}

#[test]
fn holes_above_a_floor_as_bright_as_the_sheet() {
    let change = |scene: &mut Scene<'_>| scene.floor = FLOOR;
    check(&cases("bright", 3, change), BIAS_PX, 0.75);
}

#[test]
fn holes_in_everything_together() {
    let change = |scene: &mut Scene<'_>| {
        (scene.floor, scene.thickness) = (FLOOR, 1.0);
        (scene.blur, scene.ambient) = (0.5, 0.2);
    };
    check(&cases("all", 3, change), BIAS_PX, 0.70);
}

#[test]
fn tilted_holes_whose_walls_are_seen() {
    for tilt in [12.0, -12.0] {
        for floor in [None, FLOOR] {
            let change = |scene: &mut Scene<'_>| {
                (scene.floor, scene.thickness, scene.tilt) = (floor, 1.0, (tilt, 0.0));
            };
            let all = cases("tilted", 2, change);
            for (px, figures) in &all {
                assert!(figures.bias <= BIAS_WALL_PX * px * 1e3, "{figures:?}");
                assert!(figures.rim >= 0.75, "{figures:?}");
            }
        }
    }
}

#[test]
fn large_holes() {
    for (floor, rim) in [(None, 0.95), (FLOOR, 0.9)] {
        let mut scene = sheet(0.41);
        scene.floor = floor;
        let many = Many {
            placements: 2,
            captures: 4,
            is_told: true,
        };
        let figures = report("large", &scene, 15.0, many);
        assert!(figures.bias <= BIAS_PX * 410.0, "{figures:?}");
        assert!(figures.rim >= rim && figures.within > 0.9, "{figures:?}");
        assert!((0.6..1.6).contains(&figures.scatter), "{figures:?}");
    }
}

#[test]
fn a_thickness_that_is_not_told_widens_the_uncertainty_as_far_as_it_moves_the_edges() {
    let mut within = Vec::new();
    for (px, r) in [(0.41, 3.0), (0.41, 5.0), (0.145, 2.0)] {
        for (thickness, tilt) in [(0.5, 12.0), (1.0, 12.0), (1.0, -12.0), (2.0, 12.0)] {
            let mut scene = sheet(px);
            (scene.thickness, scene.tilt) = (thickness, (tilt, 0.0));
            let many = Many {
                placements: 3,
                captures: 1,
                is_told: false,
            };
            within.push(report("not told", &scene, r, many).within);
        }
    }
    let mean = within.iter().sum::<f64>() / within.len() as f64;
    assert!(mean >= 0.93, "{within:?}");
}

#[test]
#[ignore = "minutes: many placements, of which the tests above see a few"]
fn uncertainties_in_many_placements() {
    let mut all = Vec::new();
    for tilt in [0.0, 12.0, -12.0] {
        for (floor, blur) in [(None, 0.3), (FLOOR, 0.5)] {
            for (thickness, is_told) in [(0.0, true), (1.0, true), (1.0, false)] {
                for noise in [Noise::Quiet, Noise::Uniform] {
                    for (px, r) in [(0.41, 3.0), (0.41, 5.0), (0.145, 3.0)] {
                        let mut scene = sheet(px);
                        (scene.tilt, scene.floor, scene.blur) = ((tilt, 0.0), floor, blur);
                        (scene.thickness, scene.noise) = (thickness, noise);
                        let many = Many {
                            placements: 12,
                            captures: 1,
                            is_told,
                        };
                        let name = std::format!("{tilt} {thickness} {is_told}");
                        all.push(report(&name, &scene, r, many));
                    }
                }
            }
        }
    }
    let mean = |of: fn(&Figures) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let (within, wide) = (mean(|f| f.within), mean(|f| f.u) / mean(|f| f.error));
    std::println!("together: within U {within:.3}, U/error {wide:.1}");
    assert!(within >= 0.95 && wide <= WIDE, "{within} {wide}");
}
