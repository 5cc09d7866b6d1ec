//! Calibration of the geometry through the simulator: a head of unknown lens and pose takes a board
//! in ten poses.

use appliance::head::calibration::Calibration;
use appliance::head::geometry::{Geometry, SeenPose};
use appliance::head::{rasters::rasters, seam};
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use sim::optics::Lens;
use sim::parts::Board;
use sim::{Part, Scenario};
use std::time::Duration;
use tests::random::Random;

/// Most RMS error of heights over the measuring volume, and of lengths of 100 mm in it, mm.
const HEIGHT_MM: f64 = 0.015;
const LENGTH_MM: f64 = 0.030;
/// σ of a board's scale, parts per million.
const SIGMA_PPM: f64 = 200.0;
/// Bow of the board, µm.
const BOW_UM: f64 = 30.0;
/// Half the sides of the volume in which errors are looked at, mm, and the places along each.
const VOLUME_MM: f64 = 50.0;
const PLACES: usize = 5;
/// Levels of each direction.
const LEVELS: usize = 3;
const TIMEOUT: Duration = Duration::from_secs(5);

/// How a head takes the board.
struct Taking {
    /// Camera columns and rows.
    side: u32,
    /// Rays per camera pixel along each side.
    sub_rays: u32,
    board: Board,
    /// Projector pixels per fringe of the finest level.
    pitch: f64,
    /// Shifts of each level.
    steps: usize,
}

/// A head near the default one: both lenses, distances and angles are off by some percent, optics
/// and noise are those of a good head.
fn head_of(random: &mut Random, taking: &Taking, scale_ppm: f64, bow_um: f64) -> Scenario {
    let mut scenario = Scenario {
        sub_rays: taking.sub_rays,
        part: Part::Board(Board {
            bow_um,
            scale_ppm,
            ..taking.board.clone()
        }),
        ..Scenario::default()
    };
    scenario.noise.noise_counts = Some(1.5);
    scenario.noise.seed = random.bits();
    (
        scenario.optics.camera_blur_px,
        scenario.optics.projector_blur_px,
    ) = (0.5, 1.0);
    let rig = &mut scenario.rig;
    (rig.camera.width, rig.camera.height) = (taking.side, taking.side);
    for device in [&mut rig.camera, &mut rig.projector] {
        let mut by = |low: f64, high: f64| low + (high - low) * random.share();
        device.fov_deg[0] *= by(1.0, 1.03);
        device.fov_deg[1] *= by(1.0, 1.03);
        device.angle_deg += by(-2.0, 2.0);
        device.distance_mm *= by(1.0, 1.02);
        device.distortion[0] += by(-0.05, 0.05);
        device.distortion[1] += by(-0.05, 0.05);
        device.distortion[2] = by(-5e-4, 5e-4);
        device.distortion[3] = by(-5e-4, 5e-4);
    }
    scenario
}

/// Takes the board in every recommended pose and makes the models from the frames.
fn calibrated(scenario: &Scenario, taking: &Taking) -> Geometry {
    let board = algo::calibration::Board {
        columns: taking.board.columns,
        rows: taking.board.rows,
        square: taking.board.square_mm,
    };
    // Of the true models only the sizes are used.
    let sizes = Calibration::of_scenario(scenario).unwrap();
    let (columns, rows) = sizes.raster();
    let patterns = vec![
        PatternSpec::Vertical {
            fringes: f64::from(columns) / taking.pitch,
        },
        PatternSpec::Horizontal {
            fringes: f64::from(rows) / taking.pitch,
        },
    ];
    let (mut shown, mut shots) = (Vec::new(), Vec::new());
    for (pattern, spec) in patterns.iter().enumerate() {
        let function = seam::phase_function(spec, columns as usize, rows as usize).unwrap();
        let of = algo::pattern::Sequence::geometric(function.range(), LEVELS, taking.steps);
        shown.extend(rasters(&function, &of, &sizes).unwrap());
        shots.extend(of.into_iter().map(|shot| (pattern, shot)));
    }
    let (mut head, stage) = sim::head(scenario).unwrap();
    head.load(shown).unwrap();
    let indices: Vec<usize> = (0..shots.len()).collect();
    let seen = Board::POSES.iter().enumerate().map(|(at, pose)| {
        stage.place(&scenario.part, pose).unwrap();
        let mut taken = Vec::new();
        head.acquire(&indices, TIMEOUT, &mut |_, frame| taken.push(frame))
            .unwrap();
        let frames = taken
            .into_iter()
            .zip(&shots)
            .map(|(frame, (pattern, shot))| {
                let mut recorded = seam::recorded(*shot, frame);
                recorded.pattern = *pattern;
                recorded
            });
        let mut recording = Recording {
            patterns: patterns.clone(),
            frames: frames.collect(),
            camera_model: None,
            ..sizes.recording()
        };
        recording.projector.model = None;
        let name = format!("pose-{}", at + 1);
        SeenPose::of(&recording, &name, &board).unwrap_or_else(|error| panic!("{name}: {error}"))
    });
    let seen: Vec<SeenPose> = seen.collect();
    Geometry::of(&board, SIGMA_PPM, &seen).unwrap()
}

