//! One sequence of a recipe, ready to judge parts.

use super::golden;
use crate::recipe::archive::Arrays;
use crate::recipe::good_parts::GoodPartsFile;
use crate::recipe::{RecipeSequence, SequenceKind};
use algo::frame::SampleNoise;
use algo::geometry::Triangulator;
use algo::inspect::{
    Basis, CalibrationError, Gauge, Largest, PairBuffers, Parts, Picture, Production, Taught,
};
use algo::pattern::{PhaseRange, Shot};
use algo::phase::{Arrived, Decoder, LeastModulation};
use algo::pipeline::HeightCubics;
use algo::units::{AbsolutePhase, Modulation};
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// A sequence that the part can be measured with.
#[derive(Debug)]
pub(super) struct Run {
    pub kind: SequenceKind,
    /// Which of the plan's rasters the frames of the sequence show.
    pub indices: Vec<usize>,
    pub production: Production,
    /// What a run of two frames needs; `None` for other sequences.
    pub pair: Option<Pair>,
    /// Memory for the levels that are decoded on arrival, allocated by the first cycle.
    pub arrived: Mutex<Option<Arrived>>,
    /// Bytes of the run's maps.
    pub bytes: usize,
}

/// What a run of two frames has beside what every run has.
#[derive(Debug)]
pub(super) struct Pair {
    /// Golden's picture; none if it has no edges, and then every cycle falls back.
    pub picture: Option<Picture>,
    pub buffers: Mutex<PairBuffers>,
}

/// What all runs of a recipe share.
pub(super) struct Shared {
    pub aligned: bool,
    pub triangulator: Arc<Triangulator>,
    pub cubics: Arc<HeightCubics>,
    pub gauges: Vec<Gauge>,
    pub window: Vec<Range<usize>>,
    pub noise: SampleNoise,
    pub noise_counts: f64,
    pub calibration: CalibrationError,
    pub good_parts: Option<GoodPartsFile>,
    pub golden: GoldenNoise,
    /// Golden's modulation in counts and how far the image of a part may be displaced, pixels: what
    /// two frames need.
    pub picture: (Vec<f32>, f64),
}

/// The noise of golden.
pub(super) struct GoldenNoise {
    captures: f64,
    /// σ of the phase of a pixel of full modulation, turns per count of noise: in one capture by
    /// the full sequence.
    full: f64,
    /// σ of the phase in one capture by the sequence that the golden surface is measured by, in the
    /// same unit.
    base: f64,
    offset: Option<usize>,
    /// For each gauge, the largest deviation that the noise of one capture by the full sequence
    /// causes.
    largest: Vec<Largest>,
}

/// A sequence of the recipe without what it shares with the others.
pub(super) struct Prepared {
    kind: SequenceKind,
    indices: Vec<usize>,
    decoder: Decoder,
    taught: Taught,
    map: Option<Vec<AbsolutePhase>>,
    /// The sequence's modulation over that of golden.
    brighter: f64,
    /// The index of golden's offset by this sequence; `None` where there is no offset.
    offset: Option<usize>,
    /// RMS of the periodic error of mean heights, mm.
    ripple_mm: f64,
}

