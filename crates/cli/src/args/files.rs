use std::error::Error;
use std::path::PathBuf;

use clap::Args as ClapArgs;
use ohmstrain_bench_data::import::{Align, ColumnName, DecimalMark, PerFile, Preset, Recipe, Role, RowFilter};

use super::{ReplaceArgs, SetupArgs, positive};

/// Flags of `inspect`.
#[derive(Debug, ClapArgs)]
pub struct InspectArgs {
    /// Files of one recording: text, JSON, XLSX, Parquet, NumPy, each perhaps in gzip or zip; - for stdin
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Print the command that imports them, and nothing else
    #[arg(long, conflicts_with = "json")]
    pub suggest: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Known properties of the files
    #[command(flatten)]
    pub known: FilesArgs,
}

/// Flags of `import`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "`ohmstrain inspect FILE…` prints the command for a file.")]
pub struct ImportArgs {
    /// Files of one recording: text, JSON, XLSX, Parquet, NumPy, each perhaps in gzip or zip; - for stdin
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// File to write instead of stdout
    #[arg(short, long, value_name = "trace.csv")]
    pub output: Option<PathBuf>,
    /// Write each recording of a file with several to a file of its own, trace-1.csv, trace-2.csv, …: where the clock begins
    /// anew, or a column `trial`, `run` or so has another value
    #[arg(long, requires = "output", conflicts_with = "recording")]
    pub split_recordings: bool,
    /// Write every channel, with its reference, as columns of one recording: thumb_ohm, index_ohm, thumb_angle_deg, …, which
    /// `calibrate -o hand.toml` takes. --column resistance=… for each, if not all that look like readings are meant
    #[arg(long)]
    pub each: bool,
    /// A channel and its reference, where their names do not tell: 'R1=theta1'
    #[arg(long = "pair", value_name = "COLUMN=COLUMN", value_parser = pair, requires = "each")]
    pub pairs: Vec<(ColumnName, ColumnName)>,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Known properties of the files
    #[command(flatten)]
    pub known: FilesArgs,
}

/// Known properties of a lab's files.
#[derive(Debug, ClapArgs)]
pub struct FilesArgs {
    /// Role of a column, by name or number: time='Time (s)', resistance=3, displacement=2:Position in the second file,
    /// angle=none. Roles: time, reference-time, resistance, ratio, adc, strain, displacement, angle, temperature
    #[arg(long = "column", value_name = "ROLE=COLUMN", value_parser = column)]
    pub columns: Vec<(Role, ColumnName)>,
    /// The unit of a column: time=ms, resistance=kohm (or uS), strain=percent, displacement=inch; of a reference in volts or counts
    /// its scale: displacement=4mm/V, angle=0.9deg/step
    #[arg(long = "unit", value_name = "ROLE=UNIT", value_parser = unit)]
    pub units: Vec<(Role, String)>,
    /// Decimal mark: . or , (2:, for the second file alone)
    #[arg(long, value_name = "[FILE:]MARK")]
    pub decimal: Vec<PerFile<DecimalMark>>,
    /// Pass over the first N lines
    #[arg(long, value_name = "[FILE:]N")]
    pub skip: Vec<PerFile<usize>>,
    /// The sheet of a workbook, or the file in a zip archive
    #[arg(long, value_name = "NAME")]
    pub sheet: Option<String>,
    /// The rows in which a value stands in a column: trial=2, 'Sensor=left hand'; repeatable, rows pass all (2:trial=1 in
    /// the second file alone)
    #[arg(long = "where", value_name = "[FILE:]COLUMN=VALUE")]
    pub rows: Vec<PerFile<RowFilter>>,
    /// Recording of a file with several, counted from 1: a new one begins where the clock restarts, or a column
    /// `trial`, `run` or so has another value
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub recording: Option<u32>,
    /// A text that stands for a missing value, besides the usual ones (OVLD, NaN, N/A, …)
    #[arg(long, value_name = "TEXT", allow_hyphen_values = true)]
    pub missing: Vec<String>,
    /// A role whose sign is arbitrary: its values without their sign
    #[arg(long, value_name = "ROLE")]
    pub magnitude: Vec<Role>,
    /// A role in which a lone 0 between larger values is a missing one
    #[arg(long, value_name = "ROLE")]
    pub drop_zeros: Vec<Role>,
    /// Value of a reference at rest, in the unit of its column: displacement=0.52
    #[arg(long, value_name = "ROLE=VALUE", value_parser = zero)]
    pub zero: Vec<(Role, f64)>,
    /// The current's polarity flips with every reading: take means of neighbours
    #[arg(long)]
    pub fold_polarity: bool,
    /// Clocks of readings and reference: motion (find the offset by what both show), none (one clock), or the seconds
    /// to add to the reference's
    #[arg(long, value_name = "motion|none|S", allow_hyphen_values = true)]
    pub align: Option<Align>,
    /// Rows per second, where no column is a time
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = positive)]
    pub rate_hz: Option<f64>,
    /// Setup of the measurement
    #[command(flatten)]
    pub setup: SetupArgs,
    /// A known layout: electromech-stretcher (no header; Ro, Ri, tR, P, tP, F, tF)
    #[arg(long, value_name = "NAME")]
    pub preset: Option<Preset>,
}

impl FilesArgs {
    /// Converts the flags to the library's recipe.
    pub fn recipe(&self) -> Recipe {
        Recipe {
            preset: self.preset,
            columns: self.columns.clone(),
            units: self.units.clone(),
            decimal: self.decimal.clone(),
            skip: self.skip.clone(),
            sheet: self.sheet.clone(),
            rows: self.rows.clone(),
            recording: self.recording.map(|number| number as usize),
            missing: self.missing.clone(),
            magnitude: self.magnitude.clone(),
            drop_zeros: self.drop_zeros.clone(),
            zero: self.zero.clone(),
            fold_polarity: self.fold_polarity,
            align: self.align,
            rate_hz: self.rate_hz,
            gauge_length_mm: self.setup.gauge_length_mm,
            front_end: self.setup.front_end,
            joint: self.setup.joint,
        }
    }
}

fn pair(text: &str) -> Result<(ColumnName, ColumnName), Box<dyn Error + Send + Sync>> {
    let (reading, reference) = text.split_once('=').ok_or("expected COLUMN=COLUMN, the readings before the =")?;
    Ok((reading.parse()?, reference.parse()?))
}

fn column(text: &str) -> Result<(Role, ColumnName), Box<dyn Error + Send + Sync>> {
    let (role, column) = text.split_once('=').ok_or("expected ROLE=COLUMN")?;
    Ok((role.parse()?, column.parse()?))
}

fn unit(text: &str) -> Result<(Role, String), String> {
    let (role, unit) = text.split_once('=').ok_or("expected ROLE=UNIT")?;
    Ok((role.parse()?, unit.to_owned()))
}

fn zero(text: &str) -> Result<(Role, f64), String> {
    let (role, zero) = text.split_once('=').ok_or("expected ROLE=VALUE")?;
    let zero = zero.parse().ok().filter(|zero: &f64| zero.is_finite()).ok_or("expected a number behind the =")?;
    match role.parse()? {
        role @ (Role::Strain | Role::Displacement | Role::Angle) => Ok((role, zero)),
        _ => Err("expected strain, displacement or angle before the =".into()),
    }
}
