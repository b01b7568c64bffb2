use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

use clap::Parser;
use csv::{Reader, StringRecord};
use ohmstrain_sensor::EstimatorKind;

use super::journal::{JOURNAL, Journal};
use super::summary::SUMMARY;
use crate::args::{Args, BatchArgs, BatchCommand, Command, Estimators, Format, name_of};
use crate::commands::hand::description;
use crate::commands::hand::joints;
use crate::error::CliError;
use crate::renamed;
use crate::sensor_file;
use crate::whole_file;

/// Recordings that are processed together, and their output.
#[derive(Clone, Debug, Default)]
pub struct Job {
    /// One file, or all files that one sensor is calibrated on.
    pub files: Vec<PathBuf>,
    /// File of the sensor's parameters, if the command takes one.
    pub sensor: Option<PathBuf>,
    /// True if the flags name that file.
    has_sensor_flag: bool,
    /// File that `--prior` among the flags names.
    pub prior: Option<PathBuf>,
    /// Files of marks, one for each recording.
    pub marks: Vec<PathBuf>,
    /// Report and folder of figures.
    pub beside: Vec<PathBuf>,
    /// Estimator that `--estimator` among the flags names.
    estimator: Option<EstimatorKind>,
    /// Further flags.
    pub flags: Vec<String>,
    /// Path of the output below the folder of outputs.
    pub output: PathBuf,
}

impl Job {
    /// Returns the size of its recordings in bytes; a file that cannot be read counts as empty.
    pub fn bytes(&self) -> u64 {
        self.files.iter().filter_map(|file| fs::metadata(file).ok()).map(|found| found.len()).sum()
    }

    /// Returns the files that it reads.
    pub fn inputs(&self) -> impl Iterator<Item = &PathBuf> {
        self.files.iter().chain(&self.sensor).chain(&self.prior).chain(&self.marks)
    }

    /// True if its report and figures are there, or it has none.
    pub fn has_reports(&self) -> bool {
        self.beside.iter().all(|path| path.exists())
    }

    /// Returns its name in messages.
    pub fn name(&self) -> String {
        self.files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ")
    }

    /// Parses the command line of this job as a person would type it, without the output.
    pub fn parsed(&self, args: &BatchArgs) -> Result<Args, clap::Error> {
        let mut words = vec!["ohmstrain".to_owned(), name_of(args.command)];
        if args.command == BatchCommand::Calibrate {
            words.extend(["-o".to_owned(), "sensor.toml".to_owned()]);
        }
        words.extend(self.flags.iter().cloned());
        let sensor = self.sensor.as_ref().filter(|_| !self.has_sensor_flag && args.command != BatchCommand::Hand);
        if let Some(sensor) = sensor {
            words.extend(["--sensor".into(), sensor.display().to_string()]);
        }
        match args.command {
            BatchCommand::Filter | BatchCommand::Smooth => {
                words.extend(["--format".to_owned(), name_of(args.format)]);
            }
            BatchCommand::Evaluate | BatchCommand::Calibrate => words.push("--json".to_owned()),
            BatchCommand::Hand => {}
        }
        words.push("--".to_owned());
        words.extend(
            self.sensor.iter().filter(|_| args.command == BatchCommand::Hand).map(|hand| hand.display().to_string()),
        );
        words.extend(self.files.iter().map(|file| file.display().to_string()));
        Args::try_parse_from(words)
    }
}

/// Returns all jobs, each with a valid command line.
pub fn jobs(args: &BatchArgs) -> Result<Vec<Job>, CliError> {
    let sensor = args.sensor.clone().filter(|_| args.command != BatchCommand::Calibrate);
    let plain =
        |file: PathBuf| Job { files: vec![file], sensor: sensor.clone(), flags: args.flags.clone(), ..Job::default() };
    if let Some(folder) = args.files.iter().find(|file| file.is_dir()) {
        let folder = folder.components().as_path().display();
        return Err(CliError::Arguments(format!(
            "{folder} is a folder: --glob '{folder}/**/*.csv' takes the recordings in it"
        )));
    }
    let mut jobs: Vec<Job> = args.files.iter().cloned().map(plain).collect();
    for pattern in &args.glob {
        jobs.extend(matching(pattern)?.into_iter().map(plain));
    }
    if let Some(manifest) = &args.manifest {
        jobs.extend(listed(manifest, args, &plain)?);
    }
    name_outputs(&mut jobs, args);
    for job in &mut jobs {
        check_arguments(job, args)?;
    }
    Ok(jobs)
}

