//! The sequences that a part can be measured with, in the recipe's file: what each frame shows, what
//! each can unwrap, and what is predicted of it.

use algo::pattern::Shot;
use algo::units::AbsolutePhase;
use hal::bounded;
use hal::bounds::{Fields, MAX_SIGMA_MM};
use serde::{Deserialize, Serialize};

bounded! {
    /// A sequence, its predicted noise on this part, and the share of the part that it can unwrap.
    pub struct SequenceFile {
        /// What it can unwrap.
        pub kind: SequenceKind,
        /// What each frame shows: [ratio, shift in turns], and the harmonics of a waveform that is
        /// not a sine.
        #[serde(with = "shots")]
        pub frames: Vec<Shot>,
        /// Predicted σ_z, RMS over the golden surface, mm.
        pub sigma_mm: f64 = 0.0..=MAX_SIGMA_MM,
        /// Share of the golden surface whose phase stays within the sequence's reach for every
        /// placement inside the tolerance.
        pub safe_share: f64 = 0.0..=1.0,
        /// RMS of the periodic error that this sequence leaves in the mean height over a square of
        /// 9 × 9 pixels, where that is largest, mm; `None` where the recipe was taught from a
        /// recording.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub ripple_mm: Option<f64> = 0.0..=MAX_SIGMA_MM,
        /// How often the sequence gets a fringe order wrong unseen; `None` where it cannot be
        /// unwrapped.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub unseen_orders: Option<UnseenFile> = Fields,
    }

    /// Shares of pixels that get a wrong fringe order without a residual, for parts anywhere within
    /// the placement tolerance ([`algo::pattern::Slips`]).
    #[derive(Copy)]
    pub struct UnseenFile {
        /// Mean over the golden surface where the sequence is safe, by the modulation and the phase
        /// reach of each pixel.
        pub part: f64 = 0.0..=1.0,
        /// Rate among pixels of the least trusted modulation, where the phase reach is largest.
        pub darkest: f64 = 0.0..=1.0,
    }
}

/// The kinds of sequence, ordered by how far from the golden map they can unwrap. Dense levels have
/// the ratios 1, 1 − 1/n and perhaps 1 − 1/n² (`docs/measurement.md`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SequenceKind {
    /// The fringe and its complement, fitted in windows about golden as the part lies in the
    /// picture. It is not in the list of sequences: [`RecipeFile::two_frames`](super::RecipeFile::two_frames).
    #[serde(skip)]
    TwoFrames,
    /// One level: |ΔΦ| < 0.4 turn, of 0.5 that are unambiguous.
    SingleLevel,
    /// Two dense levels of ratios 1 and 4/5: |ΔΦ| < 2.3 turns, of 2.5 that are unambiguous.
    TwoLevels,
    /// Geometric levels, without a limit, or three dense levels: |ΔΦ| < n²/2 − n turns.
    Full,
}

impl SequenceKind {
    /// Largest |ΔΦ| about the golden map that is unwrapped correctly, in turns; `None` for the full
    /// sequence, in which a wrong fringe order leaves a large residual, so that the pixel is
    /// rejected, and for two frames, which are not unwrapped about golden as it was taught.
    pub fn reach(self) -> Option<f32> {
        match self {
            Self::SingleLevel => Some(0.4),
            Self::TwoLevels => Some(2.3),
            Self::TwoFrames | Self::Full => None,
        }
    }
}

/// The part of a phase map about which a sequence can unwrap any part within the placement
/// tolerance. `changes` are the largest |ΔΦ| that such a placement can cause, in turns
/// (`phase_reach.npy`); where they are not below `limit`, the sequence's [`SequenceKind::reach`],
/// the phase becomes unknown.
pub fn safe(phase: &[AbsolutePhase], changes: &[f32], limit: f32) -> Vec<AbsolutePhase> {
    let pairs = phase.iter().zip(changes);
    pairs
        .map(|(&phase, &change)| {
            if change < limit {
                phase
            } else {
                AbsolutePhase::UNKNOWN
            }
        })
        .collect()
}

/// What frames show, as recipes store it: [ratio, shift in turns], and for a waveform that is not a
/// sine [ratio, shift, [[order, share of the fundamental], …]].
mod shots {
    use algo::pattern::{Shot, Waveform};
    use serde::de::{Error, SeqAccess, Visitor};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::fmt;

    pub(super) fn serialize<S: Serializer>(shots: &[Shot], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(shots.iter().map(|shot| Entry(*shot)))
    }

    pub(super) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Vec<Shot>, D::Error> {
        let entries: Vec<Entry> = Vec::deserialize(from)?;
        Ok(entries.into_iter().map(|entry| entry.0).collect())
    }

    struct Entry(Shot);

    impl Serialize for Entry {
        fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
            let Shot {
                ratio,
                shift,
                waveform,
            } = self.0;
            let harmonics: Vec<_> = waveform.harmonics().collect();
            match harmonics.is_empty() {
                true => [ratio, shift].serialize(to),
                false => (ratio, shift, harmonics).serialize(to),
            }
        }
    }

    impl<'de> Deserialize<'de> for Entry {
        fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            struct ShotNumbers;
            impl<'de> Visitor<'de> for ShotNumbers {
                type Value = Entry;

                fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                    f.write_str("[ratio, shift], or [ratio, shift, [[order, share], ...]]")
                }

                fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Entry, A::Error> {
                    let mut number = |at| {
                        let element = list.next_element::<f64>()?;
                        element.ok_or_else(|| A::Error::invalid_length(at, &self))
                    };
                    let (ratio, shift) = (number(0)?, number(1)?);
                    let harmonics: Vec<(u8, f64)> = list.next_element()?.unwrap_or_default();
                    let waveform = Waveform::of(&harmonics);
                    // An order that cannot be stored, or one that is there twice.
                    if waveform.harmonics().count() != harmonics.len() {
                        return Err(A::Error::custom(format!(
                            "harmonics {harmonics:?}: write each order from 2 to {} once, with its share",
                            algo::pattern::MAX_ORDER
                        )));
                    }
                    Ok(Entry(Shot {
                        ratio,
                        shift,
                        waveform,
                    }))
                }
            }
            from.deserialize_seq(ShotNumbers)
        }
    }
}
