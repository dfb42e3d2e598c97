//! The progress line on the terminal.

use std::io::Write;
use std::sync::Arc;

use indicatif::{ProgressBar, ProgressStyle};
use sheetsplat::internals::plain;
use sheetsplat::scene::OpenVolume;

/// The line of steps: the bar, the number of steps done, the chunks read, and the time left if the others take equally long.
const STEPS: &str = "[{bar:30}] {pos} of {len}{msg}, {eta_precise} left";

/// The line of chunks alone.
const CHUNKS: &str = "[{bar:30}] {pos} of {len} chunks read";

/// A line that every step rewrites and that disappears at the end; nothing if standard error is not a terminal.
pub(crate) struct Progress {
    bar: ProgressBar,
    counts_chunks: bool,
}

impl Progress {
    /// The line of a number of steps.
    pub(crate) fn new(total: usize, is_wanted: bool) -> Self {
        Self { bar: bar(STEPS, total as u64, is_wanted), counts_chunks: false }
    }

    /// A line that tells only of the chunks that are read of a volume.
    pub(crate) fn of_chunks(is_wanted: bool) -> Self {
        Self { bar: bar(CHUNKS, 0, is_wanted), counts_chunks: true }
    }

    /// One more step is done.
    pub(crate) fn step(&self) {
        self.bar.inc(1);
    }

    /// The volume; if it is streamed, the line tells how many of its chunks have been read.
    pub(crate) fn watch(&self, volume: OpenVolume) -> OpenVolume {
        let OpenVolume::Streamed(volume) = volume else { return volume };
        let (bar, counts_chunks) = (self.bar.clone(), self.counts_chunks);
        let tell = move |read: u64, total: u64| {
            if counts_chunks {
                bar.set_length(total);
                bar.set_position(read);
            } else {
                bar.set_message(format!(", {read} of {total} chunks read"));
            }
        };
        volume.watched_by(Arc::new(tell)).into()
    }
}

/// Tells what a run does not do, on a line that stays, unless it is to be quiet.
pub(crate) fn tell(is_wanted: bool, text: &str) {
    if is_wanted {
        // A closed terminal does not end the program.
        _ = writeln!(std::io::stderr(), "{}", plain(text));
    } else {
        log::info!("{text}");
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn bar(template: &str, total: u64, is_wanted: bool) -> ProgressBar {
    let bar = if is_wanted { ProgressBar::new(total) } else { ProgressBar::hidden() };
    bar.with_style(style(template))
}

/// A template is wrong only by a mistake in this file, which the test finds.
fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("#.")
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use indicatif::{ProgressDrawTarget, TermLike};

    use super::*;

    #[test]
    fn templates_are_valid() {
        for template in [STEPS, CHUNKS] {
            ProgressStyle::with_template(template).unwrap();
        }
    }

    /// A terminal that keeps what was last written to it.
    #[derive(Clone, Debug, Default)]
    struct Terminal(Arc<std::sync::Mutex<String>>);

    impl TermLike for Terminal {
        fn width(&self) -> u16 {
            120
        }
        fn move_cursor_up(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn move_cursor_down(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn move_cursor_right(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn move_cursor_left(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn write_line(&self, text: &str) -> std::io::Result<()> {
            self.write_str(text)
        }
        fn write_str(&self, text: &str) -> std::io::Result<()> {
            self.0.lock().unwrap().push_str(text);
            Ok(())
        }
        fn clear_line(&self) -> std::io::Result<()> {
            self.0.lock().unwrap().clear();
            Ok(())
        }
        fn flush(&self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_tell_steps_and_chunks() {
        let terminal = Terminal::default();
        let shown = |template, total: u64, act: &dyn Fn(&ProgressBar)| {
            let target = ProgressDrawTarget::term_like(Box::new(terminal.clone()));
            let bar = ProgressBar::with_draw_target(Some(total), target).with_style(style(template));
            act(&bar);
            bar.force_draw();
            let line = terminal.0.lock().unwrap().clone();
            bar.finish_and_clear();
            line
        };
        let half = format!("[{}{}]", "#".repeat(15), ".".repeat(15));
        let chunks = shown(CHUNKS, 256, &|bar| bar.set_position(128));
        assert!(chunks.contains(&format!("{half} 128 of 256 chunks read")), "{chunks:?}");
        let steps = shown(STEPS, 8, &|bar| {
            bar.set_position(4);
            bar.set_message(", 3 of 9 chunks read");
        });
        assert!(steps.contains(&format!("{half} 4 of 8, 3 of 9 chunks read, 00:00:")), "{steps:?}");
        assert!(steps.trim_end().ends_with(" left"), "{steps:?}");
    }
}
