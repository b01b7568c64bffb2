//! Where lines come from: a serial port, a pipe, stdin, or a recording. A thread reads, so that the view never waits.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;
use std::sync::mpsc::{Receiver, SendError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::error::CliError;
use crate::input::is_stdin;

/// Lines that wait at most; then the source waits.
const WAITING: usize = 1 << 12;
/// A line is cut here: nothing that a device sends is that long, and the rest of it is garbage, too.
const LONGEST_LINE: usize = 1 << 13;
/// How long a read of a port waits, and how long a port that is gone is left alone.
const READ_TIMEOUT: Duration = Duration::from_millis(100);
const RETRY: Duration = Duration::from_millis(300);

/// What a source says.
pub enum Event {
    /// A line without its end, and when it arrived.
    Line(Vec<u8>, Instant),
    /// The port is open.
    Connected,
    /// The port is gone, or not there yet; why.
    Away(String),
    /// There is no more.
    Ended,
}

/// A source of lines.
pub struct Source {
    /// What it says.
    pub events: Receiver<Event>,
    /// Whether it is a file, which has to be held back to the pace at which it was recorded.
    pub is_recording: bool,
}

impl Source {
    /// Starts to read.
    ///
    /// # Errors
    /// If a file cannot be opened. A port that cannot is waited for.
    pub fn open(path: &Path, baud: u32) -> Result<Self, CliError> {
        let (send, events) = sync_channel(WAITING);
        let is_recording = path.is_file();
        if is_stdin(path) {
            thread::spawn(move || read_to_end(&mut io::stdin().lock(), &send));
        } else if is_recording || is_pipe(path) {
            let path = path.to_path_buf();
            let unreadable = |error| CliError::file("read", &path, &error);
            // Opening a pipe waits for its writer.
            let opened = if is_recording { Some(File::open(&path).map_err(unreadable)?) } else { None };
            thread::spawn(move || match opened.map_or_else(|| File::open(&path), Ok) {
                Ok(mut file) => read_to_end(&mut file, &send),
                Err(error) => drop(send.send(Event::Away(error.to_string()))),
            });
        } else {
            let path = path.to_path_buf();
            thread::spawn(move || read_port(&path, baud, &send));
        }
        Ok(Self { events, is_recording })
    }
}

#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    path.metadata().is_ok_and(|metadata| metadata.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_pipe(_: &Path) -> bool {
    false
}

fn read_to_end(source: &mut dyn Read, send: &SyncSender<Event>) {
    let mut lines = Lines::default();
    let _ = send.send(Event::Connected);
    let failed = loop {
        match lines.read(source, send) {
            Err(Stop::Unheard) => return,
            Err(Stop::Failed(error)) => break Some(error),
            Ok(0) => break None,
            Ok(_) => {}
        }
    };
    let _ = lines.finish(send);
    let _ = send.send(failed.map_or(Event::Ended, |error| Event::Away(error.to_string())));
}

/// Reads a serial port for as long as anybody listens, and opens it again when it comes back.
fn read_port(path: &Path, baud: u32, send: &SyncSender<Event>) {
    let name = path.to_string_lossy();
    loop {
        let away = match serialport::new(name.as_ref(), baud).timeout(READ_TIMEOUT).open() {
            Err(error) => error.to_string(),
            Ok(mut port) => {
                let mut lines = Lines::default();
                let _ = send.send(Event::Connected);
                loop {
                    match lines.read(&mut port, send) {
                        Err(Stop::Unheard) => return,
                        Err(Stop::Failed(error)) => break error.to_string(),
                        Ok(0) => break "it was unplugged".into(),
                        Ok(_) => {}
                    }
                }
            }
        };
        if send.send(Event::Away(away)).is_err() {
            return;
        }
        thread::sleep(RETRY);
    }
}

/// Why reading stopped.
enum Stop {
    /// Nobody listens.
    Unheard,
    /// The source failed.
    Failed(io::Error),
}

impl From<SendError<Event>> for Stop {
    fn from(_: SendError<Event>) -> Self {
        Self::Unheard
    }
}

/// Bytes as lines.
#[derive(Default)]
struct Lines {
    begun: Vec<u8>,
}

impl Lines {
    /// Reads once and sends the lines that are complete; the number of bytes, 1 if none came in time.
    fn read(&mut self, source: &mut dyn Read, send: &SyncSender<Event>) -> Result<usize, Stop> {
        let mut bytes = [0; 4096];
        let count = match source.read(&mut bytes) {
            Ok(count) => count,
            Err(error)
                if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                return Ok(1);
            }
            Err(error) => return Err(Stop::Failed(error)),
        };
        let arrived = Instant::now();
        for byte in &bytes[..count] {
            if *byte == b'\n' || self.begun.len() >= LONGEST_LINE {
                send.send(Event::Line(std::mem::take(&mut self.begun), arrived))?;
            } else {
                self.begun.push(*byte);
            }
        }
        Ok(count)
    }

    /// Sends what has no end.
    fn finish(self, send: &SyncSender<Event>) -> Result<(), Stop> {
        if self.begun.is_empty() { Ok(()) } else { Ok(send.send(Event::Line(self.begun, Instant::now()))?) }
    }
}
