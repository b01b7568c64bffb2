use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use ohmstrain_calib::Stage;

use crate::messages::Messages;

/// A progress bar on stderr; silent unless stderr is a terminal.
pub struct Progress<'a> {
    messages: &'a Messages,
    bar: ProgressBar,
    start: Instant,
}

impl<'a> Progress<'a> {
    /// Creates a bar with a heading.
    pub fn new(heading: &'static str, messages: &'a Messages) -> Self {
        let shown = messages.shows_progress();
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(1), target);
        if let Ok(style) = ProgressStyle::with_template("{msg:32} {wide_bar} {percent:>3} %") {
            bar.set_style(style);
        }
        bar.set_message(heading);
        let progress = Self { messages, bar, start: Instant::now() };
        progress.detail(heading);
        progress
    }

    /// Creates a bar over this many bytes of recordings, with the remaining time.
    pub fn over_bytes(heading: &'static str, bytes: u64, messages: &'a Messages) -> Self {
        let progress = Self::new(heading, messages);
        if let Ok(style) = ProgressStyle::with_template("{msg:32} {wide_bar} {percent:>3} %, {eta} left") {
            progress.bar.set_style(style);
        }
        progress.bar.set_length(bytes);
        progress
    }

    /// Advances the bar.
    pub fn advance(&self, bytes: u64, message: String) {
        self.detail(&message);
        self.bar.set_message(message);
        self.bar.inc(bytes);
    }

    /// Returns the destination of messages.
    pub const fn messages(&self) -> &Messages {
        self.messages
    }

    /// Prints with the bar hidden.
    pub fn around<T>(&self, print: impl FnOnce() -> T) -> T {
        self.bar.suspend(print)
    }

    /// Shows the present step of work that cannot be counted.
    pub fn doing(&self, what: &'static str) {
        self.bar.set_message(what);
        self.detail(what);
    }

    fn detail(&self, what: &str) {
        self.messages.detail(&format!("{:.1} s: {what}", self.start.elapsed().as_secs_f64()));
    }

    /// Shows the stage of a calibration.
    pub fn calibrating(&self, stage: Stage) {
        match stage {
            Stage::LeftOut => self.doing("checking parts left out"),
            Stage::Law => self.doing("fitting the law"),
            Stage::Noise { done, expected } => {
                if done == 1 {
                    self.doing("fitting noise and motion");
                }
                self.bar.set_length(expected.max(done));
                self.bar.set_position(done);
            }
        }
    }
}

impl Drop for Progress<'_> {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
