//! A folder for each test, the program started in it, and its parsed output.

pub mod terminal;

use std::fs;
use std::path::PathBuf;
use std::process::Output;
use std::sync::OnceLock;

use assert_cmd::cargo::cargo_bin_cmd;
use tempfile::TempDir;

/// Columns of the estimates of a sensor calibrated in ohm and strain, on which scripts rely.
pub const ESTIMATES_HEADER: &str = "time_s,resistance_ohm,strain,strain_sd,strain_rate,strain_rate_sd,relaxation,\
     relaxation_sd,baseline,settled_resistance_ohm,settled_resistance_sd_ohm,p_extend,p_hold,p_retract,p_beyond_border,\
     nis,flags";

/// Five readings per second, which are enough for a calibration within a second.
pub const SIMULATE: [&str; 8] =
    ["simulate", "--protocol", "mixed", "--speed-mm-s", "5", "--sample-rate-hz", "5", "--mismatched"];

/// Three quarters of the 400 s that `SIMULATE` records, s.
pub const CALIBRATED_UNTIL: &str = "300";

/// A temporary folder in which the program runs, so that messages name files without their folder.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    /// Creates an empty folder.
    pub fn new() -> Self {
        Self { folder: TempDir::new().unwrap() }
    }

    /// Creates a folder with these files.
    pub fn with(files: &[(String, String)]) -> Self {
        let bench = Self::new();
        files.iter().for_each(|(name, content)| bench.write(name, content));
        bench
    }

    /// Creates a folder with `trace.csv`, a simulated recording, `sensor.toml`, calibrated on three quarters of it for the
    /// fastest estimator, and `closing.json`, the summary of its calibration.
    pub fn calibrated() -> Self {
        static FILES: OnceLock<Vec<(String, String)>> = OnceLock::new();
        Self::with(FILES.get_or_init(|| calibrated(&["--estimator", "ekf"])))
    }

    /// Creates the same with the default estimator; it takes half a minute, once.
    pub fn calibrated_by_default() -> Self {
        static FILES: OnceLock<Vec<(String, String)>> = OnceLock::new();
        Self::with(FILES.get_or_init(|| calibrated(&[])))
    }

    /// Returns the path of a file of the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    /// Reads a file.
    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Returns the names of all files, sorted.
    pub fn files(&self) -> Vec<String> {
        files_in(self.folder.path())
    }

    /// Returns the names and contents of all files, which are text, sorted by name.
    pub fn contents(&self) -> Vec<(String, String)> {
        self.files().into_iter().map(|name| (name.clone(), self.read(&name))).collect()
    }

    /// Runs the program to its end, with nothing on stdin.
    pub fn run(&self, arguments: &[&str]) -> Run {
        self.feed(arguments, "")
    }

    /// Runs the program to its end, with this on stdin.
    pub fn feed(&self, arguments: &[&str], stdin: impl Into<Vec<u8>>) -> Run {
        let output =
            cargo_bin_cmd!("ohmstrain").current_dir(self.folder.path()).args(arguments).write_stdin(stdin).output();
        Run::new(arguments, output.unwrap())
    }
}

/// Returns a simulated recording, the sensor calibrated on its first rows with these flags, and the summary of the calibration.
fn calibrated(flags: &[&str]) -> Vec<(String, String)> {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let calibrate = ["calibrate", "trace.csv", "--until", CALIBRATED_UNTIL, "-o", "sensor.toml", "--json"];
    bench.write("closing.json", bench.run(&[&calibrate[..], flags].concat()).ok());
    bench.contents()
}