fn matching(pattern: &str) -> Result<Vec<PathBuf>, CliError> {
    let paths = glob::glob(pattern).map_err(|error| CliError::Arguments(format!("--glob {pattern}: {error}")))?;
    let files: Vec<PathBuf> = paths.filter_map(Result::ok).filter(|path| path.is_file()).collect();
    if files.is_empty() {
        return Err(CliError::Arguments(format!("--glob {pattern}: expected files, found none")));
    }
    Ok(files)
}

/// Reads the rows of a manifest. For `calibrate`, rows with the same sensor are one job.
fn listed(manifest: &Path, args: &BatchArgs, plain: &dyn Fn(PathBuf) -> Job) -> Result<Vec<Job>, CliError> {
    let wrong = |error: csv::Error| CliError::Input(format!("{}: {error}", manifest.display()));
    let text = whole_file::text(manifest)?;
    let mut rows = Reader::from_reader(text.as_bytes());
    let header = rows.headers().map_err(wrong)?.clone();
    if !header.iter().any(|name| name.trim() == "file") {
        let found = header.iter().collect::<Vec<_>>().join(",");
        return Err(CliError::Input(format!(
            "{}:1: expected a header with the column `file`, found `{found}`",
            manifest.display()
        )));
    }
    let folder = manifest.parent().unwrap_or(Path::new(""));
    let (mut jobs, mut made): (Vec<Job>, HashMap<PathBuf, usize>) = (Vec::new(), HashMap::new());
    let mut all_marks: Vec<Vec<PathBuf>> = Vec::new();
    for row in rows.records() {
        let cells = row.map_err(wrong)?;
        let row = ManifestRow { place: format!("{}:{}", manifest.display(), whole_file::line(&text, &cells)), cells };
        let (job, marks) = row.job(&header, folder, args, plain)?;
        let is_shared = args.command == BatchCommand::Calibrate && !job.output.as_os_str().is_empty();
        let place = match made.get(&job.output).filter(|_| is_shared) {
            Some(first) => {
                row.check_flags(&jobs[*first], &job)?;
                jobs[*first].files.extend(job.files);
                *first
            }
            None => {
                made.insert(job.output.clone(), jobs.len());
                jobs.push(job);
                jobs.len() - 1
            }
        };
        all_marks.resize(jobs.len(), Vec::new());
        all_marks[place].extend(marks);
    }
    for (job, marks) in jobs.iter_mut().zip(all_marks) {
        job.flags.extend(marks.iter().flat_map(|marks| ["--marks".to_owned(), marks.display().to_string()]));
    }
    Ok(jobs)
}

/// A row of a manifest.
struct ManifestRow {
    /// Its file and line.
    place: String,
    cells: StringRecord,
}

impl ManifestRow {
    /// Returns its job, and its file of marks, which is not among the job's flags.
    fn job(
        &self,
        header: &StringRecord,
        folder: &Path,
        args: &BatchArgs,
        plain: &dyn Fn(PathBuf) -> Job,
    ) -> Result<(Job, Option<PathBuf>), CliError> {
        let (mut job, mut marks) = (plain(PathBuf::new()), None);
        for (name, cell) in header.iter().map(str::trim).zip(self.cells.iter().map(str::trim)) {
            match name {
                "file" => job.files = vec![folder.join(cell)],
                _ if cell.is_empty() => {}
                "sensor" if args.command == BatchCommand::Calibrate => job.output = self.below(name, cell)?,
                "sensor" => job.sensor = Some(folder.join(cell)),
                "output" => job.output = self.below(name, cell)?,
                "report" | "figures" => {
                    let path = args.output.join(self.below(name, cell)?);
                    job.flags.extend([format!("--{name}"), path.display().to_string()]);
                }
                "marks" => marks = Some(folder.join(cell)),
                "prior" => job.flags.extend(["--prior".to_owned(), folder.join(cell).display().to_string()]),
                _ => {
                    job.flags.push(format!("--{}", name.replace('_', "-")));
                    job.flags.extend((cell != "true").then(|| cell.to_owned()));
                }
            }
        }
        Ok((job, marks))
    }

