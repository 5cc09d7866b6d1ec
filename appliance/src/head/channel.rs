//! The frames of one pattern of a recording: how its levels can be unwrapped, and its phases.

use super::scan::Scan;
use super::seam;
use algo::chain::{Cells, Chain, CodePictures, GrayCode};
use algo::frame::FrameView;
use algo::geometry::Triangulator;
use algo::pattern::{self, Level, PhaseFunction, Shot};
use algo::phase::LeastModulation;
use algo::pipeline::{self, PhaseMap};
use algo::units::AbsolutePhase;
use hal::frame::Frame;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedCode};

/// The frames of one pattern of a recording, with its phase function.
pub struct Channel<'a> {
    /// Φ_P.
    pub function: PhaseFunction,
    /// Its frames and levels.
    pub scan: Scan<'a>,
    /// What the frames of the levels show that the scan's decoder takes: of all, or of the finest alone if the production kernels do not know
    /// the levels' form.
    pub shots: Vec<Shot>,
    /// Whether the production kernels know the levels' form.
    recognised: bool,
    code: Option<Code<'a>>,
    bit_depth: u8,
}

/// A Gray code beside the levels.
struct Code<'a> {
    pictures: CodePictures<'a>,
    cells: Cells,
}

/// A phase that is expected of a part, for levels that are unwrapped about a known map.
pub trait Expected {
    /// Its name for reports.
    fn name(&self) -> &'static str;

    /// Φ of each pixel, row-major, for levels that are unwrapped in this way; unknown where it is not safe for them.
    fn map(&self, unwrapping: pattern::Unwrapping) -> Vec<AbsolutePhase>;
}

