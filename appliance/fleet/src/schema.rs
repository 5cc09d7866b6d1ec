//! `fringed-fleet schema`: the tables and views of a store, for whoever makes them by hand.

use crate::error::Result;
use crate::store::{Kind, schema};

/// Print the tables and views of a store.
#[derive(Debug, clap::Args)]
pub struct Schema {
    /// What the store is made of.
    #[arg(long, value_enum)]
    store: Kind,
}

impl Schema {
    /// Prints SQL.
    ///
    /// # Errors
    /// None.
    pub fn run(&self) -> Result<()> {
        say!("{}", schema(self.store).trim_end());
        Ok(())
    }
}
