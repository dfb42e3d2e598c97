//! Limits on reading: which files may be opened, and how much memory may be used.

use std::path::PathBuf;

use sheetsplat::volume::ReadOptions;

#[derive(clap::Args)]
pub(crate) struct Reading {
    /// Read no file outside this folder once links are followed: neither the input nor the files it names.
    #[arg(long, value_name = "DIR")]
    confine: Option<PathBuf>,
    /// Maximum memory for the volume and its labels, or for each image, such as 2GiB. The default is three quarters of what the
    /// machine has or the process's control group may use.
    #[arg(long, value_name = "SIZE", value_parser = ReadOptions::parse_memory)]
    memory: Option<u64>,
}

impl Reading {
    pub(crate) fn options(&self) -> ReadOptions {
        let mut options = ReadOptions::default();
        (options.confine, options.memory) = (self.confine.clone(), self.memory);
        options
    }
}
