//! What happens on Ctrl-C and when the program is told to end: no temporary file stays.

#[cfg(unix)]
pub(crate) use unix::listen;
#[cfg(windows)]
pub(crate) use windows::listen;

/// No other system has both temporary files and a way to interrupt the program.
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

    /// Starts to listen for signals that end the program; it ends by the signal itself, as its caller expects.
    pub(crate) fn listen() {
        let ignored = ignored();
        let signals = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| ignored >> (signal - 1) & 1 == 0);
        // Where there is no listening, the program ends as any other does.
        let Ok(mut signals) = Signals::new(signals) else { return };
        thread::spawn(move || {
            for signal in signals.forever() {
                let _locked = remove_temporary();
                let _ = emulate_default_handler(signal);
            }
        });
    }

    /// A bit for each signal that the caller had the program ignore, as `nohup` does, where the system tells it.
    fn ignored() -> u64 {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
    }
}

#[cfg(windows)]
mod windows {
    use sheetsplat::image::output::remove_temporary;

    /// `STATUS_CONTROL_C_EXIT`, with which Windows ends a program that handles no console events.
    const INTERRUPTED: i32 = 0xC000_013A_u32.cast_signed();

    /// Starts to listen for Ctrl-C and Ctrl-Break.
    pub(crate) fn listen() {
        // Where there is no listening, the program ends as any other does.
        let _ = ctrlc::set_handler(|| {
            let _locked = remove_temporary();
            std::process::exit(INTERRUPTED);
        });
    }
}
