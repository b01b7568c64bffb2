//! For random files, a shell runs the suggestion of `inspect --suggest`, `import` accepts it, and the trace contains the file's
//! numbers.

use std::process::Command;

use crate::common::{Bench, Csv};
use assert_cmd::cargo::cargo_bin;
use proptest::prelude::*;
use proptest::sample::select;

/// A unit: its spelling in the file, and the power of ten by which its numbers exceed the trace's.
type Unit = (&'static str, i32);

/// Form of a file.
#[derive(Clone, Debug)]
struct Form {
    separator: char,
    comma: bool,
    preamble: usize,
    unit_line: bool,
    brackets: (&'static str, &'static str),
    names: [&'static str; 3],
    units: [Unit; 3],
    /// Places of time, reading and reference among the columns.
    order: [usize; 3],
    extra: bool,
    overload: &'static str,
    encoding: Encoding,
    line_end: &'static str,
    file: &'static str,
}

#[derive(Clone, Copy, Debug)]
enum Encoding {
    Utf8,
    Utf8Mark,
    Utf16,
    Latin1,
}

/// A row: microseconds, milliohms (`None` for an overload), millionths of strain.
type Row = (i64, Option<i64>, i64);

fn rows() -> impl Strategy<Value = Vec<Row>> {
    let row = (1_i64..400_000, proptest::option::weighted(0.9, 900_000_i64..5_000_000), -50_000_i64..900_000);
    proptest::collection::vec(row, 12..60).prop_map(|steps| {
        let mut time = 0;
        let later = |(step, reading, strain)| {
            time += step;
            (time, reading, strain)
        };
        steps.into_iter().map(later).collect()
    })
}

fn form() -> impl Strategy<Value = Form> {
    let separators =
        vec![(';', true), (';', false), ('\t', true), ('\t', false), (',', false), ('|', false), ('|', true)];
    let times: Vec<Unit> = vec![("s", 0), ("sec", 0), ("ms", 3), ("us", 6)];
    let readings: Vec<Unit> = vec![("Ohm", 0), ("kOhm", -3), ("kohms", -3), ("MOhm", -6)];
    let references: Vec<Unit> = vec![("%", 2), ("-", 0), ("ustrain", 6), ("mm/mm", 0)];
    let layout = (select(separators), 0..4_usize, any::<bool>(), select(vec![("(", ")"), ("[", "]")]), any::<bool>());
    let names = (
        select(vec!["Time", "t", "Zeit", "Elapsed Time"]),
        select(vec!["R", "Resistance", "Widerstand", "Sensor 1"]),
        select(vec!["Strain", "Dehnung", "eps"]),
    );
    let units = (select(times), select(readings), select(references));
    let order = Just([0, 1, 2]).prop_shuffle();
    let encoding = select(vec![Encoding::Utf8, Encoding::Utf8Mark, Encoding::Utf16, Encoding::Latin1]);
    let rest = (
        select(vec!["OVLD", "", "9.9E37", "NaN", "+OL"]),
        encoding,
        select(vec!["\n", "\r\n"]),
        select(vec!["rig.csv", "a b.txt", "it's.tsv", "$HOME.csv", "-dash.csv", "trace.csv"]),
    );
    (layout, names, units, order, rest).prop_map(|(layout, names, units, order, rest)| Form {
        separator: layout.0.0,
        comma: layout.0.1,
        preamble: layout.1,
        unit_line: layout.2,
        brackets: layout.3,
        extra: layout.4,
        names: [names.0, names.1, names.2],
        units: [units.0, units.1, units.2],
        order,
        overload: rest.0,
        encoding: rest.1,
        line_end: rest.2,
        file: rest.3,
    })
}

/// Formats a whole number of 10^-`digits` in a unit that is 10^`shift` times smaller, exactly.
fn decimal(value: i64, digits: i32, shift: i32, comma: bool) -> String {
    let digits = digits - shift;
    let sign = if value < 0 { "-" } else { "" };
    let text = value.unsigned_abs().to_string();
    let text = if digits <= 0 {
        format!("{text}{}", "0".repeat(digits.unsigned_abs() as usize))
    } else {
        let text = format!("{text:0>width$}", width = digits as usize + 1);
        let (whole, fraction) = text.split_at(text.len() - digits as usize);
        format!("{whole}{}{fraction}", if comma { ',' } else { '.' })
    };
    format!("{sign}{text}")
}

impl Form {
    fn bytes(&self, rows: &[Row]) -> Vec<u8> {
        let separator = self.separator.to_string();
        let line = |cells: [String; 3], extra: &str| {
            let mut sorted = self.order.map(|place| cells[place].clone()).to_vec();
            sorted.extend(self.extra.then(|| extra.to_owned()));
            sorted.join(&separator)
        };
        let mut lines: Vec<String> = (0..self.preamble).map(|i| format!("Pr\u{fc}fung {i}")).collect();
        let names = self.names.map(str::to_owned);
        if self.unit_line {
            lines.push(line(names, "Kraft"));
            lines.push(line(self.units.map(|(unit, _)| unit.to_owned()), "N"));
        } else {
            let (open, close) = self.brackets;
            let with_unit = |i: usize| format!("{} {open}{}{close}", self.names[i], self.units[i].0);
            lines.push(line([with_unit(0), with_unit(1), with_unit(2)], "Kraft [N]"));
        }
        let overload = if self.comma { self.overload.replace('.', ",") } else { self.overload.to_owned() };
        for (time, reading, strain) in rows {
            let number = |value: i64, digits: i32, unit: usize| decimal(value, digits, self.units[unit].1, self.comma);
            let reading = reading.map_or(overload.clone(), |value| number(value, 3, 1));
            lines.push(line([number(*time, 6, 0), reading, number(*strain, 6, 2)], "0"));
        }
        let text = lines.join(self.line_end) + self.line_end;
        match self.encoding {
            Encoding::Utf8 => text.into_bytes(),
            Encoding::Utf8Mark => [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            Encoding::Utf16 => [0xff, 0xfe].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect(),
            Encoding::Latin1 => text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect(),
        }
    }
}

/// Runs the program and then its suggestion; returns the messages if that fails.
fn import(bench: &Bench, file: &str) -> Result<Csv, String> {
    let folder = cargo_bin("ohmstrain").parent().unwrap().to_path_buf();
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    let named = if file.starts_with('-') { format!("./{file}") } else { file.to_owned() };
    let shell = |program: &str, arguments: &[&str]| {
        Command::new(program).args(arguments).env("PATH", &path).current_dir(bench.path("")).output().unwrap()
    };
    let suggested = shell("ohmstrain", &["inspect", "--suggest", &named]);
    let line = String::from_utf8(suggested.stdout).unwrap();
    if !suggested.status.success() || line.lines().count() != 1 {
        return Err(format!("no suggestion: {line}{}", String::from_utf8_lossy(&suggested.stderr)));
    }
    let run = shell("sh", &["-c", &line]);
    if !run.status.success() {
        return Err(format!("{line}{}", String::from_utf8_lossy(&run.stderr)));
    }
    let output = line.trim_end().rsplit_once(' ').unwrap().1;
    // Every command must read the import as a trace.
    let reimport = shell("ohmstrain", &["import", output]);
    let text = bench.read(output);
    let rows = |text: &str| text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect::<Vec<_>>();
    if rows(&String::from_utf8(reimport.stdout).unwrap()) != rows(&text) {
        return Err(format!("{line}the trace does not come back: {}", String::from_utf8_lossy(&reimport.stderr)));
    }
    Ok(Csv::new(&text))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_suggested_is_accepted_and_right(form in form(), rows in rows()) {
        let bench = Bench::new();
        bench.write(form.file, form.bytes(&rows));
        let trace = match import(&bench, form.file) {
            Ok(trace) => trace,
            Err(error) => return Err(TestCaseError::fail(error)),
        };
        // Powers of ten move the decimal mark instead of being multiplied, so that each number is rounded once, as here.
        let time: Vec<f64> = rows.iter().map(|(time, ..)| *time as f64 / 1e6).collect();
        let strain: Vec<f64> = rows.iter().map(|(.., strain)| *strain as f64 / 1e6).collect();
        let reading: Vec<f64> = rows.iter().map(|(_, reading, _)| reading.map_or(f64::NAN, |it| it as f64 / 1e3)).collect();
        prop_assert_eq!(trace.numbers("time_s"), time);
        prop_assert_eq!(trace.numbers("strain"), strain);
        prop_assert_eq!(format!("{:?}", trace.numbers("resistance_ohm")), format!("{reading:?}"));
    }
}
