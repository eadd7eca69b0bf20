//! A folder of measured drives as `sim-server diagnose` and `identify` read it.

use std::path::Path;

/// A folder on its way.
pub(crate) struct Folder<'a> {
    dir: &'a Path,
    index: String,
}

impl<'a> Folder<'a> {
    /// A new one of drives of a truck.
    pub(crate) fn new(dir: &'a Path, truck: &str) -> Result<Self, Box<dyn std::error::Error>> {
        std::fs::create_dir_all(dir)?;
        Ok(Self { dir, index: format!("schema = 1\ntruck = {truck:?}\n") })
    }

    /// Adds a drive with its table, and what the index says of it.
    pub(crate) fn add(&mut self, name: &str, csv: &str, known: &str) -> crate::Outcome {
        std::fs::write(self.dir.join(format!("{name}.csv")), csv)?;
        self.index += &format!("\n[[drive]]\nname = {name:?}\nfile = \"{name}.csv\"\n{known}\n");
        Ok(())
    }

    /// Writes the index.
    pub(crate) fn write(&self) -> crate::Outcome {
        std::fs::write(self.dir.join("drives.toml"), &self.index)?;
        println!("drives in {}", self.dir.display());
        Ok(())
    }
}
