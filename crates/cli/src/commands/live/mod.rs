//! Strain in the terminal while readings arrive.
//!
//! A thread reads lines; this one filters them and draws. No line stops the view: invalid lines are counted, and a lost port is
//! waited for. Only a stream from another sensor, or the key q, ends the view.

mod hand_session;
mod hand_view;
mod pulse;
mod recorder;
mod session;
mod view;

use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use ohmstrain_bench_data::counted;
use ratatui::crossterm::event::{self, Event as Input, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::{DefaultTerminal, Frame};

use crate::args::LiveArgs;
use crate::commands::hand::description;
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::refuse_stdout;
use crate::port::{Feed, Taker};
use crate::sensor_file;
use hand_session::HandSession;
use pulse::Counts;
use session::Session;

/// Longest wait for a key.
const KEY_WAIT: Duration = Duration::from_millis(10);
/// Time between two drawings.
const FRAME: Duration = Duration::from_millis(50);

/// A stream that is shown.
trait Shown: Taker {
    /// Takes the sensors as rested now.
    fn zero(&mut self) -> Result<(), CliError>;

    /// Starts or stops recording.
    fn toggle_record(&mut self);

    /// Puts a mark on the next row.
    fn mark(&mut self);

    /// Draws the view; `status` is the state of the port.
    fn draw(&self, frame: &mut Frame, status: &str);

    /// Returns the counts of rows.
    fn counts(&self) -> Counts;

    /// Returns the last message if a recording is being written.
    fn recording(&mut self) -> Option<String>;
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
    let kind = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    let sensor = sensor_file::read(&args.estimate.sensor, kind)?;
    watch(&mut Session::new(args, sensor)?, args, messages)
}

fn watch<S: Shown>(session: &mut S, args: &LiveArgs, messages: &Messages) -> Result<(), CliError> {
    let mut feed = Feed::open(&args.port)?;
    let mut terminal =
        ratatui::try_init().map_err(|error| CliError::Other(format!("cannot use the terminal: {error}")))?;
    let shown = show(&mut feed, &mut terminal, session);
    ratatui::restore();
    session.recording().iter().for_each(|message| messages.remark(message));
    let counts = session.counts();
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

fn show<S: Shown>(feed: &mut Feed<S::Row>, terminal: &mut DefaultTerminal, session: &mut S) -> Result<(), CliError> {
    let failed = |error: io::Error| CliError::Other(format!("cannot use the terminal: {error}"));
    let mut drawn: Option<Instant> = None;
    loop {
        feed.take_rows(session)?;
        if drawn.is_none_or(|drawn| drawn.elapsed() >= FRAME) {
            terminal.draw(|frame| session.draw(frame, &feed.status)).map_err(failed)?;
            drawn = Some(Instant::now());
        }
        if event::poll(KEY_WAIT).map_err(failed)? {
            match event::read().map_err(failed)? {
                Input::Key(key) if key.kind == KeyEventKind::Release => {}
                Input::Key(key) => match key.code {
                    KeyCode::Char('q') | KeyCode::Esc => return Ok(()),
                    KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Ok(()),
                    KeyCode::Char('z') => session.zero()?,
                    KeyCode::Char('r') => session.toggle_record(),
                    KeyCode::Char('m') => session.mark(),
                    _ => {}
                },
                Input::Resize(..) => drawn = None,
                _ => {}
            }
        }
    }
}
