//! Kinds of outputs, and the test for files that this program wrote: by the names of all columns, or by a line that names the
//! program in its usual place. A word or two of either prove nothing.

use ohmstrain::Column;

use ohmstrain_report::{PAGE, Sample};

/// Kind of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A simulated recording.
    Simulation,
    /// A recording imported from a lab's files.
    Import,
    /// A sensor's parameters.
    Sensor,
    /// The description of a hand.
    Hand,
    /// Fusion of the channels of one joint.
    Fusion,
    /// A protocol for a person.
    Protocol,
    /// Prior of a fleet.
    Prior,
    /// State of a running filter.
    State,
    /// Estimates of a recording.
    Estimates,
    /// A row for each recording of a batch.
    Summary,
    /// A report.
    Report,
    /// A plot, or its data.
    Figure,
    /// Exported source code and its description.
    Source,
    /// A page of the manual.
    Manual,
}

impl Kind {
    /// Returns its name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simulation => "a simulated recording",
            Self::Import => "an imported recording",
            Self::Sensor => "a sensor file",
            Self::Hand => "the description of a hand",
            Self::Fusion => "a fusion",
            Self::Protocol => "a protocol",
            Self::Prior => "a prior",
            Self::State => "the state of a filter",
            Self::Estimates => "estimates",
            Self::Summary => "a summary",
            Self::Report => "a report",
            Self::Figure => "a figure",
            Self::Source => "an export",
            Self::Manual => "a page of the manual",
        }
    }

    /// True if a text with this beginning is of this kind and was written by this program. `own` are the columns of the table
    /// that will replace it.
    pub fn wrote(self, head: &str, own: &[String]) -> bool {
        let first = head.lines().next().unwrap_or_default();
        let third_is = |start: &str| third_of_toml(head).is_some_and(|third| third.starts_with(start));
        match self {
            // Only recordings that can be made again are marked: simulations, and imports of files that still exist. Recordings
            // by `live` are not.
            Self::Simulation => is_made_by(head, SIMULATE),
            Self::Import => is_made_by(head, IMPORT) || is_made_by(head, SIMULATE),
            Self::Sensor => {
                let mut others = ["sensors = ", "sensor = "].into_iter().chain(FUSION);
                third_is("") && !is_hand(head) && !others.any(third_is)
            }
            Self::Hand => is_hand(head),
            Self::Fusion => FUSION.into_iter().any(third_is),
            Self::Protocol => third_is("") && head.contains("\n[[positions]]\n"),
            Self::Prior => third_is("sensors = "),
            Self::State => third_is("sensor = "),
            Self::Estimates | Self::Summary => {
                self.has_columns(&first.split(',').map(str::to_owned).collect::<Vec<_>>(), own)
            }
            Self::Report => behind_mark(head, page_start()).is_some_and(|rest| rest.starts_with("\">")),
            Self::Figure => is_figure(head),
            Self::Source => SOURCES.iter().any(|source| source.is_start_of(head)),
            Self::Manual => behind_mark(first, MANUAL) == Some(""),
        }
    }

    /// True if a table with these columns is of this kind: it has all columns of a sensor's estimates, or exactly `own`, of
    /// which at least one cannot be in a recording.
    pub fn has_columns(self, names: &[String], own: &[String]) -> bool {
        let is_own = names == own && names.iter().any(|name| !is_recorded(name));
        match self {
            Self::Estimates => is_own || Column::are_all(names.iter().map(String::as_str)),
            Self::Summary => is_own,
            _ => false,
        }
    }
}

/// Returns the third line of a TOML file whose first two are a format and this program's name.
fn third_of_toml(head: &str) -> Option<&str> {
    let mut lines = head.lines();
    let is_own = is_format(lines.next()?) && is_made_by_toml(lines.next()?);
    is_own.then(|| lines.next().unwrap_or_default())
}

/// True if this is the description of a hand that this program wrote.
fn is_hand(head: &str) -> bool {
    let lines: Vec<&str> = head.lines().take(4).collect();
    matches!(lines[..], [format, made_by, "", "[[joints]]"] if is_format(format) && is_made_by_toml(made_by))
}

/// Third line of a fusion, of format 2 and of format 1.
const FUSION: [&str; 2] = ["novelty = ", "sd_scale = "];

/// True if recordings may have a column of this name, too.
fn is_recorded(name: &str) -> bool {
    ["time_s", "resistance_ohm", "resistance_ratio", "strain", "angle_deg"].contains(&name)
}

/// True if a header is that of `hand`: for each joint an angle or a strain, and its deviation.
pub fn is_of_a_hand(header: &str) -> bool {
    let joints = header.strip_prefix("time_s,").and_then(|rest| rest.strip_suffix(",flags"));
    joints.is_some_and(|joints| {
        let names: Vec<&str> = joints.split(',').collect();
        let is_joint = |pair: &[&str]| match pair {
            [value, sd] => [("_deg", "_sd_deg"), ("_strain", "_strain_sd")].iter().any(|(ending, of_sd)| {
                value.strip_suffix(ending).is_some_and(|joint| sd.strip_suffix(of_sd) == Some(joint))
            }),
            _ => false,
        };
        names.chunks(2).all(is_joint)
    })
}

