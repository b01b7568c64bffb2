//! `live` in a terminal of its own, with a serial port that is the other end of a pseudo-terminal.
#![cfg(unix)]

use std::io::Write;
use std::net::{TcpListener, UdpSocket};
use std::path::Path;
use std::thread;
use std::time::Duration;

use crate::common::terminal::{Port, Terminal};
use crate::common::{Bench, Csv};
use assert_cmd::cargo::cargo_bin;

/// Starts `live` with the bench's sensor.
fn live(bench: &Bench, port: &str, more: &[&str]) -> Terminal {
    let arguments = [&["live", "--port", port, "--sensor", "sensor.toml"], more].concat();
    Terminal::new(bench, cargo_bin!("ohmstrain"), &arguments)
}

/// Returns the terminal's line for a row of `filter`.
fn shown(estimates: &Csv, row: usize) -> String {
    let number = |column: &str| estimates.numbers(column)[row];
    // 1.96 standard deviations, in percent, with the terminal's two digits.
    format!("{:.2} ± {:.2} %", 100.0 * number("strain"), 100.0 * 1.96 * number("strain_sd"))
}

/// Returns a row at 5 Hz as a device sends it.
fn sent(row: u32) -> String {
    format!("{:.1},{}\n", 0.2 * f64::from(row), 1600 + row % 7)
}

#[test]
fn lines_come_by_udp() {
    let bench = Bench::calibrated();
    let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let header = ["live", "--udp", &free, "--sensor", "sensor.toml", "--header", "time_s,resistance_ohm"];
    let live = Terminal::new(&bench, cargo_bin!("ohmstrain"), &header);
    live.wait_for(&format!("udp {free}"));
    let device = UdpSocket::bind("127.0.0.1:0").unwrap();
    // Two lines in a datagram, one without its end, and an invalid one.
    for text in [sent(0) + &sent(1), sent(2).trim().to_owned(), "garbage\n".to_owned(), sent(3)] {
        device.send_to(text.as_bytes(), &free).unwrap();
        thread::sleep(Duration::from_millis(5));
    }
    live.wait_for("1603");
    let summary = live.quit();
    assert!(summary.contains("4 rows, 0 readings missing") && summary.contains("1 line skipped"), "{summary}");
}

#[test]
fn lines_come_by_tcp_from_one_device_after_the_other() {
    let bench = Bench::calibrated();
    let device = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = device.local_addr().unwrap().to_string();
    let flags = ["live", "--tcp", &address, "--sensor", "sensor.toml", "--header", "time_s,resistance_ohm"];
    let live = Terminal::new(&bench, cargo_bin!("ohmstrain"), &flags);
    for part in [0..3, 3..6] {
        let (mut stream, _) = device.accept().unwrap();
        let text: String = part.clone().map(sent).collect();
        stream.write_all(text.as_bytes()).unwrap();
        live.wait_for(&(1600 + part.end - 1).to_string());
        // The sender disconnects, and another one connects.
        drop(stream);
    }
    assert!(live.quit().contains("6 rows, 0 readings missing"));
    let one_source = ["live", "--tcp", ":9000", "--udp", ":9000", "--sensor", "sensor.toml"];
    assert!(bench.run(&one_source).stderr.contains("cannot be used with"));
    let no_port = bench.run(&["live", "--udp", "localhost", "--sensor", "sensor.toml"]);
    assert!(no_port.code == Some(2) && no_port.stderr.contains("expected :PORT or HOST:PORT"), "{}", no_port.stderr);
}

