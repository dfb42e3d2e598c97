//! The program's log on standard error: what `env_logger` writes, and the library's progress as a line on the terminal.

use std::collections::HashSet;
use std::fmt;
use std::io::{IsTerminal, Write, stderr};
use std::sync::{Mutex, PoisonError};

use log::{Level, LevelFilter, Log, Metadata, Record};
use sheetsplat::internals::after::coefficients::PROGRESS;
use sheetsplat::internals::{plain, plain_lines};

/// The log. Progress that the written log does not show is a line that every step rewrites and that disappears at the end.
struct ProgramLog {
    written: env_logger::Logger,
    is_progress_shown: bool,
    /// The warnings so far: each is written once.
    warnings: Mutex<HashSet<String>>,
}

/// Starts the log. Progress is shown if it is wanted and standard error is a terminal. Without `-v` and RUST_LOG, nobody looks for times and modules.
pub(crate) fn start(filter: &str, is_verbose: bool, is_progress_wanted: bool) {
    let mut builder = env_logger::Builder::from_env(env_logger::Env::default().default_filter_or(filter));
    if !is_verbose && std::env::var_os(env_logger::DEFAULT_FILTER_ENV).is_none() {
        builder.format(|to, record| {
            let level = if record.level() == Level::Error { "error" } else { "warning" };
            writeln!(to, "sheetsplat: {level}: {}", record.args())
        });
    }
    let written = builder.build();
    let is_progress_shown = is_progress_wanted && stderr().is_terminal();
    let level = if is_progress_shown { written.filter().max(LevelFilter::Info) } else { written.filter() };
    // There is no other log.
    if log::set_boxed_logger(Box::new(ProgramLog { written, is_progress_shown, warnings: Mutex::default() })).is_ok() {
        log::set_max_level(level);
    }
}

impl ProgramLog {
    fn is_line(&self, metadata: &Metadata<'_>) -> bool {
        self.is_progress_shown && metadata.target() == PROGRESS && !self.written.enabled(metadata)
    }

    /// Whether a message is a warning that is written already.
    fn is_repeated(&self, level: Level, message: &str) -> bool {
        level == Level::Warn && !self.warnings.lock().unwrap_or_else(PoisonError::into_inner).insert(message.to_owned())
    }
}

impl Log for ProgramLog {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        self.is_line(metadata) || self.written.enabled(metadata)
    }

    fn log(&self, record: &Record<'_>) {
        if self.is_line(record.metadata()) {
            // A closed terminal does not end the program.
            let _ = stderr().lock().write_all(line(&record.args().to_string()).as_bytes());
        } else {
            // Names in files come into warnings.
            let message = record.args().to_string();
            if self.is_repeated(record.level(), &message) {
                return;
            }
            let is_ours = record.target().starts_with("sheetsplat");
            let message = if is_ours { plain(&message) } else { plain_lines(&message) };
            let (level, target, module) = (record.level(), record.target(), record.module_path());
            let written = |args: fmt::Arguments<'_>| {
                self.written.log(&Record::builder().args(args).level(level).target(target).module_path(module).build());
            };
            written(format_args!("{message}"));
        }
    }

    fn flush(&self) {
        self.written.flush();
    }
}

/// What is written to the terminal for a message: it takes the place of the one before, and nothing is left of the last one.
fn line(message: &str) -> String {
    let shown = if message.ends_with(" 100 %") { "" } else { message };
    format!("\r\x1b[K{shown}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(filter: &str) -> ProgramLog {
        let written = env_logger::Builder::new().parse_filters(filter).build();
        ProgramLog { written, is_progress_shown: true, warnings: Mutex::default() }
    }

    fn info(target: &str) -> Metadata<'_> {
        Metadata::builder().level(log::Level::Info).target(target).build()
    }

    #[test]
    fn progress_is_a_line_unless_it_is_written() {
        let quiet = log("error,sheetsplat=warn");
        assert!(quiet.is_line(&info(PROGRESS)) && quiet.enabled(&info(PROGRESS)));
        assert!(!quiet.is_line(&info("sheetsplat::volume")) && !quiet.enabled(&info("sheetsplat::volume")));
        let verbose = log("error,sheetsplat=info");
        assert!(!verbose.is_line(&info(PROGRESS)) && verbose.enabled(&info(PROGRESS)));
    }

    #[test]
    fn a_warning_is_written_once() {
        let log = log("warn");
        assert!(!log.is_repeated(Level::Warn, "a hole") && !log.is_repeated(Level::Warn, "two holes"));
        assert!(log.is_repeated(Level::Warn, "a hole"));
        assert!(!log.is_repeated(Level::Info, "a hole"));
    }

    #[test]
    fn the_line_disappears_at_the_end() {
        assert_eq!(line("coefficients: 30 %"), "\r\x1b[Kcoefficients: 30 %");
        assert_eq!(line("coefficients: 100 %"), "\r\x1b[K");
    }
}