/// RMS errors of heights over the volume, and of lengths of 100 mm along x, y and z in it, mm:
/// points that both devices see are measured with the models found, by the ray of their camera
/// pixel and their ξ.
fn errors(scenario: &Scenario, found: &Geometry) -> (f64, f64) {
    let rig = &scenario.rig;
    let lenses = [&rig.camera, &rig.projector].map(|device| (Lens::new(device.model()), device));
    let mut points = Vec::new();
    for at in 0..PLACES.pow(3) {
        let place = |at: usize| VOLUME_MM * (2.0 * at as f64 / (PLACES - 1) as f64 - 1.0);
        let truth = [
            place(at % PLACES),
            place(at / PLACES % PLACES),
            place(at / PLACES / PLACES),
        ];
        let seen = lenses.each_ref().map(|(lens, device)| {
            let [u, v] = lens.project(truth)?;
            let inside = |at: f64, pixels: u32| (0.0..f64::from(pixels)).contains(&at);
            (inside(u, device.width) && inside(v, device.height)).then_some([u, v])
        });
        let [Some([u, v]), Some([xi, _])] = seen else {
            continue;
        };
        let (centre, ray) = (found.camera.centre(), found.camera.ray(u, v).unwrap());
        let at = |z: f64| centre + ray * ((z - centre.z) / ray.z);
        let off = |z: f64| found.projector.project(at(z)).unwrap().0 - xi;
        let mut z = truth[2];
        for _ in 0..8 {
            z -= off(z) / (off(z + 1e-3) - off(z - 1e-3)) * 2e-3;
        }
        points.push((truth, at(z)));
    }
    assert!(points.len() > 100, "{} points", points.len());
    let rms = |errors: &[f64]| {
        (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
    };
    // The board's last pose is the world; turned by 180° about z it looks the same.
    let heights: Vec<f64> = points
        .iter()
        .map(|(truth, found)| found.z - truth[2])
        .collect();
    let mut lengths = Vec::new();
    for (i, (a, found)) in points.iter().enumerate() {
        for (b, other) in &points[i + 1..] {
            let apart: Vec<f64> = (0..3).map(|axis| (b[axis] - a[axis]).abs()).collect();
            let length: f64 = apart.iter().sum();
            if apart.iter().filter(|apart| **apart > 0.0).count() == 1 && length > 1.9 * VOLUME_MM {
                lengths.push(((*other - *found).length() / length - 1.0) * 100.0);
            }
        }
    }
    (rms(&heights), rms(&lengths))
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn ten_poses_of_a_bowed_board_of_wrong_scale_calibrate_a_simulated_head_of_unknown_lens_and_pose() {
    let taking = Taking {
        side: 512,
        sub_rays: 3,
        board: Board::default(),
        pitch: 12.0,
        steps: 6,
    };
    let scenario = head_of(&mut Random::new(1), &taking, SIGMA_PPM, BOW_UM);
    let found = calibrated(&scenario, &taking);
    let (height, length) = errors(&scenario, &found);
    println!(
        "heights {:.1} µm RMS (σ {:.1}), lengths of 100 mm {:.1} µm (σ {:.1}), camera {:.3} px, projector {:.3} px, bow {:?}",
        height * 1e3,
        found.prediction.height * 1e3,
        length * 1e3,
        found.prediction.length * 1e3,
        found.file.camera_px,
        found.file.projector_px,
        found.file.board.bow_mm,
    );
    assert!(height <= HEIGHT_MM, "{height}");
    assert!(length <= LENGTH_MM, "{length}");
}

/// Small frames of few large squares, so that 50 heads take minutes.
#[test]
#[ignore = "minutes: `.ci/run full` does it"]
fn the_predicted_errors_cover_the_true_ones_of_50_simulated_heads() {
    let taking = Taking {
        side: 320,
        sub_rays: 2,
        board: Board {
            columns: 6,
            rows: 8,
            square_mm: 16.0,
            ..Board::default()
        },
        pitch: 24.0,
        steps: 4,
    };
    let mut within = [[0; 2]; 2];
    for seed in 0..50 {
        let mut random = Random::new(100 + seed);
        // The sum of twelve uniform numbers is nearly normal, with a variance of 1.
        let normal: f64 = (0..12).map(|_| random.share()).sum::<f64>() - 6.0;
        let scale = SIGMA_PPM * normal;
        let bow = BOW_UM * (2.0 * random.share() - 1.0);
        let scenario = head_of(&mut random, &taking, scale, bow);
        let found = calibrated(&scenario, &taking);
        let (height, length) = errors(&scenario, &found);
        for (sigmas, within) in [1.0, 2.0].into_iter().zip(&mut within) {
            within[0] += i32::from(height <= sigmas * found.prediction.height);
            within[1] += i32::from(length <= sigmas * found.prediction.length);
        }
    }
    println!(
        "of 50 heads, heights and lengths: within 1 σ {:?}, within 2 σ {:?}",
        within[0], within[1]
    );
    for of in 0..2 {
        assert!((25..=43).contains(&within[0][of]), "within 1 σ: {within:?}");
        assert!(within[1][of] >= 45, "within 2 σ: {within:?}");
    }
}
