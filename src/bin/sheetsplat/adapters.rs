//! `sheetsplat adapters`.

use std::fmt::Write;

use sheetsplat::DeviceRequirements;
use sheetsplat::headless::device;

use crate::failure::Failure;
use crate::stdout::stdout;

#[derive(clap::Args)]
#[command(after_help = "Examples:\n  sheetsplat adapters\n  sheetsplat adapters --adapter llvmpipe")]
pub(crate) struct Arguments {
    /// Part of an adapter's name: mark the adapter that it selects.
    #[arg(long, value_name = "NAME", env = "WGPU_ADAPTER_NAME")]
    adapter: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let adapters = device::adapters();
    let chosen = device::choose_adapter(&adapters, arguments.adapter.as_deref());
    let mut report = String::new();
    for adapter in &adapters {
        let info = adapter.get_info();
        let missing = DeviceRequirements::insufficient(&DeviceRequirements::for_adapter(adapter).limits);
        let usable = match missing.as_slice() {
            [] => "yes".to_owned(),
            missing => {
                let missing: Vec<String> = missing.iter().map(ToString::to_string).collect();
                format!("no: {}", missing.join("; "))
            }
        };
        let rows = [
            ("driver", device::driver_name(&info)),
            ("type", format!("{:?}", info.device_type)),
            ("backend", info.backend.to_str().to_owned()),
            ("usable", usable),
            ("chosen", if chosen.as_ref().is_ok_and(|chosen| chosen == adapter) { "yes" } else { "no" }.to_owned()),
        ];
        // Writing to a string cannot fail.
        let _ = writeln!(report, "{}", info.name);
        for (key, value) in rows {
            let _ = writeln!(report, "  {key:8} {value}");
        }
    }
    stdout(report.as_bytes())?;
    chosen.map(|_| ()).map_err(|error| Failure::Other(error.to_string()))
}
