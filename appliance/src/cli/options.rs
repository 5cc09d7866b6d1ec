//! Options that several commands share, in groups; among them those for the part in front of a simulated
//! head.

use super::numbers::{address, number, numbers};
use crate::access::{Change, ChangeRecord};
use crate::config::{Backend, Config, HeadConfig};
use crate::error::{Exit, Failure, Result};
use crate::head::placed::Placed;
use crate::production::backend;
use crate::storage::state::StateFolder;
use crate::system::journal::{self, Severity};
use crate::system::progress::Progress;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Arg, Args, Command};
use hal::bounds::{Bound, Fields, MAX_PLACEMENT_MM, MAX_ROTATION_DEG, MAX_TILT_DEG, clipped};
use serde::Serialize;
use sim::parts::Board;
use sim::{Ground, Material, Scenario, Unsteady};
use std::ffi::OsString;
use std::fmt::Display;
use std::net::SocketAddr;
use std::path::PathBuf;

/// The station: its configuration and its state.
#[derive(Clone, Debug, Args)]
pub struct Files {
    /// Configuration file (TOML); `fringed config keys` lists its keys.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// State folder: recipes, history, result counter, serial.
    #[arg(long, value_name = "DIR")]
    pub state: Option<PathBuf>,
}

/// The addresses on which the station serves.
#[derive(Clone, Debug, Args)]
pub struct Listen {
    /// Where to serve Modbus TCP.
    #[arg(long, value_name = "ADDR:PORT", value_parser = address)]
    modbus: Option<SocketAddr>,
    /// Where to serve the page.
    #[arg(long, value_name = "ADDR:PORT", value_parser = address)]
    http: Option<SocketAddr>,
}

/// The number of computing threads.
#[derive(Clone, Debug, Args)]
pub struct Threads {
    /// Computing threads; 0 = one per core.
    #[arg(long, value_name = "N", value_parser = number(0u16, 256))]
    threads: Option<u16>,
}

/// Whether progress, log and tables are printed.
#[derive(Clone, Copy, Debug, Args)]
pub struct Quiet {
    /// No progress, no log, no table.
    #[arg(long)]
    quiet: bool,
}

/// Whether the result is printed as JSON.
#[derive(Clone, Copy, Debug, Args)]
pub struct Json {
    /// Print JSON where a table would be printed.
    #[arg(long)]
    pub json: bool,
}

/// How the result of a command is printed.
#[derive(Clone, Copy, Debug, Args)]
pub struct Output {
    #[command(flatten)]
    quiet: Quiet,
    #[command(flatten)]
    json: Json,
}

/// The options of commands that run the station.
#[derive(Clone, Debug, Args)]
pub struct Serving {
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    listen: Listen,
    #[command(flatten)]
    pub threads: Threads,
}

/// The options of commands that measure once with the station's configuration and state.
#[derive(Clone, Debug, Args)]
pub struct Measuring {
    #[command(flatten)]
    pub files: Files,
    #[command(flatten)]
    pub threads: Threads,
    #[command(flatten)]
    pub output: Output,
}

impl Files {
    /// The configuration: the named file or the defaults, with the state folder of the command
    /// line.
    ///
    /// # Errors
    /// If the file is missing or wrong.
    pub fn configuration(&self) -> Result<Config> {
        let mut config = match &self.config {
            Some(path) => Config::read(path)?,
            None => Config::default(),
        };
        if let Some(state) = &self.state {
            config.state = Some(state.clone());
        }
        config.check().map_err(Exit::Configuration.failure())?;
        Ok(config)
    }

    /// The configured state folder, else the default one of the platform.
    ///
    /// # Errors
    /// If the configuration is wrong, or the platform has no default.
    pub fn state_folder(&self) -> Result<PathBuf> {
        match self.configuration()?.state {
            Some(path) => Ok(path),
            None => StateFolder::default_path(),
        }
    }

    /// The record of changes in the state folder.
    ///
    /// # Errors
    /// As [`Self::state_folder`].
    pub fn record(&self) -> Result<ChangeRecord> {
        let most = u64::from(self.configuration()?.access.record_mib) << 20;
        Ok(ChangeRecord::of(&self.state_folder()?, most))
    }

    /// Records what a command has changed. That it was done is not taken back where this fails.
    pub fn note(&self, change: &Change) {
        let noted = self.record().and_then(|record| {
            let failed = Exit::CannotCreate.advising("record the change", "free space");
            record.add(change).map_err(failed)
        });
        if let Err(failure) = noted {
            journal::write(Severity::Warning, &failure.to_string());
        }
    }

    /// The configured head, with the calibration in the state folder unless the configuration names
    /// another.
    pub fn head(&self, config: &Config) -> HeadConfig {
        match self.state_folder() {
            Ok(state) => config.head_in(&state),
            Err(_) => config.head.clone(),
        }
    }
}

