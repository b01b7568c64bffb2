//! Strain in the terminal while readings arrive.
//!
//! A thread reads lines; this one filters them and draws. No line stops the view: invalid lines are counted, and a lost port is
//! waited for. Only a stream from another sensor, or the key q, ends the view.

mod hand_session;
mod hand_view;
mod pulse;
mod recorder;
mod session;
mod track;
mod view;

use std::io::{self, IsTerminal};

use ohmstrain_bench_data::counted;
use ratatui::Frame;
use ratatui::crossterm::event::KeyCode;

use crate::args::LiveArgs;
use crate::commands::hand::description;
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::refuse_stdout;
use crate::port::{Feed, Taker};
use crate::screen::{self, Screen};
use crate::sensor_file;
use hand_session::HandSession;
use recorder::Recorder;
use session::Session;
use track::{Timed, Track};

/// A stream that is shown.
trait Shown: Taker {
    /// A row of the plot.
    type Point: Timed;

    /// Returns the rows so far.
    fn track(&mut self) -> &mut Track<Self::Point>;

    /// Begins a recording.
    ///
    /// # Errors
    /// If no file can be created.
    fn new_recorder(&self) -> io::Result<Recorder>;

    /// Takes the sensors as rested now.
    fn zero(&mut self) -> Result<(), CliError>;

    /// Starts or stops recording.
    fn toggle_record(&mut self) {
        let has_rows = self.track().pulse.counts.rows > 0;
        let recorder = self.track().recorder.take();
        let (recorder, message) = recorder::toggled(recorder, has_rows, || self.new_recorder());
        let track = self.track();
        (track.recorder, track.message) = (recorder, message);
    }

    /// Returns the last message if a recording is being written.
    fn recording(&mut self) -> Option<String> {
        self.track().recorder.is_some().then(|| {
            self.toggle_record();
            self.track().message.clone()
        })
    }

    /// Begins other rows, and another recording if there is one, after the clock has restarted.
    fn restarted(&mut self, message: &str) {
        self.track().clear(message);
        if self.track().recorder.is_some() {
            self.toggle_record();
            self.toggle_record();
        }
    }
}

/// The view of a stream.
trait Pictured {
    /// Draws everything; `status` is the state of the port.
    fn picture(&self, frame: &mut Frame, status: &str);
}

impl<S: Shown + Pictured> Screen for S {
    fn is_done(&mut self, _: bool) -> Result<bool, CliError> {
        Ok(false)
    }

    fn draw(&self, frame: &mut Frame, status: &str) {
        self.picture(frame, status);
    }

    fn key(&mut self, code: KeyCode) -> Result<(), CliError> {
        match code {
            KeyCode::Char('z') => self.zero()?,
            KeyCode::Char('r') => self.toggle_record(),
            KeyCode::Char('m') => self.track().mark(),
            _ => {}
        }
        Ok(())
    }
}

/// Shows strain until the user quits.
pub fn run(args: &LiveArgs, messages: &Messages) -> Result<(), CliError> {
    if !io::stdout().is_terminal() {
        return Err(CliError::Arguments(
            "live draws on a terminal; for rows of numbers use `ohmstrain filter`, with --skip-bad on a serial line"
                .into(),
        ));
    }
    refuse_stdout(&args.record)?;
    if sensor_file::is_of_a_hand(&args.estimate.sensor) {
        let description = description::read(&args.estimate.sensor)?;
        return watch(&mut HandSession::new(args, &description)?, args, messages);
    }
    let kind = args.estimate.estimator.chosen();
    let sensor = sensor_file::read(&args.estimate.sensor, kind)?;
    watch(&mut Session::new(args, sensor)?, args, messages)
}

fn watch<S: Shown + Pictured>(session: &mut S, args: &LiveArgs, messages: &Messages) -> Result<(), CliError> {
    let mut feed = Feed::open(&args.port)?;
    let shown = screen::show(&mut feed, session);
    session.recording().iter().for_each(|message| messages.remark(message));
    let counts = session.track().pulse.counts;
    messages.remark(&format!(
        "{}, {} missing, {}, {} skipped, {} of the clock",
        counted(counts.rows, "row"),
        counted(counts.missing, "reading"),
        counted(counts.gaps, "gap"),
        counted(counts.bad_lines, "line"),
        counted(counts.restarts, "restart")
    ));
    shown
}
