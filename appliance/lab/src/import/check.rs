//! What looks wrong with an imported recording: its levels are unwrapped as stated and under the
//! other conventions, and the frames of each level are compared with a sine.

use super::code;
use super::direction::rising_and_falling;
use crate::Failed;
use crate::description::Description;
use crate::shifts::{Convention, Shifts};
use algo::chain::{Chain, CodeWord};
use algo::phase::Trust;
use algo::pipeline::{self, PhaseMap};
use algo::units::{AbsolutePhase, WrappedPhase};
use appliance::head::channel::Channel;
use appliance::measure::least_modulation;
use hal::frame::Samples;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use std::f64::consts::TAU;

/// Rows that conventions are compared on.
const ROWS: usize = 128;
/// Largest residual of levels that agree, in turns: unrelated phases agree in 40 % of the pixels
/// per step.
const CLOSE: f64 = 0.2;
/// Share of the pixels whose levels must agree.
const AGREE: f64 = 0.6;
/// By how much another convention must agree better.
const BETTER: f64 = 0.3;
/// Half the height of a ripple of two levels' difference that is named, turns: most of what may be
/// between levels that agree.
const RIPPLE: f64 = 0.1;
/// Parts into which the period of a ripple is divided.
const BINS: usize = 32;
/// Least concentration of the difference of two levels within a part, 0 to 1: below it is noise.
const CONCENTRATED: f64 = 0.7;
/// Largest mean of a ripple, turns: a wrong convention moves it by a quarter of a turn.
const LARGEST_MEAN: f64 = 0.125;
/// Share of the rows in which a convention may jump by most of a turn of its coarsest level.
const JUMPS: f64 = 0.5;
/// Share of the pattern that is a jump.
const JUMP: f64 = 0.4;
/// Share of the neighbours along which a phase falls that is named.
const FALLING: f64 = 0.8;
/// How far samples may be off the best sine, as a share of the modulation.
const OFF_SINE: f64 = 0.15;
/// Share of the pixels that must be modulated.
const LIT: f64 = 0.01;
/// Share of the modulated pixels that may be at full scale.
const SATURATED: f64 = 0.05;

/// What looks wrong, in words with remedies.
///
/// # Errors
/// In words: the frames do not form levels.
pub(super) fn notes(
    recording: &Recording,
    description: &Description,
) -> Result<Vec<String>, Failed> {
    let mut notes = Vec::new();
    same_pictures(recording, &mut notes);
    unused_bits(recording, &mut notes);
    let fringed = recording.patterns.iter().enumerate();
    for (pattern, spec) in fringed.filter(|_| !recording.frames.is_empty()) {
        let channel = Channel::new(recording, pattern, least_modulation(recording))?;
        let levels = channel.wrapped_levels()?;
        let direction = match spec {
            PatternSpec::Horizontal { .. } => "horizontal",
            _ => "vertical",
        };
        let mut note = |words: String| notes.push(format!("{direction} fringes: {words}"));
        light(&channel, &levels, &mut note);
        match channel.chain() {
            // With models, levels are unwrapped about the reference map.
            Err(_) if recording.camera_model.is_some() => {}
            Err(missing) => note(missing.to_string()),
            Ok(chain) => {
                let seen = channel.seen()?;
                let rows = Rows::of(&levels, seen.as_deref());
                let along_rows = direction == "vertical";
                let finest = &levels[levels.len() - 1];
                let of_code =
                    code::notes_beside(recording, (pattern, &channel), finest, description)?;
                let named = match of_code {
                    // With a code, a single level needs no other check.
                    Some(said) if !said.is_empty() || levels.len() == 1 => {
                        let named = !said.is_empty();
                        said.into_iter().for_each(&mut note);
                        named
                    }
                    _ => {
                        let stated = description.shifts;
                        conventions(&channel, &chain, &rows, along_rows, stated, &mut note)
                    }
                };
                let may_fall = named || recording.camera_model.is_some();
                if !may_fall
                    && falls(
                        &chain.unwrap(&rows.levels, rows.code.as_deref()),
                        along_rows,
                    )
                {
                    let along = if along_rows {
                        "from left to right"
                    } else {
                        "from top to bottom"
                    };
                    note(format!(
                        "the phase falls {along}: --shift is reversed, or the camera is mirrored or upside down against the \
                         projector"
                    ));
                }
            }
        }
    }
    Ok(notes)
}

