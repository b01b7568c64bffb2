//! Lines received by UDP and TCP.

use std::io;
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::sync::mpsc::SyncSender;
use std::thread;

use super::source::{Event, Lines, RETRY, read_connection};
use crate::error::CliError;

/// Largest datagram.
const DATAGRAM: usize = 1 << 16;

/// Returns the address to listen at; one that begins with a colon is that port on every interface.
fn bound(address: &str) -> String {
    if address.starts_with(':') { format!("0.0.0.0{address}") } else { address.to_owned() }
}

fn refused(flag: &str, address: &str, error: &io::Error) -> CliError {
    CliError::Other(format!("{flag} {address}: cannot listen there: {error}"))
}

/// Receives datagrams of lines from any sender.
///
/// # Errors
/// If the address cannot be bound.
pub fn listen_udp(address: &str, send: SyncSender<Event>) -> Result<(), CliError> {
    let socket = UdpSocket::bind(bound(address)).map_err(|error| refused("--udp", address, &error))?;
    thread::spawn(move || {
        let mut bytes = vec![0; DATAGRAM];
        let _ = send.send(Event::Connected);
        loop {
            let sent = match socket.recv(&mut bytes) {
                Ok(count) => datagram(&bytes[..count], &send),
                Err(error) => {
                    thread::sleep(RETRY);
                    send.send(Event::Away(error.to_string())).is_ok()
                }
            };
            if !sent {
                return;
            }
        }
    });
    Ok(())
}

/// Sends the lines of a datagram, whose last line needs no end; returns true while there is a receiver.
fn datagram(mut bytes: &[u8], send: &SyncSender<Event>) -> bool {
    let mut lines = Lines::default();
    while !bytes.is_empty() {
        if lines.read(&mut bytes, send).is_err() {
            return false;
        }
    }
    lines.finish(send).is_ok()
}

/// Connects to HOST:PORT again and again, or waits at :PORT for one sender after another.
///
/// # Errors
/// If the address cannot be bound.
pub fn read_tcp(address: &str, send: SyncSender<Event>) -> Result<(), CliError> {
    if !address.starts_with(':') {
        let address = address.to_owned();
        thread::spawn(move || take_turns(|| TcpStream::connect(&address), &send));
        return Ok(());
    }
    let listener = TcpListener::bind(bound(address)).map_err(|error| refused("--tcp", address, &error))?;
    thread::spawn(move || take_turns(|| listener.accept().map(|(stream, _)| stream), &send));
    Ok(())
}

/// Reads one connection after another, as long as there is a receiver.
fn take_turns(next: impl Fn() -> io::Result<TcpStream>, send: &SyncSender<Event>) {
    loop {
        let read = match next() {
            Ok(mut stream) => read_connection(&mut stream, send),
            Err(error) => send.send(Event::Away(error.to_string())),
        };
        if read.is_err() {
            return;
        }
        thread::sleep(RETRY);
    }
}