impl Measuring {
    /// The configuration, with a simulated head of a scenario if one is named.
    ///
    /// # Errors
    /// If the file is missing or wrong; if the head plays recordings, and `why` not (64).
    pub fn live(&self, scenario: Option<&PathBuf>, why: &str) -> Result<Config> {
        let mut config = self.files.configuration()?;
        if let Some(scenario) = scenario {
            (config.head.backend, config.head.scenario) = (Backend::Sim, Some(scenario.clone()));
        }
        let remedy = "configure another head or name a scenario with --scenario";
        match config.head.backend {
            Backend::Replay => Err(Failure::because(Exit::Usage, why, remedy)),
            Backend::Sim | Backend::Rpi => Ok(config),
        }
    }
}

impl Serving {
    /// The configuration, with the addresses of the command line.
    ///
    /// # Errors
    /// If the file is missing or wrong.
    pub fn configuration(&self) -> Result<Config> {
        let mut config = self.files.configuration()?;
        if let Some(listen) = self.listen.modbus {
            config.modbus.listen = listen;
        }
        if let Some(listen) = self.listen.http {
            config.http.listen = listen;
        }
        Ok(config)
    }
}

impl Threads {
    /// A pool of computing threads: as many as the command line says, else `configured`; 0 = one
    /// per core.
    ///
    /// # Errors
    /// If threads cannot be started (exit code 70).
    pub fn pool(&self, configured: usize) -> Result<rayon::ThreadPool> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads.map_or(configured, usize::from))
            .thread_name(|at| format!("computing-{at}"))
            .build()
            .map_err(Exit::Software.because("start the computing threads"))
    }
}

impl Quiet {
    /// Progress, silent with `--quiet`.
    pub fn progress(self) -> Progress {
        Progress::new(self.quiet)
    }

    /// Prints what was done, unless `--quiet` is given.
    pub fn say(self, words: impl FnOnce() -> String) {
        if !self.quiet {
            say!("{}", words().trim_end());
        }
    }
}

impl Output {
    /// What shows the progress, as the options of output say.
    pub fn progress(self) -> Progress {
        self.quiet.progress()
    }

    /// Prints the result: as JSON for programs, else as text for people, unless `--quiet` is given.
    ///
    /// # Errors
    /// If it cannot be written as JSON (70).
    pub fn answer(self, result: &impl Serialize, text: impl FnOnce() -> String) -> Result<()> {
        if self.is_json() {
            let json = serde_json::to_string_pretty(result);
            let failed = Exit::Software.because("write the result");
            say!("{}", json.map_err(failed)?);
        } else {
            self.quiet.say(text);
        }
        Ok(())
    }

    /// Prints a remark for people: neither beside JSON nor with `--quiet`.
    pub fn remark(self, words: impl FnOnce() -> String) {
        if !self.is_json() {
            self.quiet.say(words);
        }
    }

    /// Whether the result is printed as JSON.
    pub fn is_json(self) -> bool {
        self.json.json
    }
}

/// Moves options that stand before a command behind it, where clap expects them: `fringed --state
/// DIR recipe list` becomes `fringed recipe list --state DIR`. Clap then checks that the command
/// has these options.
pub fn behind_the_command(
    tree: &Command,
    arguments: impl Iterator<Item = OsString>,
) -> Vec<OsString> {
    let mut arguments = arguments;
    let mut words: Vec<OsString> = arguments.next().into_iter().collect();
    let mut options = Vec::new();
    let mut command = tree;
    while let Some(argument) = arguments.next() {
        let text = argument.to_str().unwrap_or_default();
        if let Some(name) = text.strip_prefix("--")
            && let (long, value) = name
                .split_once('=')
                .map_or((name, None), |(long, value)| (long, Some(value)))
            && let Some(known) = option(tree, long)
        {
            let more = known.get_action().takes_values() && value.is_none();
            options.push(argument);
            if more {
                options.extend(arguments.next());
            }
        } else if let Some(found) = command.find_subcommand(text) {
            words.push(argument);
            command = found;
            if !command.has_subcommands() {
                break;
            }
        } else {
            options.push(argument);
            break;
        }
    }
    words.extend(options.into_iter().chain(arguments));
    words
}

/// The option of this name, of whichever command.
fn option<'a>(tree: &'a Command, long: &str) -> Option<&'a Arg> {
    let own = tree
        .get_arguments()
        .find(|argument| argument.get_long() == Some(long));
    own.or_else(|| {
        tree.get_subcommands()
            .find_map(|command| option(command, long))
    })
}

