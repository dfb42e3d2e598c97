//! The progress line on the terminal.

use std::io::{IsTerminal, Write, stderr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sheetsplat::scene::OpenVolume;

/// The width of the bar in characters.
const BAR: usize = 30;

/// The least time between two lines of chunks.
const LEAST: Duration = Duration::from_millis(50);

/// A line that every step rewrites and that disappears at the end; nothing if standard error is not a terminal.
pub(crate) struct Progress {
    state: Arc<Mutex<State>>,
    is_shown: bool,
}

struct State {
    /// The number of steps; 0 if only chunks are shown.
    total: usize,
    done: usize,
    start: Instant,
    /// When chunks were last shown.
    shown: Option<Instant>,
}

impl Progress {
    /// The line of a number of steps.
    pub(crate) fn new(total: usize, is_wanted: bool) -> Self {
        let state = State { total, done: 0, start: Instant::now(), shown: None };
        let is_shown = is_wanted && stderr().is_terminal();
        let progress = Self { state: Arc::new(Mutex::new(state)), is_shown };
        if is_shown && total > 0 {
            locked(&progress.state).show(None);
        }
        progress
    }

    /// A line that tells only of the chunks that are read of a volume.
    pub(crate) fn of_chunks(is_wanted: bool) -> Self {
        Self::new(0, is_wanted)
    }

    /// One more step is done.
    pub(crate) fn step(&self) {
        let mut state = locked(&self.state);
        state.done += 1;
        if self.is_shown {
            state.show(None);
        }
    }

    /// The volume; if it is streamed, the line tells how many of its chunks have been read.
    pub(crate) fn watch(&self, volume: OpenVolume) -> OpenVolume {
        match volume {
            OpenVolume::Streamed(volume) if self.is_shown => {
                let state = Arc::clone(&self.state);
                let tell = move |read: u64, total: u64| {
                    let mut state = locked(&state);
                    if state.shown.is_none_or(|shown| shown.elapsed() >= LEAST) {
                        state.shown = Some(Instant::now());
                        state.show(Some([read, total]));
                    }
                };
                volume.watched_by(Arc::new(tell)).into()
            }
            volume => volume,
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

fn locked(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl State {
    fn show(&self, chunks: Option<[u64; 2]>) {
        // A closed terminal does not end the program.
        let _ = write!(stderr(), "\r\x1b[K{}", self.line(chunks));
    }

    /// The bar of steps, with the chunks that have been read of all; their bar alone where there are no steps.
    fn line(&self, chunks: Option<[u64; 2]>) -> String {
        let of_chunks = chunks.map(|[read, total]| format!("{read} of {total} chunks read"));
        match (self.total, chunks, of_chunks) {
            (0, Some([read, total]), Some(text)) => format!("[{}] {text}", bar(read as usize, total as usize)),
            (total, _, Some(text)) => format!("{}, {text}", line(self.done, total, self.start.elapsed())),
            (total, ..) => line(self.done, total, self.start.elapsed()),
        }
    }
}

/// A bar of what is done of all.
fn bar(done: usize, total: usize) -> String {
    let filled = BAR * done.min(total) / total.max(1);
    format!("{}{}", "#".repeat(filled), ".".repeat(BAR - filled))
}

/// The bar, the number of steps done, and the time left if the others take equally long.
fn line(done: usize, total: usize, elapsed: Duration) -> String {
    let bar = format!("[{}] {done} of {total}", bar(done, total));
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
    fn chunks_are_told_alone_and_beside_steps() {
        let state = |total| State { total, done: 0, start: Instant::now(), shown: None };
        assert_eq!(
            state(0).line(Some([128, 256])),
            format!("[{}{}] 128 of 256 chunks read", "#".repeat(15), ".".repeat(15))
        );
        assert_eq!(state(8).line(Some([3, 9])), format!("[{}] 0 of 8, 3 of 9 chunks read", ".".repeat(30)));
        assert_eq!(state(8).line(None), format!("[{}] 0 of 8", ".".repeat(30)));
    }

    #[test]
    fn the_rest_takes_as_long_as_what_is_done() {
        assert_eq!(line(0, 8, Duration::from_secs(2)), format!("[{}] 0 of 8", ".".repeat(30)));
        let half = format!("[{}{}] 4 of 8", "#".repeat(15), ".".repeat(15));
        assert_eq!(line(4, 8, Duration::from_secs(65)), format!("{half}, 1:05 left"));
        assert_eq!(line(4, 8, Duration::from_secs(3721)), format!("{half}, 1:02:01 left"));
        assert_eq!(line(8, 8, Duration::from_secs(9)), format!("[{}] 8 of 8, 0:00 left", "#".repeat(30)));
    }
}
