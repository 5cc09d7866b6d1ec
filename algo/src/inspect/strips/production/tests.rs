//! Made-up frames of a plate with holes that is moved.

use crate::frame::{FrameView, SampleNoise, Samples};
use crate::geometry::{Pinhole, PinholeModel, Reference, Triangulator, Vector};
use crate::inspect::align::{Motion, Placed};
use crate::inspect::feature::{Feature, FeatureKind};
use crate::inspect::gauge::Measure;
use crate::inspect::strips::{CalibrationUncertainty, Gauge, Input, Parts, Production};
use crate::inspect::{Largest, Region, Taught, Weight};
use crate::pattern::{PhaseFunction, Sequence, Shot};
use crate::phase::Decoder;
use crate::pipeline::{HeightCubics, KnownSurface, arrive_rest, for_each_row};
use crate::units::{AbsolutePhase, Height, Modulation};
use alloc::sync::Arc;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec;
use std::vec::Vec;

const SIDE: usize = 256;
/// What a pixel sees, mm.
const PIXEL_MM: f64 = 0.4;
/// Height of the plate and of the floor, mm.
const TOP: f64 = 8.0;
const FLOOR: f64 = -20.0;
/// Light of the plate in counts: offset and modulation; the floor has a share of both.
const LIGHT: (f64, f64) = (110.0, 90.0);
const FLOOR_SHARE: f64 = 0.04;
const NOISE: f64 = 1.0;
/// Places along the side of a pixel that its light is the mean of.
const PLACES: usize = 3;
/// Pixels beside an edge without a height in golden.
const BESIDE: f64 = 2.0;
/// How far parts are moved at most, pixels.
const AWAY: f64 = 8.0;
/// How well the picture finds a plate, pixels.
const EXACT_PX: f64 = 0.05;

/// Middle (x, y) and radius of holes, mm.
type Holes = &'static [(f64, f64, f64)];
const HOLES: Holes = &[
    (-22.0, -14.0, 1.5),
    (19.0, -18.0, 3.0),
    (14.0, 21.0, 2.0),
    (-17.0, 16.0, 4.0),
    (2.0, -3.0, 6.0),
];
const OTHERS: Holes = &[(-9.0, -25.0, 5.0), (25.0, 2.0, 4.0), (-27.0, 1.0, 3.0)];

/// A part: a plate with holes, flat or with hills.
#[derive(Clone, Copy)]
struct Plate {
    holes: Holes,
    /// Half its sides, mm.
    half: (f64, f64),
    hills_mm: f64,
}

const PLATE: Plate = Plate {
    holes: HOLES,
    half: (36.0, 33.0),
    hills_mm: 0.0,
};
const HILLS: Plate = Plate {
    hills_mm: 1.7,
    ..PLATE
};
/// Larger than the frame.
const BLANK: Plate = Plate {
    holes: &[],
    half: (500.0, 500.0),
    ..PLATE
};

impl Plate {
    fn height(&self, x: f64, y: f64) -> f64 {
        TOP + self.hills_mm * (libm::sin(x / 6.0) + libm::cos(y / 7.0))
    }

    /// Distance of a place from the nearest edge, mm; negative off the plate.
    fn inside(&self, x: f64, y: f64) -> f64 {
        let rim = (self.half.0 - x.abs()).min(self.half.1 - y.abs());
        let beside = |&(u, v, r): &(f64, f64, f64)| libm::hypot(x - u, y - v) - r;
        self.holes.iter().map(beside).fold(rim, f64::min)
    }
}

fn device(angle: f64, size: usize) -> Pinhole {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let focal = 600.0 / PIXEL_MM * size as f64 / SIDE as f64;
    let model = PinholeModel {
        fx: focal,
        fy: focal,
        cx: (size - 1) as f64 / 2.0,
        cy: (size - 1) as f64 / 2.0,
        distortion: [-0.12, 0.15, 2e-4, -3e-4, 0.0],
        rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
        translation: [0.0, 0.0, 600.0],
    };
    Pinhole::new(model, size, size).unwrap()
}

/// A head, and the frames that it takes.
struct Head {
    triangulator: Arc<Triangulator>,
    shots: Vec<Shot>,
    sequence: Sequence,
}

/// What a place sees of the plate and of the floor: brightness, and phase in turns.
type Seen = [(f64, f64); 2];