/// Pictures that follow each other and are the same.
fn same_pictures(recording: &Recording, notes: &mut Vec<String>) {
    let pairs = recording.frames.windows(2).enumerate();
    for (at, pair) in pairs {
        if pair[0].frame.samples() == pair[1].frame.samples() {
            notes.push(format!(
                "frames {at} and {} are the same picture: was one saved twice?",
                at + 1
            ));
        }
    }
}

/// Samples of 16 bits that use fewer: then full scale is not recognised as saturated.
fn unused_bits(recording: &Recording, notes: &mut Vec<String>) {
    let largest = |samples: Samples<'_>| match samples {
        Samples::Eight(_) => u16::MAX,
        Samples::Sixteen(samples) => samples.iter().copied().max().unwrap_or(0),
    };
    let frames = recording.frames.iter();
    let largest = frames.map(|frame| largest(frame.frame.samples())).max();
    let bits = u16::BITS - largest.unwrap_or(0).leading_zeros();
    if recording.bit_depth == 16 && (1..=12).contains(&bits) {
        notes.push(format!(
            "no sample of 16 bits uses more than {bits}: give --bit-depth {}, or saturated pixels are not recognised",
            bits.max(9)
        ));
    }
}

/// Modulation, saturation, and whether the frames of a level are a sine.
fn light(channel: &Channel<'_>, levels: &[PhaseMap], note: &mut impl FnMut(String)) {
    let finest = &levels[levels.len() - 1];
    let pixels = finest.trust.len() as f64;
    let scan = &channel.scan;
    let full_scale = scan.decoder.full_scale();
    let clipped = |at: &usize| {
        let (u, v) = (at % finest.width, at / finest.width);
        scan.frames
            .iter()
            .any(|frame| frame.row(v).at(u) >= full_scale)
    };
    let resolved = finest.count(Trust::Resolved);
    let is_lit = |trust: Trust| matches!(trust, Trust::Resolved | Trust::Saturated);
    let modulated = (0..finest.trust.len()).filter(|&at| is_lit(finest.trust[at]));
    let lit = modulated.clone().count() as f64;
    let saturated = modulated.filter(clipped).count() as f64;
    if lit < LIT * pixels {
        note(format!(
            "only {:.1} % of the pixels are modulated at the finest level by {:.0} of 255 counts or more: if the pictures are only \
             dim, give the camera's noise with --noise; else check the order of the pictures, --fringes and --steps",
            100.0 * lit / pixels,
            channel.scan.decoder.least_modulation().eight_bit()
        ));
        return;
    }
    if saturated > SATURATED * lit {
        note(format!(
            "{:.0} % of the modulated pixels are at full scale: expose for a shorter time",
            100.0 * saturated / lit
        ));
    }
    let left = pipeline::sine_residuals(&scan.sequence, &scan.frames, full_scale, &finest.trust);
    let off = left.and_then(|left| left.off_sine());
    let counts = finest.modulation.iter();
    let sum: f64 = counts.map(|modulation| modulation.counts(full_scale)).sum();
    let mean = sum / resolved.max(1) as f64;
    if let Some(off) = off.filter(|off| *off > OFF_SINE * mean) {
        note(format!(
            "the frames are off a sine by {off:.1} counts RMS, {:.0} % of the modulation: check the order of the pictures and \
             --steps, and that the projector's response is linear",
            100.0 * off / mean
        ));
    }
}

/// A sample of the rows of the wrapped phases.
struct Rows {
    levels: Vec<PhaseMap>,
    code: Option<Vec<CodeWord>>,
}

/// How well the levels agree under a convention.
#[derive(Clone, Copy)]
struct Agreement {
    /// Share of the modulated pixels that are resolved.
    share: f64,
    /// Share of the rows in which the phase jumps by most of the pattern.
    jumps: f64,
    /// Whether the phase falls from left to right, or from top to bottom.
    falls: bool,
}

impl Agreement {
    /// Whether this convention agrees better: in clearly more pixels; else with a rising phase,
    /// since a reversed shift agrees as well; else with fewer jumps.
    fn betters(self, other: Self) -> bool {
        if (self.share - other.share).abs() > 0.05 {
            return self.share > other.share;
        }
        match self.falls == other.falls {
            true => self.jumps < other.jumps,
            false => other.falls,
        }
    }
}