/// How the levels of a pattern become an absolute phase.
pub enum Unwrapping {
    /// By the production kernels, about a map with this name where they need one.
    Planned(Option<(&'static str, Vec<AbsolutePhase>)>),
    /// By a chain of beats, or from a Gray code.
    Chain(Chain),
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
    /// The frames of a pattern, of which modulations are trusted from `least` on.
    ///
    /// # Errors
    /// In words: the frames make no levels, or are not of one format.
    pub fn new(
        recording: &'a Recording,
        pattern: usize,
        least: LeastModulation,
    ) -> Result<Self, String> {
        let projector = &recording.projector;
        let spec = &recording.patterns[pattern];
        let (columns, rows) = (projector.width as usize, projector.height as usize);
        let function = seam::phase_function(spec, columns, rows).map_err(words)?;
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
        let code = code.map(|code| Code::new(code, recording, spec, &scan));
        Ok(Self {
            function,
            scan,
            shots,
            recognised,
            code: code.transpose()?,
            bit_depth: recording.bit_depth,
        })
    }

    /// How the levels can be unwrapped: from a code if there is one, else as the production kernels do, about `known` or the
    /// reference map where they need a map, else by beats.
    ///
    /// # Errors
    /// In words: there is a code, and levels and code do not fit each other; or there are models, so that heights are expected, and
    /// the levels have no absolute phase.
    pub fn unwrapping(
        &self,
        known: Option<&dyn Expected>,
        geometry: &Result<Triangulator, String>,
    ) -> Result<Unwrapping, String> {
        if self.code.is_some() {
            return self.chain().map(Unwrapping::Chain);
        }
        if !self.recognised {
            return match (self.chain(), geometry) {
                (Ok(chain), _) => Ok(Unwrapping::Chain(chain)),
                (Err(missing), Err(_)) => Ok(Unwrapping::Missing(missing)),
                (Err(wrong), Ok(_)) => Err(wrong),
            };
        }
        if !self.scan.needs_map() {
            return Ok(Unwrapping::Planned(None));
        }
        let map = match (known, geometry) {
            (Some(known), _) => (known.name(), known.map(self.scan.decoder.unwrapping())),
            (None, Ok(triangulator)) => ("reference", triangulator.reference_map()),
            (None, Err(missing)) => {
                let missing = || {
                    format!(
                        "{} levels {:?} are unwrapped about a known map, and {missing}: add both models, or give a \
                     recipe with a golden map",
                        self.scan.decoder.unwrapping().kind(),
                        self.ratios(),
                    )
                };
                let chain = self.chain().map(Unwrapping::Chain);
                return Ok(chain.unwrap_or_else(|_| Unwrapping::Missing(missing())));
            }
        };
        Ok(Unwrapping::Planned(Some(map)))
    }

    /// The chain of the levels, from the code if there is one.
    ///
    /// # Errors
    /// In words: there is none, and what to add.
    pub fn chain(&self) -> Result<Chain, String> {
        let cells = self.code.as_ref().map(|code| code.cells);
        Chain::new(self.scan.sequence.levels(), self.function.range(), cells).map_err(words)
    }

    /// The phases of every pixel.
    ///
    /// # Errors
    /// In words: frames and map, or frames and code, do not fit each other.
    pub fn decode(&self, unwrapping: &Unwrapping) -> Result<Phases, String> {
        if let Unwrapping::Chain(chain) = unwrapping {
            let (mut maps, cells) = (self.wrapped_levels()?, self.cells()?);
            let absolute = chain.unwrap(&maps, cells.as_deref());
            let wrapped = maps.swap_remove(maps.len() - 1);
            return Ok(Phases { absolute, wrapped });
        }
        let levels = self.scan.sequence.levels();
        let wrapped = self.wrapped(&levels[levels.len() - 1])?;
        let absolute = match unwrapping {
            Unwrapping::Planned(map) => {
                let map = map.as_ref().map(|(_, map)| &map[..]);
                self.scan.phases(map)?
            }
            _ => PhaseMap {
                phase: vec![AbsolutePhase::UNKNOWN; wrapped.phase.len()],
                ..wrapped.clone()
            },
        };
        Ok(Phases { absolute, wrapped })
    }

    fn wrapped(&self, level: &Level) -> Result<PhaseMap, String> {
        let least = self.scan.decoder.least_modulation();
        pipeline::wrapped(level, &self.scan.frames, self.bit_depth, least).map_err(words)
    }

    /// The wrapped phases of all levels, from coarse to fine.
    ///
    /// # Errors
    /// In words: frames and levels do not fit each other.
    pub fn wrapped_levels(&self) -> Result<Vec<PhaseMap>, String> {
        let levels = self.scan.sequence.levels().iter();
        levels.map(|level| self.wrapped(level)).collect()
    }

    /// The cell of the code that each pixel sees, if there is a code.
    ///
    /// # Errors
    /// In words: its pictures do not form a code.
    pub fn cells(&self) -> Result<Option<Vec<u16>>, String> {
        let cells = self.code.as_ref().map(|code| code.pictures.cells());
        cells.transpose().map_err(words)
    }

    /// The ratios from coarse to fine.
    pub fn ratios(&self) -> Vec<f64> {
        let levels = self.scan.sequence.levels().iter();
        levels.map(|level| level.ratio).collect()
    }

    /// The offset of the finest level as 8 bits.
    pub fn intensity(&self) -> Vec<u8> {
        algo::frame::mean(&finest(&self.scan), self.scan.decoder.full_scale())
    }
}

impl<'a> Code<'a> {
    fn new(
        code: &'a RecordedCode,
        recording: &'a Recording,
        spec: &PatternSpec,
        scan: &Scan<'a>,
    ) -> Result<Self, String> {
        let projector = &recording.projector;
        let (fringes, length) = match spec {
            PatternSpec::Vertical { fringes } => (*fringes, projector.width),
            PatternSpec::Horizontal { fringes } => (*fringes, projector.height),
            PatternSpec::File { .. } => return Err("a Gray code numbers straight fringes".into()),
        };
        let view = |frame: &'a Frame| seam::view(frame).map_err(words);
        let views = |frames: &'a [Frame]| -> Result<Vec<FrameView<'a>>, String> {
            let frames = frames.iter();
            frames.map(view).collect()
        };
        let against = match (&recording.white, &recording.black) {
            _ if !code.inverse.is_empty() => {
                let inverse = views(&code.inverse)?.into_iter();
                inverse.map(|inverse| vec![inverse]).collect()
            }
            (Some(white), Some(black)) => vec![vec![view(white)?, view(black)?]],
            _ => vec![finest(scan)],
        };
        let pixel = fringes / f64::from(length);
        let gray = GrayCode {
            bits: code.bits.len() as u8,
            cell: code.cell_px,
        };
        Ok(Self {
            pictures: CodePictures {
                bits: views(&code.bits)?,
                against,
            },
            // The first cell begins at the edge of pixel 0, whose centre has phase 0.
            cells: Cells {
                origin: -0.5 * pixel,
                width: gray.cell * pixel,
                count: gray.cells(length),
            },
        })
    }
}

impl Unwrapping {
    /// The word for reports.
    pub fn kind(&self, channel: &Channel<'_>) -> &'static str {
        match self {
            Self::Chain(chain) => chain.kind(),
            Self::Missing(_) if !channel.recognised => "wrapped",
            _ => channel.scan.decoder.unwrapping().kind(),
        }
    }

    /// The steps of a chain.
    pub fn steps(&self) -> Option<Vec<String>> {
        match self {
            Self::Chain(chain) => Some(chain.steps()),
            _ => None,
        }
    }

    /// The name of the map about which the levels are unwrapped.
    pub fn map(&self) -> Option<&'static str> {
        match self {
            Self::Planned(map) => map.as_ref().map(|(name, _)| *name),
            _ => None,
        }
    }

    /// Why there is no absolute phase, if there is none.
    pub fn missing(&self) -> Option<&str> {
        match self {
            Self::Missing(missing) => Some(missing),
            _ => None,
        }
    }
}

/// The frames of the finest level.
fn finest<'a>(scan: &Scan<'a>) -> Vec<FrameView<'a>> {
    let levels = scan.sequence.levels();
    let finest = levels[levels.len() - 1].frames.iter();
    finest.map(|&at| scan.frames[usize::from(at)]).collect()
}

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}