/// Returns the names of the files in a folder, sorted.
pub fn files_in(folder: &std::path::Path) -> Vec<String> {
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

/// Result of a run of the program.
pub struct Run {
    /// The arguments it was started with.
    pub command: String,
    /// Exit code.
    pub code: Option<i32>,
    /// Its stdout.
    pub stdout: String,
    /// Its stderr, without warnings.
    pub stderr: String,
    /// Its warnings.
    pub warnings: Vec<String>,
}

impl Run {
    /// Collects the results of a process.
    pub fn new(arguments: &[&str], output: Output) -> Self {
        let printed = String::from_utf8(output.stderr).unwrap();
        let is_warning = |line: &&str| line.starts_with("ohmstrain: warning: ");
        let (warnings, stderr): (Vec<&str>, Vec<&str>) = printed.split_inclusive('\n').partition(is_warning);
        Self {
            command: arguments.join(" "),
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: stderr.concat(),
            warnings: warnings.into_iter().map(str::to_owned).collect(),
        }
    }

    /// Asserts success without messages on stderr except warnings; returns stdout.
    #[track_caller]
    pub fn ok(self) -> String {
        assert_eq!((self.code, self.stderr.as_str()), (Some(0), ""), "{}", self.command);
        self.stdout
    }

    /// Asserts failure with this exit code and this one line on stderr, and only whole rows on stdout.
    #[track_caller]
    pub fn fails(&self, code: i32, message: &str) {
        assert_eq!(self.stderr, format!("ohmstrain: {message}\n"), "{}", self.command);
        assert_eq!(self.code, Some(code), "{}", self.command);
        self.printed_whole_rows();
    }

    /// Asserts that stdout is empty, or that all its lines are complete and have as many cells as the first one.
    #[track_caller]
    pub fn printed_whole_rows(&self) {
        let cells = |line: &str| line.split(',').count();
        assert!(self.stdout.is_empty() || self.stdout.ends_with('\n'), "{}: {}", self.command, self.stdout);
        let mut widths = self.stdout.lines().map(cells);
        let first = widths.next();
        assert!(widths.all(|width| Some(width) == first), "{}: {}", self.command, self.stdout);
    }
}

/// A parsed CSV file; metadata lines are skipped.
pub struct Csv {
    /// The header.
    pub header: String,
    rows: Vec<Vec<String>>,
}

impl Csv {
    /// Parses a file. No cell of this program's output contains a quotation mark.
    #[track_caller]
    pub fn new(text: &str) -> Self {
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let header = lines.next().unwrap().to_owned();
        let rows: Vec<Vec<String>> = lines.map(|line| line.split(',').map(str::to_owned).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == header.split(',').count()));
        Self { header, rows }
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns the cells of a column.
    #[track_caller]
    pub fn cells(&self, column: &str) -> Vec<&str> {
        let index = self.header.split(',').position(|name| name == column);
        let index = index.unwrap_or_else(|| panic!("no column {column} in {}", self.header));
        self.rows.iter().map(|row| row[index].as_str()).collect()
    }

    /// Returns the numbers of a column.
    #[track_caller]
    pub fn numbers(&self, column: &str) -> Vec<f64> {
        self.cells(column).iter().map(|cell| cell.parse().unwrap()).collect()
    }
}

/// Asserts that a page is self-contained: nothing in it makes a browser load anything.
#[track_caller]
pub fn assert_one_whole_page(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    assert!(page.matches("<svg").count() >= 5);
    // The name of a namespace, which is not loaded, and targets within the page.
    let page = page.replace("http://www.w3.org/2000/svg", "").replace("url(#", "");
    for reference in ["http:", "https:", "src=", "href=\"/", "url(", "@import", "<script ", "<link", "<iframe"] {
        assert!(!page.contains(reference), "{reference}");
    }
    assert_eq!(page.matches("<script>").count(), 1, "the page's own script, and no other");
}

/// Returns the first rows of a recording, with its header and what is above that.
pub fn first_rows(trace: &str, rows: usize) -> String {
    let above = trace.lines().position(|line| line.starts_with(|first: char| first.is_ascii_digit())).unwrap();
    trace.lines().take(above + rows).map(|line| format!("{line}\n")).collect()
}

/// Returns a recording with some rows changed: `change` receives a row's index, from 0, and its cells.
pub fn change_rows(trace: &str, mut change: impl FnMut(usize, &mut Vec<String>)) -> String {
    let mut rows = 0;
    let mut changed = String::new();
    for line in trace.lines() {
        let is_row = line.starts_with(|first: char| first.is_ascii_digit());
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if is_row {
            change(rows, &mut cells);
            rows += 1;
        }
        changed += &cells.join(",");
        changed.push('\n');
    }
    changed
}
