//! `fringed-lab capture DIR`: pictures of white, black, fringes or files, with a head that need not
//! be calibrated.

use crate::import::{Channel, Picture};
use appliance::cli::numbers::number;
use appliance::cli::{Files, Quiet, Threads, names};
use appliance::error::{Exit, Failure, Result};
use appliance::head::calibration::Calibration;
use appliance::head::rasters::ShownPictures;
use appliance::head::scan::take_loaded;
use appliance::production::backend::{self, OpenedHead};
use hal::bounds::{MAX_FRINGES, shortened};
use hal::frame::Frame;
use hal::projector::Raster;
use hal::replay::recorder;
use std::io::{BufRead as _, IsTerminal as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Take pictures with a head that need not be calibrated.
#[derive(Debug, clap::Args)]
pub struct Capture {
    /// Folder for the pictures; must not exist yet. With fringes it is a recording without models.
    #[arg(value_parser = names::folder())]
    folder: PathBuf,
    /// What to show: white, black, vertical, horizontal, all of these, or grey PNG files of the
    /// projector's size.
    #[arg(long, value_name = "PATTERN,...", default_value = "all", value_delimiter = ',', value_parser = Showing::parse)]
    patterns: Vec<Showing>,
    /// Poses of a board, each in a folder of its own; before each, a line is read from standard
    /// input.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = number(1u8, 99))]
    poses: u8,
    /// Fringes over the projector; without it, one per 12 pixels.
    #[arg(long, value_name = "N", value_parser = number(1e-3, MAX_FRINGES))]
    fringes: Option<f64>,
    /// Levels, from coarse to fine.
    #[arg(long, default_value_t = 3, value_parser = number(1u8, 8))]
    levels: u8,
    /// Shifts per level.
    #[arg(long, default_value_t = 4, value_parser = number(3u8, 64))]
    steps: u8,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    quiet: Quiet,
}

/// What is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Showing {
    /// White, black, vertical and horizontal fringes.
    All,
    White,
    Black,
    Vertical,
    Horizontal,
    /// A picture.
    File(PathBuf),
}

impl Showing {
    fn parse(word: &str) -> Result<Self, &'static str> {
        match word {
            "all" => Ok(Self::All),
            "white" => Ok(Self::White),
            "black" => Ok(Self::Black),
            "vertical" => Ok(Self::Vertical),
            "horizontal" => Ok(Self::Horizontal),
            file if file.to_ascii_lowercase().ends_with(".png") => Ok(Self::File(file.into())),
            _ => Err("write white, black, vertical, horizontal, all, or names of PNG files"),
        }
    }
}

/// Longest wait for one frame.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Everything that is shown in a pose: fringes, white and black, then files.
struct Plan {
    shown: ShownPictures,
    rasters: Vec<Raster>,
    /// Names of the files' frames.
    files: Vec<String>,
}

impl Capture {
    /// Opens the head, takes the pictures of each pose and writes them.
    ///
    /// # Errors
    /// If the head cannot be opened (69), a picture cannot be shown (64, 65, 66), the folder cannot
    /// be written (73), or standard input ends before the last pose (64).
    pub fn run(&self) -> Result<()> {
        if self.folder.exists() {
            let words = format!(
                "capture to {}: it exists already: name a folder that does not exist",
                self.folder.display()
            );
            return Exit::CannotCreate.fail(words);
        }
        let config = self.files.configuration()?;
        let progress = self.quiet.progress();
        let on_progress =
            |share: f64| progress.tell(0.8 * share, "working out the light of the scene");
        let pool = self.threads.pool(config.threads)?;
        let mut opened = pool.install(|| backend::open(&self.files.head(&config), &on_progress))?;
        progress.clear();
        opened.dark.iter().for_each(|words| progress.warn(words));
        let plan = self.plan(&opened.calibration)?;
        opened.head.load(plan.rasters.clone())?;
        for pose in 1..=self.poses {
            let folder = match self.poses {
                1 => self.folder.clone(),
                _ => {
                    self.wait_for(pose)?;
                    self.folder.join(format!("pose-{pose:02}"))
                }
            };
            let taken = take_loaded(&mut opened.head, plan.rasters.len(), TIMEOUT, &|_| ())?;
            let count = taken.len();
            if self.poses > 1 {
                std::fs::create_dir_all(&self.folder)
                    .map_err(Exit::CannotCreate.because(self.folder.display()))?;
            }
            plan.write(&opened, taken, &folder)?;
            self.quiet
                .say(|| format!("took {count} pictures to {}", folder.display()));
        }
        Ok(())
    }

