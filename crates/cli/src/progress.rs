use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use ohmstrain_calib::Stage;

/// A progress bar on stderr; silent unless stderr is a terminal.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar with a heading.
    pub fn new(heading: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{msg:32} {wide_bar} {percent:>3} %") {
            bar.set_style(style);
        }
        bar.set_message(heading);
        Self { bar }
    }

    /// Says what is being done, with nothing to count.
    pub fn doing(&self, what: &'static str) {
        self.bar.set_message(what);
    }

    /// Shows where a calibration is.
    pub fn calibrating(&self, stage: Stage) {
        match stage {
            Stage::LeftOut => self.bar.set_message("checking parts left out"),
            Stage::Law => self.bar.set_message("fitting the law"),
            Stage::Noise { done, expected } => {
                if done == 1 {
                    self.bar.set_message("fitting noise and motion");
                }
                self.bar.set_length(expected.max(done));
                self.bar.set_position(done);
            }
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
