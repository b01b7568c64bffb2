//! `serve`: the page, served on this computer.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

use crate::common::Bench;
use assert_cmd::cargo::cargo_bin;

const PAGE: &str = "<!doctype html>\n<title>strain \u{b5}</title>\n";

/// A running program, stopped on drop, and the address that it prints.
struct Served {
    program: Child,
    address: String,
}

impl Served {
    fn new(bench: &Bench) -> Self {
        let mut command = Command::new(cargo_bin!("ohmstrain"));
        command.current_dir(bench.path("")).args(["--quiet", "serve", "page.html", "--port", "0"]);
        let mut program = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(program.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.strip_prefix("http://").and_then(|rest| rest.strip_suffix("/\n")).unwrap().to_string();
        Self { program, address }
    }

    /// Returns head and body of the answer to a request.
    fn ask(&self, method: &str, path: &str) -> (String, String) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(stream, "{method} {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.to_string(), body.to_string())
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

#[test]
fn a_browser_gets_the_page_and_nothing_else() {
    let bench = Bench::new();
    bench.write("page.html", PAGE);
    bench.write("secret.txt", "nobody's business");
    let served = Served::new(&bench);
    assert!(served.address.starts_with("127.0.0.1:"), "{}", served.address);
    for path in ["/", "/index.html"] {
        let (head, body) = served.ask("GET", path);
        assert!(head.starts_with("HTTP/1.1 200") && head.contains("text/html; charset=utf-8"), "{head}");
        assert_eq!(body, PAGE);
    }
    let (head, body) = served.ask("HEAD", "/");
    assert!(head.starts_with("HTTP/1.1 200") && body.is_empty(), "{head}");
    for path in ["/secret.txt", "/../secret.txt", "/page.html"] {
        assert!(served.ask("GET", path).0.starts_with("HTTP/1.1 404"), "{path}");
    }
    assert!(served.ask("POST", "/").0.starts_with("HTTP/1.1 405"));
}

#[test]
fn requests_that_cannot_be_served_are_refused() {
    let bench = Bench::new();
    bench.write("page.html", PAGE);
    let served = Served::new(&bench);
    let port = served.address.rsplit(':').next().unwrap();
    let taken = bench.run(&["serve", "page.html", "--port", port]);
    assert_eq!(taken.code, Some(1));
    let message = format!("ohmstrain: cannot listen on port {port} of 127.0.0.1: ");
    assert!(
        taken.stderr.starts_with(&message) && taken.stderr.ends_with("; --port names another\n"),
        "{}",
        taken.stderr
    );
    let missing = bench.run(&["serve", "none.html"]);
    assert!(missing.code == Some(1) && missing.stderr.contains("cannot read none.html"), "{}", missing.stderr);
}
