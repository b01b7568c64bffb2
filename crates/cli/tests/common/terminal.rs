//! The program on a terminal of its own, with a serial port that is the other end of a pseudo-terminal.
#![cfg(unix)]

use std::io::{Read, Write};
use std::num::NonZero;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, MasterPty, PtyPair, PtySize, native_pty_system};

use super::Bench;

/// Longer than any operation takes on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(60);

fn pair(rows: u16, cols: u16) -> PtyPair {
    native_pty_system().openpty(PtySize { rows, cols, pixel_width: 0, pixel_height: 0 }).unwrap()
}

fn cells(count: u16) -> NonZero<u16> {
    NonZero::new(count).unwrap()
}

/// The program on a terminal.
pub struct Terminal {
    master: Box<dyn MasterPty + Send>,
    keys: Box<dyn Write + Send>,
    screen: Arc<Mutex<vt100::Parser>>,
    pub child: Box<dyn Child + Send + Sync>,
}

impl Terminal {
    pub fn new(bench: &Bench, program: &Path, arguments: &[&str]) -> Self {
        let pair = pair(30, 110);
        let mut command = CommandBuilder::new(program);
        command.cwd(bench.path(""));
        command.args(arguments);
        command.env("TERM", "xterm");
        let child = pair.slave.spawn_command(command).unwrap();
        drop(pair.slave);
        let screen = Arc::new(Mutex::new(vt100::Parser::new(cells(30), cells(110), 0)));
        let (mut output, drawn) = (pair.master.try_clone_reader().unwrap(), Arc::clone(&screen));
        thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                drawn.lock().unwrap().process(&bytes[..count]);
            }
        });
        let keys = pair.master.take_writer().unwrap();
        Self { master: pair.master, keys, screen, child }
    }

    pub fn text(&self) -> String {
        self.screen.lock().unwrap().screen().contents()
    }

    #[track_caller]
    pub fn wait_for(&self, words: &str) {
        let start = Instant::now();
        while !self.text().contains(words) {
            assert!(start.elapsed() < PATIENCE, "no `{words}` on\n{}", self.text());
            thread::sleep(Duration::from_millis(20));
        }
    }

    pub fn press(&mut self, key: &str) {
        self.keys.write_all(key.as_bytes()).unwrap();
    }

    pub fn resize(&self, rows: u16, cols: u16) {
        self.screen.lock().unwrap().screen_mut().set_size(cells(rows), cells(cols));
        self.master.resize(PtySize { rows, cols, pixel_width: 0, pixel_height: 0 }).unwrap();
    }

    /// Quits the program, and returns the text on the terminal.
    #[track_caller]
    pub fn quit(mut self) -> String {
        self.press("q");
        self.left()
    }

    /// Waits for the end of the program, and returns the text on the terminal.
    #[track_caller]
    pub fn left(mut self) -> String {
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            assert!(start.elapsed() < PATIENCE, "still there:\n{}", self.text());
            thread::sleep(Duration::from_millis(20));
        };
        assert_eq!(status.exit_code(), 0, "{}", self.text());
        self.wait_for(" rows, ");
        assert!(!self.screen.lock().unwrap().screen().alternate_screen());
        self.text()
    }
}

/// Other end of a serial port.
pub struct Port {
    pub device: Box<dyn Write + Send>,
    _pair: PtyPair,
}

impl Port {
    /// Plugs the port in at `path`.
    pub fn plug_in(path: &Path) -> Self {
        let pair = pair(24, 80);
        let _ = std::fs::remove_file(path);
        symlink(pair.master.tty_name().unwrap(), path).unwrap();
        Self { device: pair.master.take_writer().unwrap(), _pair: pair }
    }

    pub fn send(&mut self, text: &str) {
        self.device.write_all(text.as_bytes()).unwrap();
    }
}
