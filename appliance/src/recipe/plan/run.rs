//! One sequence of a recipe, ready to judge parts.

use super::taught;
use crate::recipe::file::archive::Arrays;
use crate::recipe::file::refusal::refused;
use crate::recipe::{Conditions, Demands, Element, Part, RecipeSequence, Refusal, SequenceKind};
use algo::flicker::Watch;
use algo::frame::SampleNoise;
use algo::geometry::Triangulator;
use algo::inspect::{
    Feature, Gauge, GoldenSignal, Largest, Levels, PairBuffers, Parts, Production, Region, Taught,
    Unmeasurable,
};
use algo::pattern::{PhaseRange, Shot};
use algo::phase::{Arrived, Decoder};
use algo::pipeline::HeightCubics;
use algo::units::{AbsolutePhase, Modulation};
use hal::bounds::clipped;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Most bytes of a recipe's patterns: 64 of a projector of 1920 × 1080 pixels take half of it.
const MAX_PATTERN_BYTES: usize = 256 << 20;

/// The light is compared where golden's modulation is so many times the noise of a sample.
const LIT: f64 = 8.0;

/// A sequence that the part can be measured with.
#[derive(Debug)]
pub(super) struct Run {
    pub kind: SequenceKind,
    /// Which of the plan's rasters its frames show.
    pub indices: Vec<usize>,
    pub production: Production,
    /// What tells whether the light changes from frame to frame.
    pub watch: Watch,
    /// The buffers of two frames.
    pub pair: Option<Mutex<PairBuffers>>,
    /// Memory for the levels that are decoded on arrival, allocated by the first cycle.
    pub arrived: Mutex<Option<Arrived>>,
    /// Bytes of its maps and gauges.
    pub bytes: usize,
}

/// What all runs of a recipe share.
pub(super) struct Shared<'a> {
    pub conditions: &'a Conditions,
    pub demands: &'a Demands,
    pub triangulator: Arc<Triangulator>,
    pub cubics: Arc<HeightCubics>,
    pub features: Vec<Feature>,
    pub gauges: Vec<Gauge>,
    pub window: Vec<Range<usize>>,
    pub noise_counts: f64,
    pub golden: GoldenNoise,
    /// Golden's modulation in counts, empty where parts are not aligned, and how far the image of a
    /// part may be displaced, pixels.
    pub picture: (Arc<[f32]>, f64),
    /// What contours need; `None` if no gauge is of one.
    pub signal: Option<GoldenSignal>,
}

/// The noise of golden.
pub(super) struct GoldenNoise {
    captures: f64,
    /// σ of the phase of a pixel of full modulation, turns per count of noise: in one capture by
    /// the full sequence.
    full: f64,
    /// The same by the sequence that the golden surface is by, and the offset of that.
    base: f64,
    offset: Option<usize>,
    /// Per gauge, what the noise of one capture by the full sequence makes of it.
    largest: Vec<Largest>,
}

/// A sequence of the recipe without what it shares with the others.
pub(super) struct Prepared {
    kind: SequenceKind,
    indices: Vec<usize>,
    decoder: Decoder,
    levels: Levels,
    watch: Watch,
    taught: Taught,
    map: Option<Vec<AbsolutePhase>>,
    /// Its modulation over that of golden.
    brighter: f64,
    /// Which offset from the full sequence golden has by this one.
    offset: Option<usize>,
    /// RMS of the periodic error of mean heights, mm.
    ripple_mm: f64,
}