    /// Waits until somebody has laid the board.
    fn wait_for(&self, pose: u8) -> Result<()> {
        let poses = self.poses;
        if std::io::stdin().is_terminal() {
            self.quiet
                .say(|| format!("pose {pose} of {poses}: lay the board, then press Enter"));
        }
        let mut line = String::new();
        let read = std::io::stdin().lock().read_line(&mut line);
        match read {
            Ok(1..) => Ok(()),
            _ => Exit::Usage.fail(format!(
                    "capture pose {pose} of {poses}: standard input has ended: run it in a terminal, or give it a line per pose"
                )),
        }
    }

    /// The rasters to show.
    fn plan(&self, calibration: &Calibration) -> Result<Plan> {
        let shows =
            |one: &Showing| self.patterns.contains(one) || self.patterns.contains(&Showing::All);
        let (levels, steps) = (usize::from(self.levels), usize::from(self.steps));
        let mut shown = ShownPictures::default();
        for (showing, vertical) in [(Showing::Vertical, true), (Showing::Horizontal, false)] {
            if shows(&showing) {
                shown
                    .add_fringes(calibration, vertical, self.fringes, levels, steps)
                    .map_err(Exit::Usage.because("--fringes"))?;
            }
        }
        (shown.white, shown.black) = (shows(&Showing::White), shows(&Showing::Black));
        let mut plan = Plan {
            rasters: shown.rasters(calibration)?,
            shown,
            files: Vec::new(),
        };
        for showing in &self.patterns {
            if let Showing::File(path) = showing {
                plan.rasters.push(raster_of(path, calibration.raster())?);
                let name = path.file_name().unwrap_or(path.as_os_str());
                plan.files.push(format!("file-{}", name.to_string_lossy()));
            }
        }
        Ok(plan)
    }
}

impl Plan {
    /// Writes the frames of a pose: a recording if there are fringes, else pictures alone.
    fn write(&self, opened: &OpenedHead, taken: Vec<Frame>, folder: &Path) -> Result<()> {
        let mut frames = taken.into_iter();
        let mut recording = self.shown.recording(&opened.calibration, &mut frames);
        recording.source = match opened.stage {
            Some(_) => "fringed's simulated head".into(),
            None => "a head of fringed".into(),
        };
        let named: Vec<(String, Frame)> = self.files.iter().cloned().zip(frames).collect();
        recorder::write_frames(&recording, folder, &named).map_err(Exit::CannotCreate.failure())
    }
}

/// The raster of a grey picture of 8 bits.
fn raster_of(path: &Path, (columns, rows): (u32, u32)) -> Result<Raster> {
    let name = path.display();
    if !path.exists() {
        let words =
            format!("show {name}: there is no such file: name a grey PNG of the projector's size");
        return Exit::Missing.fail(words);
    }
    let wrong = |problem: String| Failure::because(Exit::Content, format!("show {name}"), problem);
    let picture = Picture::single(path).map_err(|error| wrong(shortened(&error.to_string())))?;
    let (width, height) = picture.size;
    if picture.size != (columns, rows) || picture.bits != 8 {
        return Err(wrong(format!(
            "{width}×{height} pixels of {} bits, the projector has {columns}×{rows} of 8: save it with these",
            picture.bits
        )));
    }
    let levels = picture.grey(Channel::Luminance).into_iter();
    Ok(Raster::new(
        columns,
        rows,
        levels.map(|level| level as u8).collect(),
    )?)
}