impl Head {
    fn new() -> Self {
        let function = PhaseFunction::vertical(1024, 1024, 60.0).unwrap();
        let shots = Sequence::geometric(function.range(), 3, 3);
        let devices = (device(0.2, SIDE), device(-0.15, 1024));
        let models = Reference::Models;
        let triangulator = Triangulator::new(devices.0, devices.1, models, function, None);
        Self {
            triangulator: Arc::new(triangulator.unwrap()),
            sequence: Sequence::from_frames(&shots).unwrap(),
            shots,
        }
    }

    /// The height at which a place of the frame sees a moved plate, and the point as taught.
    fn on_plate(&self, plate: &Plate, motion: &Motion, (u, v): (f64, f64)) -> (f64, Vector) {
        let camera = self.triangulator.camera();
        let ray = camera.ray(u, v).unwrap();
        let at = |z: f64| camera.centre() + ray * ((z - camera.centre().z) / ray.z);
        let (mut z, mut taught) = (TOP, Vector::default());
        for _ in 0..if plate.hills_mm == 0.0 { 4 } else { 20 } {
            taught = motion.undo(at(z));
            z += plate.height(taught.x, taught.y) - taught.z;
        }
        (z, taught)
    }

    fn seen(
        &self,
        plate: &Plate,
        motion: &Motion,
        (u, v): (usize, usize),
    ) -> [Seen; PLACES * PLACES] {
        core::array::from_fn(|i| {
            let beside = |i: usize| (i as f64 + 0.5) / PLACES as f64 - 0.5;
            let (u, v) = (u as f64 + beside(i % PLACES), v as f64 + beside(i / PLACES));
            let (z, taught) = self.on_plate(plate, motion, (u, v));
            // An edge cuts the place that a sample stands for.
            let covered = plate.inside(taught.x, taught.y) / PIXEL_MM * PLACES as f64 + 0.5;
            let covered = covered.clamp(0.0, 1.0);
            let sight = self.triangulator.sight(u, v).unwrap();
            let lit = |share, z| (share, sight.phase(z).unwrap_or_default());
            [lit(covered, z), lit((1.0 - covered) * FLOOR_SHARE, FLOOR)]
        })
    }

    /// The frames of a moved plate.
    fn frames(&self, plate: &Plate, motion: &Motion) -> Vec<Vec<u8>> {
        let count = self.shots.len();
        let mut pixels = vec![0; SIDE * SIDE * count];
        for_each_row(&mut pixels, SIDE * count, |v, row| {
            let mut random = SplitMix64::seed_from_u64(v as u64);
            let mut uniform = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            for (u, samples) in row.chunks_mut(count).enumerate() {
                let seen = self.seen(plate, motion, (u, v));
                for (sample, shot) in samples.iter_mut().zip(&self.shots) {
                    let light = |&(share, phase): &(f64, f64)| {
                        let turns = shot.ratio * phase + shot.shift;
                        let sine = libm::sin(core::f64::consts::TAU * turns);
                        share * (LIGHT.0 + LIGHT.1 * sine)
                    };
                    let sum = seen.as_flattened().iter().map(light).sum::<f64>();
                    let light = sum / seen.len() as f64;
                    let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                    *sample = libm::rint(light + NOISE * noise) as u8;
                }
            }
        });
        let frame = |at: usize| pixels.iter().skip(at).step_by(count).copied().collect();
        (0..count).map(frame).collect()
    }

    /// Golden's modulation, counts.
    fn modulation(&self, plate: &Plate) -> Vec<f32> {
        let still = Motion::none(Vector::default());
        let mut modulation = vec![0.0; SIDE * SIDE];
        for_each_row(&mut modulation, SIDE, |v, row| {
            for (u, counts) in row.iter_mut().enumerate() {
                let seen = self.seen(plate, &still, (u, v));
                let share = seen
                    .as_flattened()
                    .iter()
                    .map(|(share, _)| share)
                    .sum::<f64>();
                *counts = (LIGHT.1 * share / seen.len() as f64) as f32;
            }
        });
        modulation
    }

