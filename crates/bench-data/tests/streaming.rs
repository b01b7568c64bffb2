//! A row is delivered when its line is complete, not when a buffer is full.

use std::cell::Cell;
use std::io::{Read, Write};
use std::rc::Rc;

use ohmstrain_bench_data::TraceReader;

/// Reader that returns one line per call of `read` and counts them.
struct Lines {
    lines: Vec<&'static str>,
    given: Rc<Cell<usize>>,
}

impl Read for Lines {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let Some(line) = self.lines.get(self.given.get()) else { return Ok(0) };
        self.given.set(self.given.get() + 1);
        out[..line.len()].copy_from_slice(line.as_bytes());
        Ok(line.len())
    }
}

#[test]
fn no_line_is_read_before_it_is_needed() {
    let given = Rc::new(Cell::new(0));
    let lines = vec!["# a = b\r\n", "time_s,resistance_ohm\r\n", "0,1\r\n", "1,2\r\n", "\n", "2,3\n"];
    let mut rows = TraceReader::new(Lines { lines, given: Rc::clone(&given) }, "t").unwrap();
    assert_eq!(given.get(), 2);
    let mut seen = Vec::new();
    for row in rows.by_ref() {
        seen.push((row.unwrap().line, given.get()));
    }
    assert_eq!(seen, [(3, 3), (4, 4), (6, 6)]);
    assert!(rows.next().is_none());
}

#[test]
fn a_live_pipe_is_answered_row_by_row() {
    let (reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(b"time_s,resistance_ohm\n").unwrap();
    let mut rows = TraceReader::new(reader, "-").unwrap();
    // Written and read alternately in one thread: a reader that waited for more input would never return.
    for i in 0..100 {
        write!(writer, "{i},{}", i + 1).unwrap();
        writer.write_all(b"\n").unwrap();
        assert_eq!(rows.next().unwrap().unwrap().reading.value, f64::from(i + 1));
    }
    drop(writer);
    assert!(rows.next().is_none());
}
