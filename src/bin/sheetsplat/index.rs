//! `sheetsplat index`.

use std::path::PathBuf;

use sheetsplat::volume::{StoreIndex, StoreLevel};

use crate::arguments::Input;
use crate::failure::Failure;
use crate::outputs::{self, Outputs};
use crate::progress::Progress;

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sheetsplat index brain.ome.zarr -o brain.index
  sheetsplat render brain.ome.zarr -o brain.png --memory 2GiB --index brain.index")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// The index.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Writes the range of the values in every chunk.
pub(crate) fn run(arguments: &Arguments, progress: bool) -> Result<(), Failure> {
    let Arguments { input, output } = arguments;
    if input.index.is_some() {
        return Err(Failure::Input(
            "--index: found an index for the store, allowed: --output, the index to write".to_owned(),
        ));
    }
    let scene = input.scene()?;
    let outputs = Outputs::check(&[("--output", output)], false, &input.files(&scene))?;
    let store = scene.open_store(&input.options().with_outputs(outputs.written())).ok_or_else(|| {
        let allowed = "one file without labels";
        Failure::Input(format!("{}: found a volume that is not read by boxes, allowed: {allowed}", input.name))
    })?;
    let store = store.map_err(|error| input.failure(error))?;
    let chunks =
        |level: &StoreLevel| level.chunks().to_array().iter().fold(1, |count: u64, &n| count.saturating_mul(n.into()));
    let total = store.levels().iter().map(chunks).fold(0, u64::saturating_add);
    let bar = Progress::new(usize::try_from(total).unwrap_or(usize::MAX), progress);
    let step = || bar.step();
    let index = StoreIndex::new(&*store, &input.name, &step).map_err(|error| input.failure(error))?;
    drop(bar);
    outputs::write(&[(output, index.encode().into_bytes())], &[])
}