    /// Production of a plate, with a gauge of how much of the hole in the middle is covered.
    fn production(&self, plate: &Plate) -> Production {
        let still = Motion::none(Vector::default());
        let mut pixels = vec![(Height::UNKNOWN, AbsolutePhase::UNKNOWN); SIDE * SIDE];
        for_each_row(&mut pixels, SIDE, |v, row| {
            for (u, pixel) in row.iter_mut().enumerate() {
                let place = (u as f64, v as f64);
                let (z, taught) = self.on_plate(plate, &still, place);
                pixel.0 = Height::from_mm(z);
                if plate.inside(taught.x, taught.y) > BESIDE * PIXEL_MM {
                    let phase = self.triangulator.sight(place.0, place.1).unwrap().phase(z);
                    pixel.1 = AbsolutePhase::from_turns(phase.unwrap());
                }
            }
        });
        let taught = Taught::new(pixels.iter().map(|(_, phase)| match phase.is_known() {
            true => (Weight::FULL, 1.0, 0.005),
            false => (Weight::NONE, 1.0, f64::NAN),
        }));
        let surface = KnownSurface {
            width: SIDE,
            height: pixels.iter().map(|pixel| pixel.0).collect(),
            phase: pixels.iter().map(|pixel| pixel.1).collect(),
        };
        let window = vec![0..SIDE; SIDE];
        let cubics = HeightCubics::new(&self.triangulator, surface, 0.4, &window, 16, &|_| ());
        let range = self.triangulator.function().range();
        let camera = self.triangulator.camera();
        let (x, y, r) = HOLES[HOLES.len() - 1];
        let corner = |(dx, dy): (f64, f64)| {
            let side = r / core::f64::consts::SQRT_2 - 0.3;
            let point = Vector::new(x + side * dx, y + side * dy, TOP);
            camera.project(point).unwrap()
        };
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner);
        let production = Production::new(Parts {
            decoder: Decoder::new(&self.sequence, range, 8).unwrap(),
            triangulator: Arc::clone(&self.triangulator),
            cubics: Arc::new(cubics),
            map: None,
            taught,
            features: vec![Feature::new(
                FeatureKind::Surface,
                Region::polygon(&corners, SIDE, SIDE).unwrap(),
            )],
            gauges: vec![Gauge {
                of: vec![0],
                datum: Vec::new(),
                measure: Measure::of_seen(),
            }],
            window,
            noise: SampleNoise::constant(NOISE),
            noise_counts: NOISE,
            aligned: true,
            tolerance_mm: 3.0,
            golden_noise: 0.3,
            largest: vec![Largest::default()],
            displaced: vec![None],
            calibration: CalibrationUncertainty::default(),
            ripple: 0.0,
            surroundings: None,
            ground: None,
            light: None,
        });
        production.unwrap()
    }
}

fn views(frames: &[Vec<u8>]) -> Vec<FrameView<'_>> {
    let view = |frame| FrameView::new(Samples::Eight(frame), SIDE, SIDE, SIDE).unwrap();
    frames.iter().map(|frame| view(frame)).collect()
}

/// How production places the part of frames, and what it reads.
fn inspected(production: &Production, frames: &[Vec<u8>]) -> (Placed, f64) {
    let mut strips = production.strips(64);
    let found = production.inspect(&views(frames), &mut strips, None);
    let found = found.unwrap();
    (found.placed.unwrap(), found.readings[0].unwrap().value)
}

fn motion(centre: Vector, shift: [f64; 3], degrees: [f64; 3]) -> Motion {
    let [x, y, z] = shift;
    let [a, b, c] = degrees.map(f64::to_radians);
    Motion::new(centre, Vector::new(x, y, z), Vector::new(a, b, c))
}

/// The centre that production turns about.
fn centre(production: &Production) -> Vector {
    production.alignment.as_ref().unwrap().centre
}