/// Name, in a recording, of the command that simulated it.
pub const SIMULATE: &str = "simulate";
/// Name, in a recording, of the command that imported it.
pub const IMPORT: &str = "import";

/// Beginning of a page of the manual.
pub const MANUAL: &str = ".\\\" Generated by ";

/// True if the metadata name this program's `command` as the maker of the recording.
fn is_made_by(head: &str, command: &str) -> bool {
    let by = |line: &str| behind_mark(line, "# made_by = ").and_then(|rest| rest.strip_prefix(' ')) == Some(command);
    head.lines().take_while(|line| line.starts_with('#')).any(by)
}

fn is_format(line: &str) -> bool {
    line.strip_prefix("format = ").is_some_and(|number| number.parse::<u32>().is_ok())
}

fn is_made_by_toml(line: &str) -> bool {
    behind_mark(line, "made_by = \"") == Some("\"")
}

/// Returns the beginning of a report.
fn page_start() -> &'static str {
    PAGE.split("{{ made_by }}").next().unwrap_or_default()
}

/// True if this is an SVG, or the data of one.
fn is_figure(head: &str) -> bool {
    let first = head.lines().next().unwrap_or_default();
    let rest_behind = |before| behind_mark(first, before).map(without_sample);
    rest_behind("<!-- Generated by ") == Some(" -->") || rest_behind("# Generated by ") == Some("")
}

/// Returns the rest after a figure's note on its rows.
fn without_sample(rest: &str) -> &str {
    let named = rest.strip_prefix(", ").unwrap_or(rest);
    [Sample::In, Sample::Partly].iter().find_map(|sample| named.strip_prefix(sample.name())).unwrap_or(rest)
}

/// Mark of an exported file: its beginning, and within a few lines the program's name between two texts.
struct Source {
    start: &'static str,
    before: &'static str,
    after: &'static str,
}

const fn source(start: &'static str, before: &'static str, after: &'static str) -> Source {
    Source { start, before, after }
}

const SOURCES: [Source; 14] = [
    source("/* ", " * Generated by ", "; do not edit."),
    source("/* ", " * Generated by ", ". The sensor and a resistor in series form a divider"),
    source("# Part of a Zephyr module. ", "# Part of a Zephyr module. Generated by ", "."),
    source("//! One soft strain sensor", "//! Generated by ", "; do not edit."),
    source("// Prints a trace", "// Generated by ", ". The sensor and a resistor in series form a divider"),
    source("// Prints strain:", "// Generated by ", ". The sensor and a resistor in series form a divider"),
    source("# The filter as a library", CMAKE, "; do not edit."),
    source("{\n  \"name\": ", LIBRARY, "\","),
    source("name=", "paragraph=Generated by ", ". "),
    source("// Prints value,", "// Generated by ", ". Each sensor and a resistor in series form a divider"),
    source("{\n  \"name\": ", HAND_LIBRARY, "\","),
    source("# All joints of a hand in C\n\n", "Generated by ", ": "),
    source("# One soft strain sensor in C\n\n", "Generated by ", ": the "),
    source("# One soft strain sensor in Rust\n\n", "Generated by ", ": `sensor.rs` holds "),
];
const CMAKE: &str = "# The filter as a library, its self-test and a program that replays recordings. Generated by ";
const LIBRARY: &str = " of one calibrated soft strain sensor, with an error bar. Generated by ";
const HAND_LIBRARY: &str = "All joints of a hand from calibrated soft strain sensors, with error bars. Generated by ";
/// Number of first lines that may contain the program's name.
const SOURCE_LINES: usize = 8;

impl Source {
    fn is_start_of(&self, head: &str) -> bool {
        let marked = |line: &str| {
            // A library's name is not at the beginning of its description's line.
            let is_library = [LIBRARY, HAND_LIBRARY].contains(&self.before);
            let from = if is_library { line.find(self.before).unwrap_or(0) } else { 0 };
            behind_mark(&line[from..], self.before).is_some_and(|rest| rest.starts_with(self.after))
        };
        head.starts_with(self.start) && head.lines().take(SOURCE_LINES).any(marked)
    }
}

/// True if a text is the name of this program with a version.
pub fn is_this_program(text: &str) -> bool {
    behind_mark(text, "") == Some("")
}

