//! The frames of one pattern of a recording: how its levels can be unwrapped, and its phases.

use super::code::Code;
use super::scan::{PhasesError, Scan};
use super::seam;
use algo::chain::{Cells, Chain, CodeWord, Edges};
use algo::frame::FrameView;
use algo::geometry::Triangulator;
use algo::pattern::{self, Level, PhaseFunction, Shot};
use algo::phase::LeastModulation;
use algo::pipeline::{self, PhaseMap};
use algo::units::AbsolutePhase;
use hal::replay::Recording;

/// The frames of one pattern of a recording, with its phase function.
pub struct Channel<'a> {
    /// Φ_P.
    pub function: PhaseFunction,
    /// Its frames and levels.
    pub scan: Scan<'a>,
    /// What the frames of the levels show that the scan's decoder takes: of all, or of the finest
    /// alone if the production kernels do not know the levels' form.
    pub shots: Vec<Shot>,
    /// Whether the production kernels know the levels' form.
    recognised: bool,
    code: Option<Code<'a>>,
    bit_depth: u8,
}

/// A phase that is expected of a part, for levels that are unwrapped about a known map.
pub trait Expected {
    /// Its name for reports.
    fn name(&self) -> &'static str;

    /// Φ of each pixel, row-major, for levels that are unwrapped in this way; unknown where their
    /// unwrapping is not safe.
    fn map(&self, unwrapping: pattern::Unwrapping) -> Vec<AbsolutePhase>;

    /// Φ of each pixel for levels that are unwrapped rightly within so many turns of it.
    fn within(&self, turns: f64) -> Vec<AbsolutePhase>;
}

/// Why there are no heights, as the rest of a sentence about them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NoHeights(&'static str);

impl From<&'static str> for NoHeights {
    fn from(words: &'static str) -> Self {
        Self(words)
    }
}