/// The part in front of a simulated head, if not the scenario's.
#[derive(Clone, Debug, Default, PartialEq, clap::Args)]
pub struct SimulatedPart {
    /// Put this stock part in front of the simulated head: sheet_metal, flowerpot, cone, sawtooth,
    /// sphere, tube, spline, face, handset, plane, board, empty, plate or joint.
    #[arg(long, value_name = "KIND")]
    part: Option<String>,
    /// Give the simulated part a defect: dent:X,Y,DEPTH,DIAMETER in mm along its normal, of sheet_metal and plate
    /// missing_hole:INDEX, of sheet_metal bent_flange:DEGREES, of plate displaced_hole:INDEX,DX,DY or
    /// hole_radius:INDEX,RADIUS; more than once for more.
    #[arg(long, value_name = "KIND:NUMBERS")]
    defect: Vec<String>,
    /// What the simulated part is made of: matte, rolled_steel, oiled or black_plastic. If it is left out, the
    /// scenario's light says how a part reflects.
    #[arg(long, value_name = "NAME", value_parser = material())]
    material: Option<Material>,
    /// Lay the simulated part over a floor that reflects ALBEDO, 0 to 1, so many mm below its lowest point; "none" is
    /// black space. If it is left out, the floor is the scenario's.
    #[arg(long, value_name = "ALBEDO,DEPTH", value_parser = floor)]
    floor: Option<Lies>,
    /// Let light and part change while frames are taken: keys of the scenario's `[unsteady]`, as in
    /// lamp_depth=0.4,shake_mm=[0,0,0.1]. If it is left out, they do as the scenario says.
    #[arg(long, value_name = "KEY=VALUE,…", value_parser = unsteady)]
    unsteady: Option<Unsteady>,
    /// Place the simulated board in this one of the ten poses that are recommended for a
    /// calibration; 10 lies in z = 0.
    #[arg(long, value_name = "NUMBER", value_parser = number(1, Board::POSES.len() as u8), conflicts_with_all = ["shift", "tilt", "rotate"])]
    pose: Option<u8>,
    /// Move the simulated part by this, mm.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>(MAX_PLACEMENT_MM), allow_hyphen_values = true)]
    shift: Option<[f64; 3]>,
    /// Tilt the simulated part about x and y, degrees.
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>(MAX_TILT_DEG), allow_hyphen_values = true)]
    tilt: Option<[f64; 2]>,
    /// Turn the simulated part about z, degrees.
    #[arg(long, value_name = "DEGREES", value_parser = number(-MAX_ROTATION_DEG, MAX_ROTATION_DEG), allow_hyphen_values = true)]
    rotate: Option<f64>,
}

impl SimulatedPart {
    /// The part that the options describe, if any is given.
    ///
    /// # Errors
    /// If the configured head is not simulated, or there is no such part, defect or placement (64).
    pub fn placed(&self, head: &HeadConfig) -> Result<Option<Placed>> {
        if *self == Self::default() {
            return Ok(None);
        }
        let usage = |words: &dyn Display| {
            Failure::because(Exit::Usage, "put a part in front of the head", words)
        };
        if head.backend != Backend::Sim {
            return Err(usage(
                &"the configured head is not simulated: leave out --part, --defect, --material, --floor, --unsteady, --pose, --shift, --tilt and --rotate",
            ));
        }
        let scenario = backend::scenario(head.scenario.as_deref())?;
        let mut placed = match &self.part {
            Some(kind) => Placed::stock(kind).map_err(|error| usage(&error))?,
            None => Placed {
                part: scenario.part,
                material: scenario.material,
                placement: scenario.placement,
                floor: None,
                unsteady: None,
            },
        };
        placed.material = self.material.or(placed.material);
        placed.floor = self.floor.clone().map(|lies| lies.0);
        placed.unsteady = self.unsteady;
        for defect in &self.defect {
            let added = placed.add_defect(defect).and_then(|()| placed.check());
            added.map_err(|words| usage(&format_args!("--defect {}: {words}", clipped(defect))))?;
        }
        if let Some(pose) = self.pose {
            let posed = placed.pose(pose);
            posed.map_err(|words| usage(&format_args!("--pose: {words}")))?;
        }
        let place = &mut placed.placement;
        place.shift_mm = self.shift.unwrap_or(place.shift_mm);
        place.tilt_deg = self.tilt.unwrap_or(place.tilt_deg);
        place.rotation_deg = self.rotate.unwrap_or(place.rotation_deg);
        placed.check().map_err(|error| usage(&error))?;
        Ok(Some(placed))
    }
}

/// A floor below a part, or none.
#[derive(Clone, Debug, PartialEq)]
struct Lies(Option<Ground>);

fn floor(given: &str) -> Result<Lies, String> {
    if given == "none" {
        return Ok(Lies(None));
    }
    let pair = given.split_once(',');
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let pair = pair.and_then(|(albedo, depth)| number(albedo).zip(number(depth)));
    let (albedo, depth_mm) = pair.ok_or("write ALBEDO,DEPTH as in 0.35,20, or none")?;
    let ground = Ground {
        albedo,
        depth_mm,
        ..Ground::default()
    };
    Fields.check("floor", &ground)?;
    Ok(Lies(Some(ground)))
}

fn unsteady(given: &str) -> Result<Unsteady, String> {
    let table = format!("unsteady = {{ {given} }}");
    let scenario = Scenario::from_toml(&table, "--unsteady").map_err(|error| {
        let problem = error.problem;
        format!("write keys of [unsteady] with their values, as in lamp_depth=0.4: {problem}")
    })?;
    Ok(scenario.unsteady)
}

/// A material by its name.
fn material() -> impl TypedValueParser<Value = Material> {
    let names = Material::ALL.map(|(_, name)| name);
    PossibleValuesParser::new(names).try_map(|name| {
        let known = Material::ALL.iter().find(|(_, known)| *known == name);
        known
            .map(|(material, _)| *material)
            .ok_or("no such material")
    })
}
