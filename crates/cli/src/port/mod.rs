//! Lines of a port as they arrive: a serial port, a pipe, the network, or a recording that is played back.

mod network;
mod source;

use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};

use crate::args::PortArgs;
use crate::error::CliError;

pub use source::{Event, Source};

/// Longest time for which rows are taken in one go.
const TAKEN_FOR: Duration = Duration::from_millis(20);

/// A row with the time at which it is due.
pub struct Due<T> {
    pub row: T,
    pub time_s: f64,
    /// True if the clock has restarted.
    pub restarted: bool,
}

/// Consumer of a port's lines.
pub trait Taker {
    /// A parsed row.
    type Row;

    /// Parses a line that has arrived at `arrived_s` on the feed's clock; `None` if it is not a row.
    ///
    /// # Errors
    /// If the stream is unusable.
    fn parse(&mut self, line: &[u8], arrived_s: f64) -> Result<Option<Due<Self::Row>>, CliError>;

    /// Takes a row that is due.
    ///
    /// # Errors
    /// If the consumer cannot continue.
    fn take(&mut self, due: Due<Self::Row>) -> Result<(), CliError>;
}

/// Rows of a port; those of a recording at the pace at which it was recorded.
pub struct Feed<T> {
    opened: Instant,
    /// Name in messages.
    name: String,
    source: Source,
    pace: Option<Pace>,
    /// A row that is not due yet.
    held: Option<Due<T>>,
    /// State of the port in words.
    pub status: String,
    /// True if nothing more will arrive.
    pub has_ended: bool,
}

impl<T> Feed<T> {
    /// Opens the port that the flags name.
    ///
    /// # Errors
    /// If a recording cannot be read, or nothing can be received at an address.
    pub fn open(args: &PortArgs) -> Result<Self, CliError> {
        let opened = Instant::now();
        let source = match (&args.udp, &args.tcp) {
            (Some(address), _) => Source::listening(|send| network::listen_udp(address, send))?,
            (None, Some(address)) => Source::listening(|send| network::read_tcp(address, send))?,
            (None, None) => Source::open(args.port.as_deref().unwrap_or(Path::new("-")), args.baud)?,
        };
        let pace = source.is_recording.then_some(Pace { speed: args.speed, started: None });
        Ok(Self { opened, name: args.source(), source, pace, held: None, status: "waiting".into(), has_ended: false })
    }

    /// Passes on the rows that have arrived and are due, for a short while.
    ///
    /// # Errors
    /// Those of the taker.
    pub fn take_rows(&mut self, taker: &mut impl Taker<Row = T>) -> Result<(), CliError> {
        let start = Instant::now();
        while start.elapsed() < TAKEN_FOR {
            if let Some(due) = self.held.take() {
                if self.pace.as_mut().is_some_and(|pace| !pace.is_due(due.time_s, due.restarted)) {
                    self.held = Some(due);
                    return Ok(());
                }
                taker.take(due)?;
            }
            match self.source.events.try_recv() {
                Ok(event) => self.handle(event, taker)?,
                Err(TryRecvError::Empty) => return Ok(()),
                Err(TryRecvError::Disconnected) => {
                    self.has_ended = true;
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// True if no row is pending.
    pub const fn is_empty(&self) -> bool {
        self.held.is_none()
    }

    /// Waits for a line, at most `longest`.
    ///
    /// # Errors
    /// Those of the taker.
    pub fn wait(&mut self, longest: Duration, taker: &mut impl Taker<Row = T>) -> Result<(), CliError> {
        if self.held.is_some() {
            std::thread::sleep(longest.min(TAKEN_FOR));
            return Ok(());
        }
        match self.source.events.recv_timeout(longest) {
            Ok(event) => self.handle(event, taker),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => {
                self.has_ended = true;
                Ok(())
            }
        }
    }

    fn handle(&mut self, event: Event, taker: &mut impl Taker<Row = T>) -> Result<(), CliError> {
        match event {
            Event::Line(line, arrived) => {
                self.held = taker.parse(&line, arrived.duration_since(self.opened).as_secs_f64())?;
            }
            Event::Connected => self.status = "connected".into(),
            Event::Away(why) => self.status = format!("waiting for the port: {why}"),
            Event::Failed(error) => {
                return Err(CliError::Other(format!("cannot read {}: {error}", self.name)));
            }
            Event::Ended => {
                self.status = "the readings have ended".into();
                self.has_ended = true;
            }
        }
        Ok(())
    }
}

/// Clock that holds a recording back to the pace at which it was recorded.
struct Pace {
    speed: f64,
    /// Due time of the first row, and its own time, s.
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