/// How the levels of a pattern become an absolute phase.
pub enum Unwrapping {
    /// By the production kernels, about a map with this name where they need one.
    Planned(Option<(&'static str, Vec<AbsolutePhase>)>),
    /// By a chain of beats, or from a Gray code.
    Chain(Chain),
    /// By a chain about a map with this name.
    About(Chain, (&'static str, Vec<AbsolutePhase>)),
    /// Not at all, and what is missing.
    Missing(String),
}

/// The phases of a pattern.
pub struct Phases {
    /// The absolute phase; without any phase where it is missing.
    pub absolute: PhaseMap,
    /// The wrapped phase of the finest level.
    pub wrapped: PhaseMap,
}

impl<'a> Channel<'a> {
    /// The frames of a pattern; modulations are trusted from `least` on.
    ///
    /// # Errors
    /// The frames make no levels, or are not of one format.
    pub fn new(
        recording: &'a Recording,
        pattern: usize,
        least: LeastModulation,
    ) -> Result<Self, PhasesError> {
        let projector = &recording.projector;
        let spec = &recording.patterns[pattern];
        let (columns, rows) = (projector.width as usize, projector.height as usize);
        let function = seam::phase_function(spec, columns, rows)?;
        let taken = recording.frames.iter();
        let recorded: Vec<_> = taken.filter(|frame| frame.pattern == pattern).collect();
        let shots: Vec<_> = recorded.iter().map(|frame| seam::shot(frame)).collect();
        let frames = || recorded.iter().map(|recorded| &recorded.frame);
        let (scan, recognised) = match Scan::new(function.range(), &shots, frames()) {
            Ok(scan) => (scan, true),
            Err(unknown) => {
                let scan = Scan::of_levels(function.range(), &shots, frames());
                (scan.map_err(|_| unknown)?, false)
            }
        };
        let scan = scan.trusting(least);
        let finest = scan.sequence.levels().last().map(|level| level.ratio);
        let shots = shots
            .into_iter()
            .filter(|shot| recognised || Some(shot.ratio) == finest)
            .collect();
        let code = recording.codes.iter().find(|code| code.pattern == pattern);
        let code = code.map(|code| Code::new(code, recording, finest_frames(&scan)));
        Ok(Self {
            function,
            scan,
            shots,
            recognised,
            code: code.transpose()?,
            bit_depth: recording.bit_depth,
        })
    }

    /// How the levels can be unwrapped: from a code if there is one, else as the production kernels
    /// do, else by beats; about `known` or the reference map where they need a map.
    ///
    /// # Errors
    /// There is a code, and levels and code do not fit each other.
    pub fn unwrapping(
        &self,
        known: Option<&dyn Expected>,
        geometry: &Result<Triangulator, NoHeights>,
    ) -> Result<Unwrapping, PhasesError> {
        if self.code.is_some() {
            return self.chain().map(Unwrapping::Chain);
        }
        let about = |map: &dyn Fn(&dyn Expected) -> Vec<AbsolutePhase>| match (known, geometry) {
            (Some(known), _) => Ok((known.name(), map(known))),
            (None, Ok(triangulator)) => Ok(("reference", triangulator.reference_map())),
            (None, Err(missing)) => Err(missing),
        };
        if !self.recognised {
            let levels = Chain::about_map(self.scan.sequence.levels());
            return Ok(match self.chain() {
                Ok(chain) => Unwrapping::Chain(chain),
                Err(alone) => match about(&|known| known.within(MARGIN * levels.reach())) {
                    Ok(map) => Unwrapping::About(levels, map),
                    Err(_) => Unwrapping::Missing(alone.to_string()),
                },
            });
        }
        if !self.scan.needs_map() {
            return Ok(Unwrapping::Planned(None));
        }
        // What is absolute by itself cannot be ambiguous about the reference map.
        if let (None, Ok(chain)) = (known, self.chain()) {
            return Ok(Unwrapping::Chain(chain));
        }
        let planned = self.scan.decoder.unwrapping();
        Ok(match about(&|known| known.map(planned)) {
            Ok(map) => Unwrapping::Planned(Some(map)),
            Err(missing) => Unwrapping::Missing(format!(
                "{} levels {:?} are unwrapped about a known map, and {missing}: add both models, or give a recipe with a \
                 golden map",
                planned.kind(),
                self.ratios(),
            )),
        })
    }

    /// The chain of the levels, from the code if there is one.
    ///
    /// # Errors
    /// The levels form no chain; what to add.
    pub fn chain(&self) -> Result<Chain, PhasesError> {
        let cells = self.code.as_ref().map(|code| code.cells);
        let (levels, range) = (self.scan.sequence.levels(), self.function.range());
        Ok(Chain::new(levels, range, cells)?)
    }

    /// The phases of every pixel.
    ///
    /// # Errors
    /// Frames and map, or frames and code, do not fit each other.
    pub fn decode(&self, unwrapping: &Unwrapping) -> Result<Phases, PhasesError> {
        let levels = self.scan.sequence.levels();
        let mut maps = match unwrapping {
            Unwrapping::Chain(_) | Unwrapping::About(..) => self.wrapped_levels()?,
            // The production kernels read the other levels themselves.
            _ => vec![self.wrapped(&levels[levels.len() - 1])?],
        };
        let finest = &maps[maps.len() - 1];
        let absolute = match unwrapping {
            Unwrapping::Chain(chain) => {
                let seen = self.seen()?;
                let chain = match (&self.code, &seen) {
                    (Some(code), Some(seen)) => {
                        let edges = Edges::of(finest, seen, &code.cells, self.finest());
                        chain.clone().aligned(&edges)
                    }
                    _ => chain.clone(),
                };
                chain.unwrap(&maps, seen.as_deref())
            }
            Unwrapping::About(chain, (_, map)) => chain.unwrap_about(&maps, map),
            Unwrapping::Planned(map) => {
                let map = map.as_ref().map(|(_, map)| &map[..]);
                self.scan.phases(map)?
            }
            Unwrapping::Missing(_) => PhaseMap {
                phase: vec![AbsolutePhase::UNKNOWN; finest.phase.len()],
                ..finest.clone()
            },
        };
        let wrapped = maps.swap_remove(maps.len() - 1);
        Ok(Phases { absolute, wrapped })
    }

    fn wrapped(&self, level: &Level) -> Result<PhaseMap, PhasesError> {
        let least = self.scan.decoder.least_modulation();
        let frames = &self.scan.frames;
        Ok(pipeline::wrapped(level, frames, self.bit_depth, least)?)
    }

    /// The wrapped phases of all levels, from coarse to fine.
    ///
    /// # Errors
    /// Frames and levels do not fit each other.
    pub fn wrapped_levels(&self) -> Result<Vec<PhaseMap>, PhasesError> {
        let levels = self.scan.sequence.levels().iter();
        levels.map(|level| self.wrapped(level)).collect()
    }

    /// What each pixel sees of the code, if there is one.
    ///
    /// # Errors
    /// Its pictures do not form a code.
    pub fn seen(&self) -> Result<Option<Vec<CodeWord>>, PhasesError> {
        let seen = self.code.as_ref().map(|code| code.pictures.read());
        Ok(seen.transpose()?)
    }

    /// The cells of the code, if there is one.
    pub fn cells(&self) -> Option<Cells> {
        self.code.as_ref().map(|code| code.cells)
    }

    /// The ratios from coarse to fine.
    pub fn ratios(&self) -> Vec<f64> {
        let levels = self.scan.sequence.levels().iter();
        levels.map(|level| level.ratio).collect()
    }

    /// Columns and rows of the frames.
    fn size(&self) -> (usize, usize) {
        let first = self.scan.frames.first();
        first.map_or((1, 1), |frame| (frame.width(), frame.height()))
    }

    /// The ratio of the finest level.
    pub fn finest(&self) -> f64 {
        self.ratios().last().copied().unwrap_or(1.0)
    }

    /// The offset of the finest level as 8 bits.
    pub fn intensity(&self) -> Vec<u8> {
        algo::frame::mean(&finest_frames(&self.scan), self.scan.decoder.full_scale())
    }
}

impl Unwrapping {
    /// The word for reports.
    pub fn kind(&self, channel: &Channel<'_>) -> &'static str {
        match self {
            Self::Chain(chain) | Self::About(chain, _) => chain.kind(),
            Self::Missing(_) if !channel.recognised => "wrapped",
            _ => channel.scan.decoder.unwrapping().kind(),
        }
    }

    /// The steps of a chain.
    pub fn steps(&self) -> Option<Vec<String>> {
        match self {
            Self::Chain(chain) | Self::About(chain, _) => Some(chain.steps()),
            _ => None,
        }
    }

    /// The name of the map about which the levels are unwrapped.
    pub fn map(&self) -> Option<&'static str> {
        match self {
            Self::Planned(map) => map.as_ref().map(|(name, _)| *name),
            Self::About(_, (name, _)) => Some(*name),
            _ => None,
        }
    }

    /// What is ambiguous about levels that are unwrapped about the reference map, in words: the
    /// working range holds more turns than they tell apart.
    pub fn ambiguity(
        &self,
        channel: &Channel<'_>,
        geometry: &Result<Triangulator, NoHeights>,
    ) -> Option<String> {
        let triangulator = geometry.as_ref().ok()?;
        let reach = match self {
            Self::About(chain, _) => chain.reach(),
            Self::Planned(_) => {
                let finest = channel.finest();
                half_beat(channel.scan.decoder.unwrapping())? / finest
            }
            _ => return None,
        };
        if self.map() != Some("reference") {
            return None;
        }
        let (width, height) = channel.size();
        let along = |length: usize| {
            (0..=PLACES).map(move |at| at as f64 / PLACES as f64 * (length - 1) as f64)
        };
        let places = along(height).flat_map(|v| along(width).map(move |u| (u, v)));
        let apart = places.filter_map(|(u, v)| triangulator.phase_reach(u, v));
        let (turns, z) = apart.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (turns > reach).then(|| {
            format!(
                "heights that are more than about {:.1} mm off the plane are wrong by whole fringes: levels are told apart within \
                 {reach:.1} turns of the reference map, and the working range has up to {turns:.1}: add a coarser level, give a \
                 recipe or --about, or narrow the working range (range_mm)",
                z.abs() * reach / turns
            )
        })
    }

    /// Why there is no absolute phase, if there is none.
    pub fn missing(&self) -> Option<&str> {
        match self {
            Self::Missing(missing) => Some(missing),
            _ => None,
        }
    }
}

/// Part of the reach of levels about a map that a recipe's placements may use.
const MARGIN: f64 = 0.8;
/// Parts of the frame's width and height at whose ends the working range is looked at.
const PLACES: usize = 16;

/// Half of the coarsest beat of levels that are unwrapped about a map, in turns of the finest.
fn half_beat(unwrapping: pattern::Unwrapping) -> Option<f64> {
    match unwrapping {
        pattern::Unwrapping::Geometric => None,
        pattern::Unwrapping::Single => Some(0.5),
        pattern::Unwrapping::DenseTwo { n } => Some(n / 2.0),
        pattern::Unwrapping::DenseThree { n } => Some(n * n / 2.0),
    }
}

/// The frames of the finest level.
fn finest_frames<'a>(scan: &Scan<'a>) -> Vec<FrameView<'a>> {
    let levels = scan.sequence.levels();
    let finest = levels[levels.len() - 1].frames.iter();
    finest.map(|&at| scan.frames[usize::from(at)]).collect()
}