/// Returns the rest after `before` and the name of this program with a version; `None` if the text does not begin with these.
fn behind_mark<'a>(text: &'a str, before: &str) -> Option<&'a str> {
    let version = text.strip_prefix(before)?.strip_prefix("ohmstrain ")?;
    let end = version.find(|c: char| !(c.is_ascii_alphanumeric() || ".-+".contains(c))).unwrap_or(version.len());
    let number = version[..end].trim_end_matches('.');
    let is_version = number.starts_with(|c: char| c.is_ascii_digit()) && number.split('.').count() >= 3;
    is_version.then(|| &version[number.len()..])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests users' files that look most like this program's.
    #[test]
    fn what_others_wrote_is_not_ours() {
        let cases = [
            (Kind::Simulation, "# material = silicone\ntime_s,resistance_ohm\n0,1\n"),
            (Kind::Simulation, "time_s,resistance_ohm\n# made_by = ohmstrain 0.1.0 simulate\n"),
            (Kind::Simulation, "# made_by = ohmstrain 0.1.0 live\ntime_s,resistance_ohm\n"),
            (Kind::Simulation, "# made_by = ohmstrain 0.1.0 import\ntime_s,resistance_ohm\n"),
            (Kind::Simulation, "# made_by = ohmstrain 0.1.0 simulate and my notes\ntime_s,resistance_ohm\n"),
            (Kind::Simulation, "# made_by = ohmstrain users simulate\ntime_s,resistance_ohm\n"),
            (Kind::Import, "# made_by = ohmstrain 0.1.0 live\ntime_s,resistance_ohm\n"),
            (Kind::Sensor, "format = 4\nmade_by = \"somebody\"\nquantity = \"strain\"\n"),
            (Kind::Sensor, "format = 4\nmade_by = \"ohmstrain and I\"\nquantity = \"strain\"\n"),
            (Kind::Sensor, "format = 4\nmade_by = \"ohmstrain 0.1.0\"\nsensors = 3\n"),
            (Kind::Prior, "format = 4\nmade_by = \"ohmstrain 0.1.0\"\nquantity = \"strain\"\n"),
            (Kind::Sensor, "[package]\nname = \"ohmstrain\"\n"),
            (Kind::Estimates, "time_s,resistance_ohm,strain\n"),
            (Kind::Estimates, "time_s,resistance_ohm,strain_pct\n"),
            (Kind::Estimates, "time_s,resistance_ohm,p_kpa\n"),
            (Kind::Estimates, "time_s,resistance_ohm,strain,strain_rate,baseline,flags\n"),
            (Kind::Estimates, "time_s,resistance_ohm,angle_rate_ref\n"),
            (Kind::Estimates, "time_s,resistance_ohm,strain,strain_sd\n"),
            (Kind::Estimates, "time_s,index_deg,index_sd_deg,flags\n"),
            (Kind::Summary, "file,state,message\n"),
            (Kind::Report, "<!DOCTYPE html>\n<html>ohmstrain</html>"),
            (Kind::Report, "<html>\n<meta name=\"generator\" content=\"ohmstrain 0.1.0\">\n"),
            (Kind::Figure, "# Generated by ohmstrain 0.1.0 and mended by me\n"),
            (Kind::Figure, "%PDF-1.7\n1 0 obj\n<<\n/Title (Generated by ohmstrain 0.1.0)\n"),
            (Kind::Figure, "<svg><!-- Generated by ohmstrain 0.1.0 --></svg>"),
            (Kind::Source, "# ohmstrain\n\nMy notes on sensors.\n"),
            (Kind::Source, "# My glove\n\nGenerated by ohmstrain 0.1.0: the filter in src.\n"),
            (Kind::Source, "/* My firmware\n * Its filter was Generated by ohmstrain 0.1.0; do not edit. */\n"),
            (Kind::Manual, ".TH ohmstrain 1\n"),
        ];
        for (kind, head) in cases {
            assert!(!kind.wrote(head, &[]), "{kind:?}: {head}");
        }
    }

    #[test]
    fn estimates_are_known_by_all_their_columns() {
        let sensor = ohmstrain::Sensor::from_toml(include_str!("../../tests/fixtures/sensor.toml")).unwrap();
        let names: Vec<String> = sensor.columns().iter().map(|column| column.name().to_owned()).collect();
        let wrote = |head: &str, own: &[String]| Kind::Estimates.wrote(head, own);
        assert!(wrote(&names.join(","), &[]) && !wrote(&names[1..].join(","), &[]));
        // A table with fewer columns is only recognised by this run's own columns.
        let own = ["time_s", "strain", "strain_sd"].map(str::to_owned);
        assert!(wrote("time_s,strain,strain_sd\n0,0.1,0.01", &own) && !wrote("time_s,strain_sd,strain\n", &own));
        assert!(!wrote("time_s,strain\n", &own[..2]));
        assert!(is_of_a_hand("time_s,index_deg,index_sd_deg,thumb_deg,thumb_sd_deg,flags"));
        assert!(!is_of_a_hand("time_s,index_deg,thumb_deg,flags") && !is_of_a_hand("time_s,strain,comment,flags"));
    }
}
