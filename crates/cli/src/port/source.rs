//! Sources of lines: a serial port, a pipe, stdin, or a recording. A thread reads, so that the view never waits.

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, Read, Seek};
use std::path::Path;
use std::sync::mpsc::{Receiver, SendError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::error::{CliError, shell_word};
use crate::whole_file::is_stdin;

/// Largest number of pending lines; the source blocks when they are this many.
const WAITING: usize = 1 << 12;
/// Longest line, bytes; the rest of a longer line is dropped. No device sends lines that long.
const LONGEST_LINE: usize = 1 << 13;
/// Timeout of a read of a port, and the pause before a port that is gone is tried again.
const READ_TIMEOUT: Duration = Duration::from_millis(100);
pub(super) const RETRY: Duration = Duration::from_millis(300);

/// Event of a source.
pub enum Event {
    /// A line without its end, and when it arrived.
    Line(Vec<u8>, Instant),
    /// The port is open.
    Connected,
    /// The port is gone, or not there yet, with the reason.
    Away(String),
    /// End of a recording or of standard input.
    Ended,
    /// A recording or standard input that cannot be read.
    Failed(io::Error),
}

/// A source of lines.
pub struct Source {
    /// Events of the source.
    pub events: Receiver<Event>,
    /// True if it is a file, which has to be held back to the pace at which it was recorded.
    pub is_recording: bool,
}

impl Source {
    /// Creates a source that is filled by the thread that `start` starts.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn listening(start: impl FnOnce(SyncSender<Event>) -> Result<(), CliError>) -> Result<Self, CliError> {
        let (send, events) = sync_channel(WAITING);
        start(send)?;
        Ok(Self { events, is_recording: false })
    }

    /// Opens a source and starts to read.
    ///
    /// # Errors
    /// If a file cannot be opened, or stdin is the keyboard. A port that cannot be opened is waited for.
    pub fn open(path: &Path, baud: u32) -> Result<Self, CliError> {
        let (send, events) = sync_channel(WAITING);
        let is_recording = path.is_file();
        if is_stdin(path) {
            // The keyboard belongs to the view.
            if io::stdin().is_terminal() {
                let what = "--port -: stdin is the terminal: pipe readings into it, or name a port or a recording";
                return Err(CliError::Arguments(what.into()));
            }
            thread::spawn(move || drop(read_once(&mut io::stdin().lock(), &send)));
        } else if is_recording || path.is_dir() {
            let unreadable = |error| CliError::file("read", path, &error);
            let mut file = File::open(path).map_err(unreadable)?;
            let mut magic = [0; 4];
            // A folder can be opened, but not read.
            let known = file.read(&mut magic).map_err(unreadable)?;
            if magic[..known].starts_with(&[0x1f, 0x8b]) || &magic == b"PAR1" {
                let (name, word) = (path.display(), shell_word(&path.display().to_string()));
                let import = format!("`ohmstrain import {word} -o trace.csv` makes lines of it");
                return Err(CliError::Input(format!(
                    "{name}: expected lines of text, found gzip or Parquet; {import}"
                )));
            }
            file.rewind().map_err(unreadable)?;
            thread::spawn(move || drop(read_once(&mut file, &send)));
        } else if is_pipe(path) {
            // One without a name, as of `<(command)`, comes once.
            if path.canonicalize().is_err() {
                let mut pipe = File::open(path).map_err(|error| CliError::file("read", path, &error))?;
                thread::spawn(move || drop(read_once(&mut pipe, &send)));
            } else {
                let path = path.to_path_buf();
                thread::spawn(move || read_pipe(&path, &send));
            }
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

/// Reads a source that comes once, as long as there is a receiver.
fn read_once(source: &mut dyn Read, send: &SyncSender<Event>) -> Result<(), SendError<Event>> {
    let ended = read_to_end(source, send)?;
    send.send(ended.map_or_else(Event::Failed, |()| Event::Ended))
}

/// Reads a connection that another one may follow, as long as there is a receiver.
pub(super) fn read_connection(source: &mut dyn Read, send: &SyncSender<Event>) -> Result<(), SendError<Event>> {
    let ended = read_to_end(source, send)?;
    let why = ended.map_or_else(|error| error.to_string(), |()| "the other end has closed it".to_owned());
    send.send(Event::Away(why))
}

/// Reads as long as there is a receiver; returns the error of the source.
fn read_to_end(source: &mut dyn Read, send: &SyncSender<Event>) -> Result<io::Result<()>, SendError<Event>> {
    let mut lines = Lines::default();
    send.send(Event::Connected)?;
    let ended = loop {
        match lines.read(source, send) {
            Err(Stop::NoReceiver(unsent)) => return Err(unsent),
            Err(Stop::Failed(error)) => break Err(error),
            Ok(0) => break Ok(()),
            Ok(_) => {}
        }
    };
    lines.finish(send)?;
    Ok(ended)
}

/// Reads a pipe again and again: another program may write into it after one has ended.
fn read_pipe(path: &Path, send: &SyncSender<Event>) {
    loop {
        // Opening it waits for a writer.
        let read = match File::open(path) {
            Ok(mut file) => read_connection(&mut file, send),
            Err(error) => send.send(Event::Away(error.to_string())),
        };
        if read.is_err() {
            return;
        }
        thread::sleep(RETRY);
    }
}

/// Reads a serial port as long as there is a receiver, and opens it again when it comes back.
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
                        Err(Stop::NoReceiver(_)) => return,
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

/// Reason why reading stopped.
pub(super) enum Stop {
    /// The receiver is gone.
    NoReceiver(SendError<Event>),
    /// The source failed.
    Failed(io::Error),
}

impl From<SendError<Event>> for Stop {
    fn from(unsent: SendError<Event>) -> Self {
        Self::NoReceiver(unsent)
    }
}

/// Splits bytes into lines.
#[derive(Default)]
pub(super) struct Lines {
    begun: Vec<u8>,
    /// True if the bytes up to the next end of line belong to a line that was cut.
    is_cut: bool,
}

impl Lines {
    /// Reads once and sends the complete lines; returns the number of bytes, or 1 if none came in time.
    pub(super) fn read(&mut self, source: &mut dyn Read, send: &SyncSender<Event>) -> Result<usize, Stop> {
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
            let is_end = *byte == b'\n';
            if !self.is_cut && (is_end || self.begun.len() >= LONGEST_LINE) {
                send.send(Event::Line(std::mem::take(&mut self.begun), arrived))?;
                self.is_cut = true;
            }
            if is_end {
                self.is_cut = false;
            } else if !self.is_cut {
                self.begun.push(*byte);
            }
        }
        Ok(count)
    }

    /// Sends the last line, which has no end.
    pub(super) fn finish(self, send: &SyncSender<Event>) -> Result<(), SendError<Event>> {
        if self.begun.is_empty() { Ok(()) } else { send.send(Event::Line(self.begun, Instant::now())) }
    }
}
