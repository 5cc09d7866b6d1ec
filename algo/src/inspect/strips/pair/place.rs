//! How a part lies by a pair of frames, and its phases.

use super::expected::Expectation;
use super::terms::SIDE;
use super::window::{BAND_ROWS, Band, Windows};
use crate::frame::FrameView;
use crate::inspect::align::{Alignment, Found, Placed, Spot};
use crate::inspect::strips::decode::Input;
use crate::inspect::strips::displaced::BlockNumbers;
use crate::inspect::strips::plan::Production;
use crate::inspect::strips::pose::{PoseField, blocks_of_row};
use crate::inspect::strips::strip::Strips;
use crate::phase::{DecodeError, PhaseRow};
use crate::pipeline::{PhaseMap, for_each};
use alloc::vec::Vec;

/// The buffers of a pair, allocated once.
#[derive(Debug)]
pub struct PairBuffers {
    windows: Windows,
    /// What was measured last.
    phases: PhaseMap,
    /// Of each band of rows: the buffers of its windows, and the displacements along a row.
    bands: Vec<(Band, Vec<BlockNumbers>)>,
}

impl PairBuffers {
    /// What was measured last, for [`Input::Phases`].
    pub fn phases(&self) -> &PhaseMap {
        &self.phases
    }
}

/// How a part lies by a pair.
#[derive(Clone, Debug)]
pub struct PairPlaced {
    /// By its picture; none where that does not determine it.
    pub found: Option<Found>,
    /// By its phases; none as in [`Production::place`].
    pub placed: Option<Placed>,
}

impl Production {
    /// Buffers for frames of this size.
    pub fn pair_buffers(&self) -> PairBuffers {
        let (width, height) = self.golden.size();
        let decoder = &self.phase.decoder;
        PairBuffers {
            windows: Windows::new(
                decoder.backend(),
                decoder.bit_depth(),
                self.phase.noise_counts,
                decoder.least_modulation(),
            ),
            phases: PhaseMap::new(width, height),
            bands: (0..height.div_ceil(BAND_ROWS))
                .map(|_| (Band::default(), blocks_of_row(width)))
                .collect(),
        }
    }

    /// Finds how the part lies, from its picture on ([`Self::with_picture`]), and measures its phases
    /// into the buffers.
    ///
    /// # Errors
    /// If the frames are not two of this size and bit depth.
    pub fn place_pair(
        &self,
        frames: &[FrameView<'_>],
        strips: &mut Strips,
        buffers: &mut PairBuffers,
    ) -> Result<PairPlaced, DecodeError> {
        self.phase.decoder.check(frames)?;
        let &[plus, minus] = frames else {
            return Err(DecodeError::FrameCount {
                expected: 2,
                given: frames.len(),
            });
        };
        let frames = [plus, minus];
        let triangulator = &self.golden.triangulator;
        let shown = (self.phase.decoder.backend(), &frames[..]);
        let found = self
            .picture
            .as_ref()
            .and_then(|picture| picture.find(triangulator, shown, &mut strips.pictures));
        let motion = found.map(|found| found.motion);
        if let Some(motion) = &motion {
            strips.pose.displace(&self.golden, motion);
        }
        let pose = motion.is_some().then_some(&strips.pose);
        if let Some(alignment) = &self.alignment {
            self.fit_pair(frames, pose, buffers, Some(alignment));
        }
        let mut placed = self.place_from(Input::Phases(&buffers.phases), strips, motion)?;
        if let Some(placed) = &mut placed {
            placed.steered = found.is_some() && !placed.free.is_empty();
        }
        if let Some(placed) = &placed {
            strips.pose.displace(&self.golden, &placed.motion);
        }
        let pose = (placed.is_some() || motion.is_some()).then_some(&strips.pose);
        self.fit_pair(frames, pose, buffers, None);
        Ok(PairPlaced { found, placed })
    }

    /// Measures the phases of a part that lies as in a field, as taught if none: in all rows, or
    /// only in those that its motion is found from.
    fn fit_pair(
        &self,
        frames: [FrameView<'_>; 2],
        pose: Option<&PoseField>,
        buffers: &mut PairBuffers,
        only: Option<&Alignment>,
    ) {
        let PairBuffers {
            windows,
            phases,
            bands,
            ..
        } = buffers;
        let expectation = Expectation {
            backend: self.phase.decoder.backend(),
            golden: &self.golden,
            pose,
        };
        let mut rows = phases.rows();
        let work: Vec<_> = rows.chunks_mut(BAND_ROWS).zip(bands).collect();
        for_each(work, |at, (rows, (band, blocks))| {
            let top = at * BAND_ROWS;
            let mut fit = |rows: &mut [PhaseRow<'_>], top: usize| {
                windows.fit(frames, top, rows, band, |v, out| {
                    expectation.row(v, blocks, out);
                });
            };
            let Some(alignment) = only else {
                return fit(rows, top);
            };
            let (_, spots) = alignment.spots(top..top + rows.len());
            for near in spots.chunk_by(share_rows) {
                let (first, last) = (near[0].v, near[near.len() - 1].v);
                fit(&mut rows[first - top..=last - top], first);
            }
        });
    }
}

/// Whether the windows of two spots share rows.
fn share_rows(a: &Spot, b: &Spot) -> bool {
    b.v - a.v < SIDE
}
