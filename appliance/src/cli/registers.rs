//! `fringed registers`: the register map in several formats.

use super::options::Json;
use crate::error::Result;
use crate::history::kept;
use crate::modbus::render::{self, SlotName};
use crate::modbus::{registers_csv, registers_json};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Registers {
    #[command(flatten)]
    json: Json,
    /// Print tags to import, one for each element and named bit.
    #[arg(long, conflicts_with = "json")]
    format: Option<Format>,
    /// Name the gauges of this recipe in the descriptions of the tags.
    #[arg(long, value_name = "FILE", requires = "format")]
    recipe: Option<PathBuf>,
}

/// How tags are written.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// CSV: name, address, type, bit, access, description.
    Flat,
    /// The CSV that KEPServerEX imports.
    Kepware,
}

impl Registers {
    /// Prints the map.
    ///
    /// # Errors
    /// If the recipe is not there (66), or is no recipe (65).
    pub fn run(&self) -> Result<()> {
        let Some(format) = self.format else {
            match self.json.json {
                true => say!("{:#}", registers_json()),
                false => say!("{}", registers_csv().trim_end()),
            }
            return Ok(());
        };
        let recipe = self.recipe.as_deref().map(kept::read).transpose()?;
        let slots = recipe.iter().flat_map(|recipe| recipe.demands.slots());
        let names: Vec<SlotName> = slots
            .map(|(slot, name, unit)| SlotName {
                slot,
                name: name.into(),
                unit: unit.symbol(),
            })
            .collect();
        let csv = match format {
            Format::Flat => render::flat(&names),
            Format::Kepware => render::kepware(&names),
        };
        say!("{}", csv.trim_end_matches('\n'));
        Ok(())
    }
}