impl Prepared {
    /// Prepares a sequence for phases of `range` with at least so much modulation; the recipe's
    /// arrays can be dropped then. `rasters` are what all runs show; what only this run shows is
    /// added. `fundamental` is that of the waveform that golden's modulation was measured with;
    /// `shares` of deviations lie along the normal; `base` is the offset of the sequence that the
    /// golden surface is measured by.
    pub fn of(
        sequence: RecipeSequence,
        (noise, fundamental): (SampleNoise, f64),
        (arrays, shares, base): (&Arrays, &[f32], Option<usize>),
        (range, bit_depth, least): (PhaseRange, u8, LeastModulation),
        rasters: &mut Vec<Shot>,
    ) -> Result<Self, String> {
        let brighter = sequence.fundamental() / fundamental;
        let RecipeSequence {
            kind,
            shots,
            levels,
            offset,
            ripple_mm,
        } = sequence;
        let offset = offset.filter(|_| !arrays.sequence_offset.is_empty());
        let offsets = (golden::offset(arrays, offset), golden::offset(arrays, base));
        let decoder = Decoder::new(&levels, range, bit_depth).map_err(|error| error.to_string())?;
        let decoder = decoder.with_least_modulation(least);
        let indices = shots.into_iter().map(|shot| {
            let shown = rasters.iter().position(|known| *known == shot);
            shown.unwrap_or_else(|| {
                rasters.push(shot);
                rasters.len() - 1
            })
        });
        Ok(Self {
            kind,
            indices: indices.collect(),
            taught: golden::taught((noise, brighter), arrays, shares, &decoder),
            map: golden::map(arrays, kind, offsets),
            decoder,
            brighter,
            offset,
            ripple_mm,
        })
    }

    /// The noise of golden in frames of `width` columns; `self` is the full sequence, and the
    /// golden surface is measured by the sequence `base`.
    pub fn golden_noise(
        &self,
        base: &Self,
        captures: usize,
        (gauges, width): (&[Gauge], usize),
    ) -> GoldenNoise {
        let largest = |gauge: &Gauge| match gauge.measure.facts().basis {
            Basis::Squares(side) => Largest::of(&self.taught, width, &gauge.region, side),
            _ => Largest::default(),
        };
        GoldenNoise {
            captures: captures as f64,
            full: self.phase_noise(),
            base: base.phase_noise(),
            offset: base.offset,
            largest: gauges.iter().map(largest).collect(),
        }
    }

    /// σ of the phase of a pixel of full modulation in golden, turns per count of noise.
    fn phase_noise(&self) -> f64 {
        let full = Modulation::from_bits(u16::MAX);
        let noise = SampleNoise::constant(1.0 / self.brighter);
        self.decoder.phase_noise(full, noise)
    }

    /// σ of golden's heights in deviations by this sequence, over σ of the heights of one
    /// measurement by this sequence.
    ///
    /// Deviations are from golden's phase by this sequence. Where the golden surface is measured by
    /// another sequence, a displaced part is compared with heights by that sequence, and the
    /// heights at both places have its noise.
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

    /// Joins the sequence with what all sequences share.
    pub fn join(self, shared: &Shared) -> Result<Run, String> {
        let golden_noise = self.noise_of_golden(&shared.golden);
        let over_full = golden_noise * self.phase_noise() / shared.golden.full;
        let largest = shared.golden.largest.iter();
        let Self {
            kind,
            indices,
            decoder,
            taught,
            map,
            brighter,
            ripple_mm,
            ..
        } = self;
        let displaced = |gauge: &Gauge| {
            let side = gauge.measure.facts().basis.square_side()?;
            shared.good_parts?.displaced(side)
        };
        let bytes = size_of_val(map.as_deref().unwrap_or(&[])) + taught.bytes();
        let production = Production::new(Parts {
            decoder,
            triangulator: Arc::clone(&shared.triangulator),
            cubics: Arc::clone(&shared.cubics),
            map,
            taught,
            gauges: shared.gauges.clone(),
            window: shared.window.clone(),
            noise: shared.noise.by([0.0, 1.0 / brighter]),
            noise_counts: shared.noise_counts,
            aligned: shared.aligned,
            golden_noise,
            largest: largest.map(|largest| largest.times(over_full)).collect(),
            displaced: shared.gauges.iter().map(displaced).collect(),
            calibration: shared.calibration,
            ripple: ripple_mm,
        });
        let production = production.map_err(|error| error.to_string())?;
        let (modulation, tolerance_px) = &shared.picture;
        let pair = (kind == SequenceKind::TwoFrames).then(|| Pair {
            picture: production.picture(modulation, *tolerance_px),
            buffers: Mutex::new(production.pair_buffers()),
        });
        Ok(Run {
            kind,
            indices,
            bytes,
            production,
            pair,
            arrived: Mutex::new(None),
        })
    }
}