#[test]
fn a_plate_with_holes_is_followed_by_its_picture_where_heights_leave_it_free() {
    let head = Head::new();
    let production = head.production(&PLATE);
    let with = head.production(&PLATE);
    let with = with.with_picture(&head.modulation(&PLATE), AWAY);
    let mut worst = 0.0_f64;
    for (shift, turns) in [
        ([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
        ([-1.0, 0.7, 0.5], [0.6, -0.8, -1.0]),
        ([0.3, -1.0, -0.6], [-1.0, 1.0, 0.4]),
        ([0.0; 3], [0.0; 3]),
    ] {
        let motion = motion(centre(&with), shift, turns);
        let frames = head.frames(&PLATE, &motion);
        let ((plain, open), (found, followed)) =
            (inspected(&production, &frames), inspected(&with, &frames));
        assert!(found.steered && !plain.steered);
        assert_eq!(found.left_out, [true, true, false, false, false, true]);
        assert_eq!((found.free.len(), found.component(0)), (3, None));
        // What heights determine is theirs, whatever the picture says.
        let heights = motion.values();
        let values = found.motion.values();
        for (component, (value, height)) in values.iter().zip(heights).enumerate().take(5).skip(2) {
            let way = if component == 2 { 1.0 } else { found.radius };
            let error = value - height;
            assert!((error * way).abs() < 2e-3, "{component}: {error}");
            let sigma = [&found, &plain].map(|placed| placed.component(component).unwrap().1);
            assert!((sigma[0] / sigma[1] - 1.0).abs() < 0.1, "{sigma:?}");
        }
        let camera = head.triangulator.camera();
        for corner in with.corners() {
            let at = |motion: &Motion| camera.project(motion.apply(*corner)).unwrap();
            let (there, found) = (at(&motion), at(&found.motion));
            worst = worst.max(libm::hypot(there.0 - found.0, there.1 - found.1));
        }
        // The region stays in its hole, through which no height is seen.
        assert!(followed < 0.001, "{followed}");
        assert!(shift[0] == 0.0 || open > 0.005, "{open}");
    }
    std::println!("{worst:.3} pixels at most");
    assert!(worst < EXACT_PX, "{worst}");
}

#[test]
fn a_part_whose_heights_determine_its_motion_has_the_same_bits_without_a_picture() {
    let head = Head::new();
    let production = head.production(&HILLS);
    let with = head.production(&HILLS);
    let with = with.with_picture(&head.modulation(&HILLS), AWAY);
    assert!(with.picture.is_none());
    let motion = motion(centre(&with), [0.8, -0.6, 0.3], [0.3, 0.2, -0.7]);
    let frames = head.frames(&HILLS, &motion);
    let (found, plain) = (inspected(&with, &frames), inspected(&production, &frames));
    assert_eq!(found, plain);
    assert!(found.0.left_out == [false; 6] && !found.0.steered);
}

#[test]
fn a_picture_without_edges_or_of_another_part_steers_nothing() {
    let head = Head::new();
    let plain = head.production(&PLATE);
    let motion = motion(centre(&plain), [0.6, -0.4, 0.2], [0.0, 0.0, 0.5]);
    let blank = head.production(&PLATE);
    let blank = blank.with_picture(&[90.0; SIDE * SIDE], AWAY);
    assert!(blank.picture.is_none());
    let with = head.production(&PLATE);
    let with = with.with_picture(&head.modulation(&PLATE), AWAY);
    let other = Plate {
        holes: OTHERS,
        ..PLATE
    };
    for plate in [BLANK, other] {
        let frames = head.frames(&plate, &motion);
        let (found, before) = (inspected(&with, &frames), inspected(&plain, &frames));
        assert_eq!(found, before);
        assert!(!found.0.steered);
    }
}

#[test]
fn a_plate_that_is_worked_out_lies_where_it_was_moved_to_if_it_has_a_picture() {
    let head = Head::new();
    let plain = head.production(&PLATE);
    let with = head.production(&PLATE);
    let with = with.with_picture(&head.modulation(&PLATE), AWAY);
    let moved = motion(Vector::default(), [0.7, 0.4, -0.3], [0.3, -0.2, 0.6]);
    let light = vec![Modulation::from_bits(20_000); SIDE * SIDE];
    let phases = with.rendered(&moved, &light, None);
    let corner = with.corners()[7];
    for (production, steered) in [(&with, true), (&plain, false)] {
        let mut strips = production.strips(64);
        let placed = production.place_rendered(&phases, &mut strips, &moved);
        let placed = placed.unwrap().unwrap();
        assert_eq!(placed.steered, steered);
        let off = (placed.motion.apply(corner) - moved.apply(corner)).length();
        assert_eq!(off < 2e-3, steered, "{off}");
    }
}

#[test]
fn the_bits_of_a_steered_part_do_not_depend_on_threads() {
    let head = Head::new();
    let with = head.production(&PLATE);
    let with = with.with_picture(&head.modulation(&PLATE), AWAY);
    let motion = motion(centre(&with), [0.9, -0.5, 0.2], [0.2, 0.1, -0.8]);
    let frames = head.frames(&PLATE, &motion);
    let frames = views(&frames);
    let mut arrived = with.decoder().arrived(SIDE, SIDE);
    let finest = arrive_rest(with.decoder(), &frames, &mut arrived).unwrap();
    let input = Input::Finest(&arrived, &finest);
    let place = || with.place(input, &mut with.strips(64)).unwrap().unwrap();
    let placed = place();
    assert!(placed.steered);
    #[cfg(feature = "parallel")]
    for threads in 1..=4 {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let again = pool.build().unwrap().install(place);
        assert_eq!(again, placed, "{threads} threads");
    }
}
