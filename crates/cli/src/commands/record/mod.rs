//! Recording of a person who follows a protocol: the strain is known where the body is held.
//!
//! The protocol runs on the clock of the readings: it waits while none arrive, and a recording can be played back at any speed.
//! On a terminal the steps are drawn; elsewhere they are printed as lines.

mod columns;
mod pacer;
mod recording;
mod view;
mod writer;

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use ratatui::Frame;
use ratatui::crossterm::event::KeyCode;

use crate::args::RecordArgs;
use crate::error::{CliError, shell_word};
use crate::messages::Messages;
use crate::output::refuse_stdout;
use crate::port::Feed;
use crate::protocol_file;
use crate::screen::{self, Screen};
use columns::StreamRow;
use pacer::Pacer;
use recording::Recording;

/// Longest wait for a line.
const LINE_WAIT: Duration = Duration::from_millis(100);

/// Records until the protocol has been followed, the readings have ended, or the user leaves.
pub fn run(args: &RecordArgs, messages: &Messages) -> Result<(), CliError> {
    refuse_stdout(&args.output)?;
    let pacing = protocol_file::read(&args.protocol)?;
    let is_terminal = io::stdout().is_terminal();
    if pacing.steps.is_empty() && !is_terminal {
        let name = args.protocol.display();
        return Err(CliError::Arguments(format!("{name} has no steps: marks by hand need a terminal")));
    }
    let mut feed = Feed::open(&args.port)?;
    let mut recording = Recording::new(args, Pacer::new(pacing))?;
    if is_terminal {
        screen::show(&mut feed, &mut recording)?;
    } else {
        follow(&mut feed, &mut recording)?;
    }
    close(&recording, args, messages)
}

/// Closes a recording, and prints a summary and the next command.
fn close(recording: &Recording, args: &RecordArgs, messages: &Messages) -> Result<(), CliError> {
    let path = args.output.display();
    messages.remark(&recording.counts.text(recording));
    if recording.counts.rows == 0 {
        return Err(CliError::Input(format!("{}: no reading came; {path} is empty", args.port.source())));
    }
    let left = recording.pacer.left();
    if left > 0 {
        messages.warning(&format!("the protocol was left with {left} steps to be made"));
    }
    if recording.counts.holds.iter().filter(|count| **count > 0).count() < 2 {
        messages.warning("the body was held at fewer than two positions, which no calibration takes");
    } else {
        let word = shell_word(&args.output.display().to_string());
        let made = if recording.has_several_channels() { "hand.toml" } else { "sensor.toml" };
        messages.remark(&format!("next: ohmstrain calibrate {word} -o {made}"));
    }
    Ok(())
}

/// Prints each step when it begins.
fn follow(feed: &mut Feed<StreamRow>, recording: &mut Recording) -> Result<(), CliError> {
    let mut status = String::new();
    loop {
        feed.take_rows(recording)?;
        let mut out = io::stdout().lock();
        if status != feed.status {
            status.clone_from(&feed.status);
            let _ = writeln!(out, "             {status}");
        }
        for (time_s, text) in recording.cues.drain(..) {
            // Recording continues even if nobody reads this output.
            let _ = writeln!(out, "{time_s:9.1} s  {text}");
        }
        let _ = out.flush();
        if recording.pacer.is_done() || (feed.has_ended && feed.is_empty()) {
            return Ok(());
        }
        feed.wait(LINE_WAIT, recording)?;
    }
}

impl Screen for Recording<'_> {
    /// Rings for each step that has begun.
    fn is_done(&mut self, feed_is_over: bool) -> Result<bool, CliError> {
        if self.args.bell && !self.cues.is_empty() {
            io::stdout().write_all(b"\x07").map_err(screen::failed)?;
        }
        self.cues.clear();
        Ok(self.pacer.is_done() || feed_is_over)
    }

    /// Draws the protocol beside the readings.
    fn draw(&self, frame: &mut Frame, status: &str) {
        view::draw(frame, self, status);
    }

    fn key(&mut self, code: KeyCode) -> Result<(), CliError> {
        match code {
            KeyCode::Char(digit @ '1'..='9') => self.mark(digit as usize - '1' as usize)?,
            _ if self.pacer.is_marked() => self.pacer.release(),
            KeyCode::Char('b') => self.repeat("spoiled")?,
            KeyCode::Char(' ') => self.toggle_pause()?,
            _ => {}
        }
        Ok(())
    }
}
