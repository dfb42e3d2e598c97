//! Machines without a desktop session.

use std::env;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

/// Switches off the layer of Mesa that asks the desktop which GPU comes first.
const LAYER_OFF: &str = "NODEVICE_SELECT";

/// Starts the program again without that layer if there is no desktop session: it would print an error each time that adapters are listed. A process
/// that may have threads cannot change its own environment.
pub(crate) fn leave_out_if_missing() {
    let session = env::var_os("XDG_RUNTIME_DIR").is_some_and(|folder| Path::new(&folder).is_absolute());
    if session || env::var_os(LAYER_OFF).is_some() {
        return;
    }
    let mut arguments = env::args_os();
    if let (Ok(program), Some(name)) = (env::current_exe(), arguments.next()) {
        // It returns only if it fails. The error is printed then, as by any other program.
        let _ = Command::new(program).arg0(name).args(arguments).env(LAYER_OFF, "1").exec();
    }
}