    /// Refuses flags that differ from those of an earlier row of the same sensor.
    fn check_flags(&self, first: &Job, job: &Job) -> Result<(), CliError> {
        if first.flags == job.flags {
            return Ok(());
        }
        let flags =
            |of: &Job| if of.flags.is_empty() { "none".to_owned() } else { format!("`{}`", of.flags.join(" ")) };
        Err(CliError::Input(format!(
            "{}: expected the flags of the first row of its sensor, {}, found {}",
            self.place,
            flags(first),
            flags(job)
        )))
    }

    /// Returns the path of an output; fails unless it lies below the folder of outputs.
    fn below(&self, column: &str, cell: &str) -> Result<PathBuf, CliError> {
        let parts = || Path::new(cell).components().filter(|part| *part != Component::CurDir);
        if parts().next().is_some() && parts().all(|part| matches!(part, Component::Normal(_))) {
            return Ok(parts().collect());
        }
        Err(CliError::Input(format!(
            "{}: column `{column}`: expected a name below the folder of outputs (-o), found `{cell}`",
            self.place
        )))
    }
}

/// Names the outputs that have no name after the recordings' paths below their common folder.
fn name_outputs(jobs: &mut [Job], args: &BatchArgs) {
    let ending: &str = match args.command {
        BatchCommand::Filter | BatchCommand::Smooth => &name_of(args.format),
        BatchCommand::Hand => "csv",
        BatchCommand::Evaluate => "json",
        BatchCommand::Calibrate => "toml",
    };
    let folders = jobs.iter().flat_map(|job| &job.files).filter_map(|file| file.parent());
    let shared = folders.map(Path::to_path_buf).reduce(|a, b| {
        a.components().zip(b.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect::<PathBuf>()
    });
    for job in jobs {
        if job.output.as_os_str().is_empty()
            && let Some(file) = job.files.first()
        {
            let below = shared.as_ref().and_then(|shared| file.strip_prefix(shared).ok()).unwrap_or(file);
            // Components that lead out of the folder of outputs are dropped.
            job.output = below.components().filter(|part| matches!(part, Component::Normal(_))).collect();
            job.output.set_extension("");
        }
        // Not `set_extension`: a name may contain dots.
        let mut name = job.output.clone().into_os_string();
        if job.output.extension().is_none_or(|found| found != ending) {
            name.push(".");
            name.push(ending);
        }
        job.output = name.into();
    }
}

/// Checks the arguments of the command before anything is done.
fn check_arguments(job: &mut Job, args: &BatchArgs) -> Result<(), CliError> {
    if job.files.iter().any(|file| file == Path::new("-")) {
        return Err(CliError::Arguments("batch reads files; for standard input there is the command itself".into()));
    }
    if args.command == BatchCommand::Hand && job.sensor.is_none() {
        let what = "expected the hand.toml as --sensor, or in the manifest's column `sensor`";
        return Err(CliError::Arguments(format!("{}: {what}", job.name())));
    }
    if args.command == BatchCommand::Hand && args.format == Format::Parquet {
        return Err(CliError::Arguments("--format parquet is for one sensor, not for a hand.toml".into()));
    }
    let parsed = job.parsed(args).map_err(|error| {
        let text = error.to_string();
        let text = text.lines().map(str::trim).take_while(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
        let answer =
            renamed::answer(&error, &name_of(args.command)).map_or(String::new(), |answer| format!(": {answer}"));
        CliError::Arguments(format!("{}: {}{answer}", job.name(), text.trim_start_matches("error: ")))
    })?;
    let (output, sensor, beside) = match parsed.command {
        Command::Calibrate(calibrate) => {
            (job.prior, job.marks) = (calibrate.prior, calibrate.marks);
            (None, None, vec![calibrate.report.report, calibrate.report.figures])
        }
        Command::Filter(filter) => {
            job.estimator = filter.estimate.estimator.chosen();
            if filter.save_state.is_some() || filter.resume.is_some() {
                let what = "--save-state and --resume are of one stream: use `ohmstrain filter` without batch";
                return Err(CliError::Arguments(what.into()));
            }
            (filter.written.output, Some(filter.estimate.sensor), vec![])
        }
        Command::Smooth(smooth) => {
            job.estimator = smooth.estimate.estimator.chosen();
            (smooth.written.output, Some(smooth.estimate.sensor), vec![])
        }
        Command::Evaluate(evaluate) => {
            job.estimator = if let Estimators::One(kind) = evaluate.estimator { Some(kind) } else { None };
            (None, evaluate.calibration.sensor, vec![evaluate.report.report, evaluate.report.figures])
        }
        Command::Hand(hand) => (hand.output, None, vec![]),
        _ => (None, None, vec![]),
    };
    if job.sensor.is_none() {
        (job.has_sensor_flag, job.sensor) = (sensor.is_some(), sensor);
    }
    // Files that a manifest names lie in the folder of outputs; a name given after `--` would be written by each recording.
    let named = |path: &PathBuf| path.starts_with(&args.output) && !args.flags.iter().any(|flag| is_output(flag));
    if output.is_some() || !beside.iter().flatten().all(named) {
        let what = "batch names the outputs itself, or as the manifest's columns `output`, `report` and `figures` say";
        return Err(CliError::Arguments(what.into()));
    }
    job.beside = beside.into_iter().flatten().collect();
    Ok(())
}

fn is_output(flag: &str) -> bool {
    ["--report", "--figures"].contains(&flag.split('=').next().unwrap_or_default())
}

/// Refuses, once and before any work, a shared sensor file that is invalid or lacks the jobs' estimator.
pub fn check_sensor(jobs: &[Job], args: &BatchArgs) -> Result<(), CliError> {
    let shared = jobs.iter().filter_map(|job| job.sensor.as_ref().map(|sensor| (sensor, job.estimator)));
    let shared: HashSet<_> = shared.filter(|(sensor, _)| args.sensor.as_ref() == Some(*sensor)).collect();
    shared.into_iter().try_for_each(|(sensor, estimator)| {
        if args.command == BatchCommand::Hand
            || (args.command != BatchCommand::Filter && sensor_file::is_of_a_hand(sensor))
        {
            joints(&description::read(sensor)?, sensor, "").map(drop)
        } else {
            sensor_file::read(sensor, estimator).map(drop)
        }
    })
}

/// Refuses outputs that would replace each other, an input, or a file that no earlier run wrote.
pub fn check_outputs(jobs: &[Job], args: &BatchArgs, journal: &Journal) -> Result<(), CliError> {
    let inputs = jobs.iter().flat_map(Job::inputs);
    let inputs: HashSet<PathBuf> = inputs.filter_map(|file| fs::canonicalize(file).ok()).collect();
    let mut outputs = HashSet::new();
    let own = jobs.iter().map(|job| (job, args.output.join(&job.output), "output"));
    let beside = jobs.iter().flat_map(|job| job.beside.iter().map(move |path| (job, path.clone(), "report")));
    for (job, path, column) in own.chain(beside) {
        let refused =
            |why: &str| CliError::Arguments(format!("cannot write {} for {}: {why}", path.display(), job.name()));
        let name = path.strip_prefix(&args.output).unwrap_or(&path);
        if !name.components().all(|part| matches!(part, Component::Normal(_))) {
            return Err(refused("it is not in the folder of outputs"));
        }
        if !outputs.insert(path.clone()) {
            let why = format!("another output has the same name; name them in a manifest's column `{column}`");
            return Err(refused(&why));
        }
        if name == Path::new(JOURNAL) || name.with_extension("") == Path::new(SUMMARY) {
            let why =
                format!("it is the name of the summary or the journal; name it in a manifest's column `{column}`");
            return Err(refused(&why));
        }
        let Ok(found) = fs::canonicalize(&path) else { continue };
        if inputs.contains(&found) {
            return Err(refused("it is an input; choose another folder"));
        }
        // Reports and figures say themselves what wrote them.
        if column == "output" && !args.force && !journal.knows(&job.output) {
            return Err(refused(
                "no earlier run wrote what is there; choose another folder, or replace it with --force",
            ));
        }
    }
    Ok(())
}