impl Prepared {
    /// Prepares all sequences for phases of `range`; the recipe's arrays can be dropped then.
    /// Deviations lie by `shares` along the normal; `base` is the offset of the sequence that the
    /// golden surface is by. The second value is what all of them show, each raster once.
    pub fn all(
        sequences: Vec<RecipeSequence>,
        conditions: &Conditions,
        golden: (&Arrays, &[f32], Option<usize>),
        range: PhaseRange,
    ) -> Result<(Vec<Self>, Vec<Shot>), Refusal> {
        let mut shots = Vec::new();
        // Golden was measured with the full sequence, the last.
        let taught = sequences.last().map_or(1.0, RecipeSequence::fundamental);
        let prepared = sequences
            .into_iter()
            .map(|sequence| {
                let brighter = sequence.fundamental() / taught;
                Self::of(sequence, conditions, brighter, golden, range, &mut shots)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let (columns, rows) = conditions.raster;
        let patterns = shots.len() * columns as usize * rows as usize;
        if patterns > MAX_PATTERN_BYTES {
            return refused!(
                "its sequences show {} patterns of {} MiB together, at most {} are held: teach it with fewer frames",
                shots.len(),
                patterns >> 20,
                MAX_PATTERN_BYTES >> 20
            );
        }
        Ok((prepared, shots))
    }

    /// Prepares a sequence with `brighter` times golden's modulation. What it shows and `rasters`
    /// do not have is added to them.
    fn of(
        sequence: RecipeSequence,
        conditions: &Conditions,
        brighter: f64,
        (arrays, shares, base): (&Arrays, &[f32], Option<usize>),
        range: PhaseRange,
        rasters: &mut Vec<Shot>,
    ) -> Result<Self, Refusal> {
        let RecipeSequence {
            kind,
            shots,
            levels,
            offset,
            ripple_mm,
        } = sequence;
        let offset = offset.filter(|_| !arrays.sequence_offset.is_empty());
        let offsets = (taught::offset(arrays, offset), taught::offset(arrays, base));
        let decoder = Decoder::new(&levels, range, conditions.camera.2)?;
        let mut decoder = decoder.with_least_modulation(conditions.least_modulation);
        if conditions.light_edges {
            decoder = decoder.refusing_light_edges(conditions.noise);
        }
        let indices = shots.into_iter().map(|shot| {
            let shown = rasters.iter().position(|known| *known == shot);
            shown.unwrap_or_else(|| {
                rasters.push(shot);
                rasters.len() - 1
            })
        });
        let noise = taught::even_noise(conditions.noise, arrays);
        let lit = |at: usize| {
            let seen = brighter * f64::from(arrays.modulation[at]);
            arrays.valid[at] != 0 && seen > LIT * noise
        };
        let lit: Vec<bool> = (0..arrays.valid.len()).map(lit).collect();
        let light = (decoder.full_scale(), noise);
        Ok(Self {
            watch: Watch::new(&levels, light, conditions.camera.0 as usize, &lit),
            kind,
            indices: indices.collect(),
            taught: taught::taught((conditions.noise, brighter), arrays, shares, &decoder),
            map: taught::map(arrays, kind, offsets),
            levels: Levels::new(&levels, decoder.full_scale()),
            decoder,
            brighter,
            offset,
            ripple_mm,
        })
    }

    /// The noise of golden, where this is the full sequence, in frames of `width` columns. The
    /// golden surface is by the sequence `base`. `tell` gets the share that is done.
    pub fn golden_noise(
        &self,
        base: &Self,
        captures: usize,
        (features, gauges): (&[Feature], &[Gauge]),
        width: usize,
        tell: &dyn Fn(f64),
    ) -> GoldenNoise {
        // Gauges that look at the same pixels have the same.
        let mut known: Vec<(usize, &Region, Largest)> = Vec::new();
        let mut largest = |(at, gauge): (usize, &Gauge)| {
            tell(at as f64 / gauges.len() as f64);
            let side = gauge.measure.facts().basis.square_side();
            let feature = gauge.of.first().and_then(|&at| features.get(at));
            let Some((side, of)) = side.zip(feature) else {
                return Largest::default();
            };
            let same =
                |known: &&(usize, &Region, Largest)| (known.0, known.1) == (side, &of.region);
            if let Some((.., largest)) = known.iter().find(same) {
                return *largest;
            }
            let largest = Largest::of(&self.taught, width, &of.region, side);
            known.push((side, &of.region, largest));
            largest
        };
        GoldenNoise {
            captures: captures as f64,
            full: self.phase_noise(),
            base: base.phase_noise(),
            offset: base.offset,
            largest: gauges.iter().enumerate().map(&mut largest).collect(),
        }
    }

    /// σ of the phase of a pixel of full modulation in golden, turns per count of noise.
    fn phase_noise(&self) -> f64 {
        let full = Modulation::from_bits(u16::MAX);
        let noise = SampleNoise::constant(1.0 / self.brighter);
        self.decoder.phase_noise(full, noise)
    }

    /// σ of golden's heights that deviations by this sequence have, over that of one measurement by
    /// it.
    ///
    /// Golden's phase by this sequence is what deviations are from. Where the golden surface is by
    /// another one, a displaced part is compared with heights by that one, and the heights of both
    /// places have its noise.
    fn noise_of_golden(&self, golden: &GoldenNoise) -> f64 {
        let own = self.phase_noise();
        let measured = self.offset.is_some() || self.kind == SequenceKind::Full;
        let variance = match measured {
            false => golden.full * golden.full,
            true if self.offset == golden.offset => own * own,
            true => own * own + 2.0 * golden.base * golden.base,
        };
        (variance / golden.captures).sqrt() / own
    }

    /// Joins it with what all sequences share.
    pub fn join(self, shared: &Shared<'_>) -> Result<Run, Refusal> {
        let golden_noise = self.noise_of_golden(&shared.golden);
        let over_full = golden_noise * self.phase_noise() / shared.golden.full;
        let largest = shared.golden.largest.iter();
        let Self {
            kind,
            indices,
            decoder,
            levels,
            watch,
            taught,
            map,
            brighter,
            ripple_mm,
            ..
        } = self;
        let signal = shared.signal.clone();
        let signal = signal.map(|signal| GoldenSignal { brighter, ..signal });
        let displaced = |gauge: &Gauge| {
            let side = gauge.measure.facts().basis.square_side()?;
            shared.conditions.good_parts?.displaced(side)
        };
        let bytes = size_of_val(map.as_deref().unwrap_or(&[])) + taught.bytes();
        let production = Production::new(Parts {
            decoder,
            triangulator: Arc::clone(&shared.triangulator),
            cubics: Arc::clone(&shared.cubics),
            map,
            taught,
            features: shared.features.clone(),
            gauges: shared.gauges.clone(),
            window: shared.window.clone(),
            noise: shared.conditions.noise.by([0.0, 1.0 / brighter]),
            noise_counts: shared.noise_counts,
            aligned: shared.demands.aligned,
            tolerance_mm: shared.demands.tolerance_mm,
            golden_noise,
            largest: largest.map(|largest| largest.times(over_full)).collect(),
            displaced: shared.gauges.iter().map(displaced).collect(),
            calibration: shared.conditions.calibration,
            ripple: ripple_mm,
            surroundings: shared.conditions.surroundings_mm,
            ground: shared.conditions.ground_mm,
            light: signal.map(|signal| (levels, signal)),
        });
        let production = production.map_err(|error| refusal(error, shared))?;
        let (modulation, tolerance_px) = &shared.picture;
        let production = production.with_picture(modulation, *tolerance_px);
        let bytes = bytes + production.gauge_bytes();
        let pair = (kind == SequenceKind::TwoFrames).then(|| production.pair_buffers());
        Ok(Run {
            kind,
            indices,
            bytes,
            production,
            watch,
            pair: pair.map(Mutex::new),
            arrived: Mutex::new(None),
        })
    }
}

/// Why gauges cannot be measured, with the name of a feature that is why.
fn refusal(error: Unmeasurable, shared: &Shared<'_>) -> Refusal {
    let (Unmeasurable::NoContour { feature } | Unmeasurable::NoSection { feature }) = error else {
        return error.to_string().into();
    };
    let kind = shared
        .features
        .get(feature)
        .map_or("contour", |of| of.kind.name());
    let label = shared.demands.features.get(feature);
    let name = label.map_or("", |label| &label.name);
    let of = Some(Element::new(Part::Feature, feature, name));
    let name = clipped(name);
    let is_section = matches!(error, Unmeasurable::NoSection { .. });
    let words = match shared.signal {
        _ if is_section => {
            format!("feature {name:?}: golden sees nothing where it begins or ends: move it")
        }
        None => format!(
            "feature {name:?} is a {kind}, and the recipe has no golden_signal, in which it is found: teach again, gauges can be kept"
        ),
        Some(_) => format!(
            "feature {name:?}: golden has no {kind} in its region, or too little of its rim is seen: draw the region around it, with 1.5 mm or more on both sides"
        ),
    };
    Refusal { words, of }
}