#[test]
fn lines_from_a_port_are_filtered_at_real_speed_and_faster() {
    let bench = Bench::calibrated();
    let trace = bench.read("trace.csv");
    let estimates = Csv::new(&bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml"]).ok());
    let lines: Vec<&str> = trace.lines().collect();
    let head = lines.iter().position(|line| line.starts_with("time_s")).unwrap() + 1;
    let port_path = bench.path("port");
    let mut port = Port::plug_in(&port_path);
    let terminal = live(&bench, "port", &[]);
    terminal.wait_for("connected");
    port.send(&(lines[..head].join("\r\n") + "\r\n"));
    // Five readings per second, as in the recording.
    for line in &lines[head..head + 10] {
        port.send(&format!("{line}\r\n"));
        thread::sleep(Duration::from_millis(200));
    }
    terminal.wait_for("10 at 5.0/s");
    terminal.wait_for(&shown(&estimates, 9));
    for line in &lines[head + 10..] {
        port.send(&format!("{line}\r\n"));
    }
    let last = estimates.len() - 1;
    terminal.wait_for(&format!("{} at 5.0/s", last + 1));
    terminal.wait_for(&shown(&estimates, last));
    terminal.wait_for("0 lines");
    assert!(terminal.quit().contains(&format!("{} rows, 0 readings missing, 0 gaps, 0 lines skipped", last + 1)));
}

#[test]
fn garbage_resizing_and_unplugging_stop_nothing() {
    let bench = Bench::calibrated();
    let port_path = bench.path("port");
    let terminal = live(&bench, "port", &["--header", "time_s,resistance_ohm"]);
    terminal.wait_for("waiting for the port");
    let mut port = Port::plug_in(&port_path);
    terminal.wait_for("connected");
    // The rest of a line, as after opening a port late; then a good line, and lines damaged by interference.
    port.send("00,16");
    port.send("\n1.0,1600\n\u{fffd}\u{1}\"\n1.2,16x0\n1.2,1601,7\n");
    port.device.write_all(&[0xff, 0xfe, b'\n', b'1', b'.', b'2', b',', b'\n', b'1', b'.', b'4', b',']).unwrap();
    port.send("1602\n");
    terminal.wait_for("1 missing, 0 gaps");
    // `00,16` is a row by chance: 16 ohms at 0 s, which the sensor cannot read.
    terminal.wait_for("4 lines");
    // An endless line counts as one, and its end is not a row.
    for part in ["9".repeat(8192), "9".repeat(4000)] {
        port.send(&part);
        thread::sleep(Duration::from_millis(50));
    }
    port.send("\n1.6,1602\n");
    terminal.wait_for("5 lines");
    for (rows, cols) in [(3, 10), (1, 1), (200, 20), (12, 300), (5, 20), (30, 110)] {
        terminal.resize(rows, cols);
        thread::sleep(Duration::from_millis(120));
        // Five rows: the heading, and numbers.
        if rows == 5 {
            terminal.wait_for("\nreading");
        }
    }
    terminal.wait_for("z zero at rest");
    terminal.wait_for("5 lines");
    terminal.wait_for("silent     for ");
    drop(port);
    terminal.wait_for("waiting for the port");
    let mut port = Port::plug_in(&port_path);
    terminal.wait_for("connected");
    // The device has been reset: its clock restarts, which three lines confirm.
    port.send("0.2,1600\n0.4,1600\n0.6,1600\n0.8,1601\n1.0,1601\n");
    terminal.wait_for("the clock has started again");
    let left = terminal.quit();
    assert!(left.contains("7 lines skipped, 1 restart of the clock"), "{left}");
}

#[test]
fn a_recording_is_played_back_recorded_marked_and_zeroed() {
    let bench = Bench::calibrated();
    let mut terminal = live(&bench, "trace.csv", &["--speed", "20"]);
    // 5 rows per second, twenty times as fast.
    terminal.wait_for("at 5.0/s");
    terminal.press("r");
    terminal.wait_for("recording to live-1.csv");
    terminal.press("m");
    terminal.wait_for("mark 1 at");
    terminal.press("z");
    terminal.wait_for("it starts again at zero");
    terminal.press("r");
    terminal.wait_for("recorded live-1.csv (");
    // However the program ends, the record has whole rows.
    terminal.press("r");
    terminal.wait_for("recording to live-2.csv");
    terminal.wait_for("record     1");
    let killed = bench.read("live-2.csv");
    assert!(killed.ends_with('\n') && killed.lines().count() > 2, "{killed}");
    terminal.press("r");
    terminal.wait_for("recorded live-2.csv (");
    let left = terminal.quit();
    assert!(left.contains("0 lines skipped"), "{left}");

    let (recorded, trace) = (Csv::new(&bench.read("live-1.csv")), Csv::new(&bench.read("trace.csv")));
    assert_eq!(recorded.header, "time_s,resistance_ohm,strain,mark");
    let first = trace.cells("time_s").iter().position(|time| *time == recorded.cells("time_s")[0]).unwrap();
    for column in ["time_s", "resistance_ohm", "strain"] {
        assert_eq!(recorded.numbers(column), trace.numbers(column)[first..first + recorded.len()], "{column}");
    }
    assert_eq!(recorded.cells("mark").iter().filter(|mark| **mark == "1").count(), 1);
    bench.run(&["filter", "live-1.csv", "--sensor", "sensor.toml"]).ok();
    let written = bench.read("live-1.csv");
    let made_by: Vec<&str> = written.lines().filter(|line| line.starts_with("# made_by = ")).collect();
    assert!(made_by.len() == 1 && made_by[0].ends_with(" live"), "{made_by:?}");
}

/// A record has the readings and the temperatures as they came, not converted; after another header it begins anew.
#[test]
fn a_record_has_temperatures_and_begins_anew() {
    let bench = Bench::calibrated();
    let effect = "reference_c = 25.0\nlower_c = 10.0\nupper_c = 40.0\nrest_per_k = 0.003\nrest_per_k_sd = 0.0\n\
                  gain_per_k = 0.0\ngain_per_k_sd = 0.0\n";
    bench.write("warm.toml", format!("{}\n[temperature]\n{effect}", bench.read("sensor.toml")));
    let port_path = bench.path("port");
    let mut port = Port::plug_in(&port_path);
    let arguments = ["live", "--port", "port", "--sensor", "warm.toml"];
    let mut terminal = Terminal::new(&bench, cargo_bin!("ohmstrain"), &arguments);
    terminal.wait_for("connected");
    port.send("time_s,resistance_ohm,temperature_c\n0.2,1600,31.5\n");
    // Hotter by 6.5 K, R0 is larger by 1.95 %: the reading counts as 1600 / 1.0195 ohms.
    terminal.wait_for("1569");
    terminal.press("r");
    terminal.wait_for("recording to live-1.csv");
    port.send("0.4,1601,31.5\n0.6,1602,\n");
    terminal.wait_for("3 at 5.0/s");
    port.send("time_s,resistance_ohm\n0.2,1603\n");
    terminal.wait_for("recording to live-2.csv");
    terminal.wait_for("1603");
    terminal.press("r");
    terminal.wait_for("recorded live-2.csv (1 row)");
    terminal.quit();
    let rows = |name: &str| -> Vec<String> {
        bench.read(name).lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
    };
    assert_eq!(rows("live-1.csv"), ["time_s,resistance_ohm,temperature_c,mark", "0.4,1601,31.5,", "0.6,1602,,"]);
    assert_eq!(rows("live-2.csv"), ["time_s,resistance_ohm,mark", "0.2,1603,"]);
}

/// Two joints of one sensor, on a port that is joined within a line: each number is that of `filter`.
#[test]
fn a_hand_is_shown_recorded_and_zeroed() {
    let bench = Bench::calibrated();
    let trace = Csv::new(&bench.read("trace.csv"));
    let (times, ohms) = (trace.cells("time_s"), trace.cells("resistance_ohm"));
    let joint =
        |name: &str| format!("[[joints]]\nname = \"{name}\"\ncolumn = \"{name}_ohm\"\nsensor = \"sensor.toml\"\n");
    bench.write("pair.toml", format!("format = 1\n{}{}", joint("left"), joint("right")));
    let port_path = bench.path("port");
    let mut port = Port::plug_in(&port_path);
    let arguments = ["live", "--port", "port", "--sensor", "pair.toml"];
    let mut terminal = Terminal::new(&bench, cargo_bin!("ohmstrain"), &arguments);
    terminal.wait_for("connected");
    port.send("00,16,17\ntime_s,left_ohm,right_ohm\n");
    let rows = 50;
    for row in 0..rows {
        port.send(&format!("{},{},{}\n", times[row], ohms[row], ohms[rows - 1 - row]));
    }
    let back: String = (0..rows).map(|row| format!("{},{}\n", times[row], ohms[rows - 1 - row])).collect();
    bench.write("back.csv", format!("time_s,resistance_ohm\n{back}"));
    terminal.wait_for("50 at 5.0/s");
    for (name, file) in [("left", "trace.csv"), ("right", "back.csv")] {
        let alone = Csv::new(&bench.run(&["filter", file, "--sensor", "sensor.toml"]).ok());
        let number = |column: &str| alone.numbers(column)[rows - 1];
        let shown = format!("{name:<11}{:.1} ± {:.1} %", 100.0 * number("strain"), 196.0 * number("strain_sd"));
        terminal.wait_for(&shown);
    }
    terminal.press("r");
    terminal.wait_for("recording to live-1.csv");
    terminal.press("m");
    port.send(&format!("{},1600,\ngarbage\n", times[rows]));
    terminal.wait_for("51 at 5.0/s");
    terminal.wait_for("1 missing");
    terminal.press("r");
    terminal.wait_for("recorded live-1.csv (1 row)");
    // A joint whose channel is not read stays as it was.
    terminal.press("z");
    terminal.wait_for("right stays as it was: right_ohm: no reading");
    port.send(&format!("{},1600,1600\n", times[rows + 1]));
    terminal.wait_for("52 at 5.0/s");
    terminal.press("z");
    terminal.wait_for("R0 of each channel");
    let left = terminal.quit();
    assert!(left.contains("52 rows, 1 reading missing, 0 gaps, 2 lines skipped"), "{left}");
    let recorded = Csv::new(&bench.read("live-1.csv"));
    assert_eq!(recorded.header, "time_s,left_ohm,right_ohm,mark");
    assert_eq!(
        (recorded.cells("left_ohm")[0], recorded.cells("right_ohm")[0], recorded.cells("mark")[0]),
        ("1600", "", "1")
    );
    let refused = bench.run(&["smooth", "live-1.csv", "--sensor", "pair.toml", "--known", "1:0"]);
    assert!(refused.stderr.contains("--known is for one sensor"), "{}", refused.stderr);
}

#[test]
fn readings_on_stdin_leave_the_keys_to_the_terminal() {
    let bench = Bench::calibrated();
    let program = cargo_bin!("ohmstrain");
    let rows: String = (0..30).map(|row| format!("{}\n", 1600 + row)).collect();
    bench.write("readings.txt", rows);
    let line =
        format!("'{}' live --port - --header resistance_ohm --sensor sensor.toml < readings.txt", program.display());
    let terminal = Terminal::new(&bench, Path::new("/bin/sh"), &["-c", &line]);
    terminal.wait_for("the readings have ended");
    // All lines arrive at once, and none is lost.
    terminal.wait_for("drop-outs");
    let left = terminal.quit();
    assert!(left.contains("30 rows, 0 readings missing, 0 gaps, 0 lines skipped"), "{left}");
}

/// The keyboard belongs to the view, so readings cannot come from it.
#[test]
fn the_keyboard_is_no_port() {
    let bench = Bench::calibrated();
    let mut terminal = live(&bench, "-", &[]);
    terminal.wait_for("stdin is the terminal: pipe readings into it");
    assert_eq!(terminal.child.wait().unwrap().exit_code(), 2);
    let mut terminal = live(&bench, ".", &[]);
    terminal.wait_for("cannot read .: ");
    assert_eq!(terminal.child.wait().unwrap().exit_code(), 1);
    bench.write("trace.csv.gz", b"\x1f\x8b\x08\x00");
    let mut terminal = live(&bench, "trace.csv.gz", &[]);
    terminal.wait_for("`ohmstrain import trace.csv.gz -o trace.csv`");
    assert_eq!(terminal.child.wait().unwrap().exit_code(), 4);
}

#[test]
fn a_pipe_is_reopened_when_another_program_writes_into_it() {
    let bench = Bench::calibrated();
    let pipe = bench.path("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut terminal = live(&bench, "pipe", &["--header", "time_s,resistance_ohm"]);
    terminal.wait_for("no reading yet");
    terminal.press("r");
    terminal.wait_for("there is nothing to record yet");
    for (first, words) in [(1, "5 at 10.0/s"), (6, "10 at 10.0/s")] {
        let rows: String = (first..first + 5).map(|row| format!("{}.{},1600\n", row / 10, row % 10)).collect();
        std::fs::write(&pipe, rows).unwrap();
        terminal.wait_for(words);
        terminal.wait_for("the other end has closed it");
    }
    terminal.press("z");
    terminal.wait_for("R0 is 1600 now, the median of 10 readings");
    assert!(terminal.quit().contains("10 rows, 0 readings missing, 0 gaps, 0 lines skipped"));
}

#[test]
fn without_a_terminal_there_is_nothing_to_draw_on() {
    let bench = Bench::calibrated();
    let refused = bench.run(&["live", "--port", "trace.csv", "--sensor", "sensor.toml"]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.stderr.contains("ohmstrain filter") && refused.stdout.is_empty(), "{}", refused.stderr);
}
