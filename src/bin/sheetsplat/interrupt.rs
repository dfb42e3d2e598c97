//! Removal of temporary files when the program is interrupted or terminated.

#[cfg(unix)]
pub(crate) use unix::listen;
#[cfg(windows)]
pub(crate) use windows::listen;

/// Other systems have no temporary files, or no way to interrupt the program.
#[cfg(not(any(unix, windows)))]
pub(crate) fn listen() {}

#[cfg(unix)]
mod unix {
    use std::fs;
    use std::thread;

    use sheetsplat::image::output::remove_temporary;
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    /// Starts to listen for signals that end the program, which then ends by the same signal, as its caller expects.
    pub(crate) fn listen() {
        let ignored = ignored();
        let signals = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| ignored >> (signal - 1) & 1 == 0);
        // Without a listener, signals end the program directly.
        let Ok(mut signals) = Signals::new(signals) else { return };
        thread::spawn(move || {
            for signal in signals.forever() {
                let _locked = remove_temporary();
                let _ = emulate_default_handler(signal);
            }
        });
    }

    /// A bit for each signal that the caller made the program ignore, as `nohup` does, if the system reports it.
    fn ignored() -> u64 {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
    }
}

#[cfg(windows)]
mod windows {
    use sheetsplat::image::output::remove_temporary;

    /// `STATUS_CONTROL_C_EXIT`, the exit code of a program that does not handle console events on Windows.
    const INTERRUPTED: i32 = 0xC000_013A_u32.cast_signed();

    /// Starts to listen for Ctrl-C and Ctrl-Break.
    pub(crate) fn listen() {
        // Without a listener, the events end the program directly.
        let _ = ctrlc::set_handler(|| {
            let _locked = remove_temporary();
            std::process::exit(INTERRUPTED);
        });
    }
}
