//! A screen in the terminal, drawn while rows arrive.

use std::io;
use std::time::{Duration, Instant};

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::{DefaultTerminal, Frame};

use crate::error::CliError;
use crate::port::{Feed, Taker};

/// Longest wait for a key.
const KEY_WAIT: Duration = Duration::from_millis(10);
/// Time between two drawings.
const FRAME: Duration = Duration::from_millis(50);

/// Consumer of rows that is drawn.
pub trait Screen: Taker {
    /// Returns true if nothing is left to be shown; `feed_is_over` is true if no row will come.
    ///
    /// # Errors
    /// If the terminal cannot be used.
    fn is_done(&mut self, feed_is_over: bool) -> Result<bool, CliError>;

    /// Draws everything; `status` is the state of the port.
    fn draw(&self, frame: &mut Frame, status: &str);

    /// Handles a key, except for those that leave.
    ///
    /// # Errors
    /// If the consumer cannot continue.
    fn key(&mut self, code: KeyCode) -> Result<(), CliError>;
}

/// Shows a screen until it is done, or the user leaves.
///
/// # Errors
/// If the terminal cannot be used; those of the screen.
pub fn show<S: Screen>(feed: &mut Feed<S::Row>, screen: &mut S) -> Result<(), CliError> {
    let mut terminal = ratatui::try_init().map_err(failed)?;
    let shown = show_in(&mut terminal, feed, screen);
    ratatui::restore();
    shown
}

/// Returns the error of a terminal.
pub fn failed(error: io::Error) -> CliError {
    CliError::Other(format!("cannot use the terminal: {error}"))
}

fn show_in<S: Screen>(terminal: &mut DefaultTerminal, feed: &mut Feed<S::Row>, screen: &mut S) -> Result<(), CliError> {
    let mut drawn: Option<Instant> = None;
    loop {
        feed.take_rows(screen)?;
        if screen.is_done(feed.has_ended && feed.is_empty())? {
            return Ok(());
        }
        if drawn.is_none_or(|drawn| drawn.elapsed() >= FRAME) {
            terminal.draw(|frame| screen.draw(frame, &feed.status)).map_err(failed)?;
            drawn = Some(Instant::now());
        }
        if !event::poll(KEY_WAIT).map_err(failed)? {
            continue;
        }
        match event::read().map_err(failed)? {
            Event::Key(key) if key.kind == KeyEventKind::Release => {}
            Event::Key(key) => match key.code {
                KeyCode::Char('q') | KeyCode::Esc => return Ok(()),
                KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Ok(()),
                code => screen.key(code)?,
            },
            _ => drawn = None,
        }
    }
}