impl Rows {
    fn of(levels: &[PhaseMap], code: Option<&[CodeWord]>) -> Self {
        let width = levels[0].width.max(1);
        let height = levels[0].phase.len() / width;
        let step = height.div_ceil(ROWS).max(1);
        fn every<T: Copy>(step: usize, width: usize, all: &[T]) -> Vec<T> {
            let rows = all.chunks(width).step_by(step);
            rows.flatten().copied().collect()
        }
        let thin = |map: &PhaseMap| PhaseMap {
            width,
            phase: every(step, width, &map.phase),
            modulation: every(step, width, &map.modulation),
            trust: every(step, width, &map.trust),
        };
        Self {
            levels: levels.iter().map(thin).collect(),
            code: code.map(|code| every(step, width, code)),
        }
    }

    /// The rows as they would be decoded under another convention: each phase φ becomes ± φ +
    /// `offset`.
    fn under(&self, reversed: bool, offset: f64) -> Self {
        let turn = |map: &PhaseMap| {
            let phase = map.phase.iter().map(|phase| {
                let turns = if reversed {
                    -phase.turns()
                } else {
                    phase.turns()
                };
                AbsolutePhase::from_turns(WrappedPhase::from_turns(turns + offset).turns())
            });
            PhaseMap {
                phase: phase.collect(),
                ..map.clone()
            }
        };
        Self {
            levels: self.levels.iter().map(turn).collect(),
            code: self.code.clone(),
        }
    }

    fn agreement(&self, chain: &Chain, span: f64, along_rows: bool) -> Agreement {
        let map = chain.unwrap_within(CLOSE, &self.levels, self.code.as_deref());
        let resolved = map.count(Trust::Resolved);
        let modulated = resolved + map.count(Trust::Residual);
        let rows = map.phase.len() / map.width.max(1);
        let jumps = map.phase.chunks(map.width.max(1)).filter(|row| {
            let apart = |pair: &[AbsolutePhase]| {
                pair[0].is_known()
                    && pair[1].is_known()
                    && (pair[1] - pair[0]).turns().abs() > JUMP * span
            };
            row.windows(2).any(apart)
        });
        Agreement {
            share: resolved as f64 / modulated.max(1) as f64,
            jumps: jumps.count() as f64 / rows.max(1) as f64,
            falls: falls(&map, along_rows),
        }
    }
}

/// Whether the phase falls along the rows, or from row to row.
fn falls(map: &PhaseMap, along_rows: bool) -> bool {
    let [rising, falling] = rising_and_falling(map, along_rows, 1);
    falling as f64 > FALLING * (falling + rising) as f64
}

