//! Strain in the terminal while readings arrive.
//!
//! A thread reads lines; this one filters them and draws. No line stops the view: what is none of a trace is counted, a
//! port that goes away is waited for. Only a stream that is not of this sensor ends it, and the key q.

mod network;
mod recorder;
mod session;
mod source;
mod view;

use std::io::{self, IsTerminal};
use std::path::Path;
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

use ohmstrain_bench_data::{Row, counted};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event as Input, KeyCode, KeyEventKind, KeyModifiers};

use crate::args::LiveArgs;
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::refuse_stdout;
use crate::sensor_file;
use session::Session;
pub use source::{Event, Source};

/// Time for which rows are taken before anything else is done.
const TAKEN_FOR: Duration = Duration::from_millis(20);
/// Time for which a key is waited for.
const KEY_WAIT: Duration = Duration::from_millis(10);
/// Time between two drawings.
const FRAME: Duration = Duration::from_millis(50);

/// Shows strain until the user has seen enough.
pub fn run(args: &LiveArgs, messages: &Messages) -> Result<(), CliError> {
    if !io::stdout().is_terminal() {
        return Err(CliError::Arguments(
            "live draws on a terminal; for rows of numbers use `ohmstrain filter`, with --skip-bad on a serial line"
                .into(),
        ));
    }
    refuse_stdout(&args.record)?;
    let kind = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    let sensor = sensor_file::read(&args.estimate.sensor, kind)?;
    let mut session = Session::new(args, sensor)?;
    let source = match (&args.udp, &args.tcp) {
        (Some(address), _) => Source::listening(|send| network::listen_udp(address, send))?,
        (None, Some(address)) => Source::listening(|send| network::read_tcp(address, send))?,
        (None, None) => Source::open(args.port.as_deref().unwrap_or(Path::new("-")), args.baud)?,
    };
    let pace = source.is_recording.then_some(Pace { speed: args.speed, started: None });
    let mut live = Live { source, pace, held: None, status: "waiting".into() };
    let mut terminal =
        ratatui::try_init().map_err(|error| CliError::Other(format!("cannot use the terminal: {error}")))?;
    let shown = live.show(&mut terminal, &mut session, args);
    ratatui::restore();
    if session.recorder.is_some() {
        session.toggle_record();
        messages.remark(&session.message);
    }
    let counts = session.counts;
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

/// Holds a recording back to the pace at which it was recorded.
struct Pace {
    speed: f64,
    /// Due time of the first row, and its own time.
    started: Option<(Instant, f64)>,
}

impl Pace {
    fn is_due(&mut self, time_s: f64, restarted: bool) -> bool {
        if restarted {
            self.started = None;
        }
        let (start, first_s) = *self.started.get_or_insert((Instant::now(), time_s));
        start.elapsed().as_secs_f64() * self.speed >= time_s - first_s
    }
}

struct Live {
    source: Source,
    pace: Option<Pace>,
    /// A row that is not due yet, and whether its clock has started again.
    held: Option<(Row, bool)>,
    status: String,
}

impl Live {
    fn show(&mut self, terminal: &mut DefaultTerminal, session: &mut Session, args: &LiveArgs) -> Result<(), CliError> {
        let failed = |error: io::Error| CliError::Other(format!("cannot use the terminal: {error}"));
        let mut drawn: Option<Instant> = None;
        loop {
            self.take_rows(session)?;
            if drawn.is_none_or(|drawn| drawn.elapsed() >= FRAME) {
                terminal.draw(|frame| view::draw(frame, session, &self.status, args)).map_err(failed)?;
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

    /// Takes the rows that have come and are due, for a short while.
    fn take_rows(&mut self, session: &mut Session) -> Result<(), CliError> {
        let start = Instant::now();
        while start.elapsed() < TAKEN_FOR {
            if let Some((row, restarted)) = self.held.take() {
                if self.pace.as_mut().is_some_and(|pace| !pace.is_due(row.time_s, restarted)) {
                    self.held = Some((row, restarted));
                    return Ok(());
                }
                session.take(&row, restarted)?;
            }
            match self.source.events.try_recv() {
                Ok(Event::Line(line, arrived)) => self.held = session.parse(&line, arrived)?,
                Ok(Event::Connected) => self.status = "connected".into(),
                Ok(Event::Away(why)) => self.status = format!("waiting for the port: {why}"),
                Ok(Event::Ended) => self.status = "the readings have ended".into(),
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return Ok(()),
            }
        }
        Ok(())
    }
}
