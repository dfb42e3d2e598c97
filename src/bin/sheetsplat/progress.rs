//! The progress line on the terminal.

use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

/// The width of the bar in characters.
const BAR: usize = 30;

/// A line that every step rewrites and that disappears at the end; nothing if standard error is not a terminal.
pub(crate) struct Progress {
    total: usize,
    done: usize,
    start: Instant,
    is_shown: bool,
}

impl Progress {
    pub(crate) fn new(total: usize, is_wanted: bool) -> Self {
        let progress = Self { total, done: 0, start: Instant::now(), is_shown: is_wanted && stderr().is_terminal() };
        progress.show();
        progress
    }

    pub(crate) fn step(&mut self) {
        self.done += 1;
        self.show();
    }

    fn show(&self) {
        if self.is_shown {
            // A closed terminal does not end the program.
            let _ = write!(stderr(), "\r\x1b[K{}", line(self.done, self.total, self.start.elapsed()));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.is_shown {
            let _ = write!(stderr(), "\r\x1b[K");
        }
    }
}

/// The bar, the number of steps done, and the time left if the others take equally long.
fn line(done: usize, total: usize, elapsed: Duration) -> String {
    let filled = BAR * done / total.max(1);
    let bar = format!("[{}{}] {done} of {total}", "#".repeat(filled), ".".repeat(BAR - filled));
    if done == 0 {
        return bar;
    }
    let left = (elapsed.as_secs_f64() / done as f64 * total.saturating_sub(done) as f64).round() as u64;
    match (left / 3600, left / 60 % 60, left % 60) {
        (0, minutes, seconds) => format!("{bar}, {minutes}:{seconds:02} left"),
        (hours, minutes, seconds) => format!("{bar}, {hours}:{minutes:02}:{seconds:02} left"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_takes_as_long_as_what_is_done() {
        assert_eq!(line(0, 8, Duration::from_secs(2)), format!("[{}] 0 of 8", ".".repeat(30)));
        let half = format!("[{}{}] 4 of 8", "#".repeat(15), ".".repeat(15));
        assert_eq!(line(4, 8, Duration::from_secs(65)), format!("{half}, 1:05 left"));
        assert_eq!(line(4, 8, Duration::from_secs(3721)), format!("{half}, 1:02:01 left"));
        assert_eq!(line(8, 8, Duration::from_secs(9)), format!("[{}] 8 of 8, 0:00 left", "#".repeat(30)));
    }
}