/// Compares the stated convention of shifts with the others, of a sine or a cosine, rising or
/// falling, from the stated first shift or half a turn more; returns whether another one is named.
///
/// Frames with the shifts s_k = ± k/N + t (t the first shift, and ¼ for a cosine) that are decoded
/// with the shifts of another convention, t', give, instead of φ, the phase φ + t − t' where the
/// sign is the same, and ½ − φ − t − t' where it is reversed.
fn conventions(
    channel: &Channel<'_>,
    chain: &Chain,
    rows: &Rows,
    along_rows: bool,
    stated: Shifts,
    note: &mut impl FnMut(String),
) -> bool {
    let span = channel.function.range().span();
    let own = rows.agreement(chain, span, along_rows);
    let percent = |share: f64| 100.0 * share;
    if own.share < AGREE
        && let Some((ripple, shifts)) = response(channel, rows)
    {
        note(format!(
            "levels agree in only {:.0} % of the modulated pixels: they are up to {ripple:.2} turns off each other, {shifts} times \
             per fringe, so the response of projector or camera is not linear (gamma): linearise it, or project more shifts",
            percent(own.share)
        ));
        return false;
    }
    let mut best: Option<(Agreement, Shifts)> = None;
    for half in [0.0, 0.5] {
        for convention in [Convention::Sin, Convention::Cos] {
            for sign in [stated.sign, stated.sign.reversed()] {
                let first = stated.first + half;
                let other = Shifts {
                    convention,
                    sign,
                    first: first - if first > 0.5 { 1.0 } else { 0.0 },
                };
                let reversed = sign != stated.sign;
                if other == stated {
                    continue;
                }
                let offset = match reversed {
                    false => stated.total() - other.total(),
                    true => 0.5 - stated.total() - other.total(),
                };
                let found = rows.under(reversed, offset);
                let found = found.agreement(chain, span, along_rows);
                if best.as_ref().is_none_or(|(known, _)| found.betters(*known)) {
                    best = Some((found, other));
                }
            }
        }
    }
    let Some((best, words)) = best else {
        return false;
    };
    let words = words.options(stated);
    if best.share > own.share + BETTER {
        note(format!(
            "levels agree in {:.0} % of the modulated pixels, with {words} in {:.0} %: give {words}",
            percent(own.share),
            percent(best.share)
        ));
    } else if own.share < AGREE {
        note(format!(
            "levels agree in only {:.0} % of the modulated pixels, whatever the convention of the shifts: check --fringes, \
             --steps and the order of the pictures",
            percent(own.share)
        ));
        return false;
    } else if own.jumps > JUMPS && best.jumps < own.jumps / 2.0 && best.share > own.share - 0.05 {
        note(format!(
            "the phase jumps by a turn of the coarsest level in {:.0} % of the rows, with {words} in {:.0} %: give {words}",
            percent(own.jumps),
            percent(best.jumps)
        ));
    } else {
        return false;
    }
    true
}

/// Half the height in turns of the ripple that a response which is not linear makes between two
/// levels, and their number of shifts.
fn response(channel: &Channel<'_>, rows: &Rows) -> Option<(f64, usize)> {
    let levels = channel.scan.sequence.levels();
    let span = channel.function.range().span();
    let ripples = levels.windows(2).zip(rows.levels.windows(2));
    let ripples = ripples.filter_map(|(pair, maps)| {
        let factor = pair[1].ratio / pair[0].ratio;
        // Else the difference depends on the fringe's order.
        let alone = pair[0].ratio * span <= 1.0 || (factor - factor.round()).abs() < 1e-6;
        let shifts = pair[0].shifts();
        let height = ripple(&maps[0], &maps[1], factor, shifts)?;
        (alone && height > RIPPLE).then_some((height, shifts))
    });
    ripples.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// The ripple of the difference of two levels, `factor` φ_coarse − φ_fine, that a response which is
/// not linear makes: with as many periods per fringe as there are shifts. Half its height in turns,
/// if the difference is nothing but that.
fn ripple(coarse: &PhaseMap, fine: &PhaseMap, factor: f64, shifts: usize) -> Option<f64> {
    let mut sums = [[0.0_f64; 2]; BINS];
    let mut count = 0_usize;
    for at in 0..coarse.phase.len() {
        if coarse.trust[at] != Trust::Resolved || fine.trust[at] != Trust::Resolved {
            continue;
        }
        let phase = coarse.phase[at].turns();
        let (sin, cos) = (TAU * (factor * phase - fine.phase[at].turns())).sin_cos();
        let part = (shifts as f64 * phase).rem_euclid(1.0) * BINS as f64;
        let sum = &mut sums[part as usize % BINS];
        *sum = [sum[0] + cos, sum[1] + sin];
        count += 1;
    }
    let size: f64 = sums.iter().map(|[cos, sin]| cos.hypot(*sin)).sum();
    if count == 0 || size < CONCENTRATED * count as f64 {
        return None;
    }
    let means = sums.map(|[cos, sin]| sin.atan2(cos) / TAU);
    let mut course = vec![means[0]];
    for next in means.into_iter().skip(1).chain([means[0]]) {
        let here = course[course.len() - 1];
        course.push(here + (next - here) - (next - here).round());
    }
    // A difference that turns round and round is one of orders or signs.
    let closed = course.pop()?;
    let mean = course.iter().sum::<f64>() / BINS as f64;
    let high = course.iter().copied().fold(f64::MIN, f64::max);
    let low = course.iter().copied().fold(f64::MAX, f64::min);
    let plain = (closed - course[0]).abs() < 0.5 && (mean - mean.round()).abs() < LARGEST_MEAN;
    plain.then_some((high - low) / 2.0)
}
