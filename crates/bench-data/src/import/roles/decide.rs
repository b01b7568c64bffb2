use std::collections::BTreeSet;

use crate::error::Fault;
use crate::import::error::{ImportError, quoted};
use crate::import::roles::clock::{clock, no_readings};
use crate::import::roles::decision::{Channel, Decision, FileColumn, Taken, Timed};
use crate::import::roles::facts::Found;
use crate::import::roles::find::{choose, find, refer};
use crate::import::roles::recipe::Recipe;
use crate::import::roles::unit::{channel, is_stretch_ratio};
use crate::import::table::{SEPARATOR, Table, all_files};
use crate::import::words::units::scale_of_a_reference;
use crate::import::words::{Role, names};

/// Decides by names, units and numbers how files are imported, where the answers leave it open. The same findings and answers lead to the
/// same decision.
pub(crate) fn decide(found: &Found, answers: &Recipe) -> Decision {
    let mut remarks = Vec::new();
    let mut questions: Vec<ImportError> = open_decimal(found.tables).into_iter().collect();
    let readings = choose(found, answers, &Role::READINGS, "the readings", None)
        .and_then(|taken| taken.ok_or_else(|| no_readings(found)))
        .and_then(|taken| timed(found, answers, taken, Role::Time, &mut remarks));
    let readings = known(readings, &mut questions);
    let beside = readings.map(|readings| readings.values.place);
    let reference = choose(found, answers, &Role::REFERENCES, "the reference", beside).and_then(|taken| {
        taken.map(|taken| timed(found, answers, taken, Role::ReferenceTime, &mut remarks)).transpose()
    });
    if let (Ok(Some(reference)), Some(beside)) = (&reference, beside) {
        remarks.extend(by_its_name(found, answers, reference.values.place, beside));
    }
    if matches!(reference, Ok(None)) {
        remarks.extend(no_reference(found, answers));
    }
    let reference = known(reference, &mut questions).flatten();
    let temperature = readings.and_then(|readings| {
        let found = temperature(found, answers, readings.values.place.file, &mut remarks);
        known(found, &mut questions).flatten()
    });
    // A remark that two columns, or two roles of one, have in common is made once.
    let mut seen = BTreeSet::new();
    remarks.retain(|remark: &String| seen.insert(remark.clone()));
    let readings = readings.into_iter().collect();
    let mut decision = Decision { readings, reference, temperature, remarks, questions };
    let missing = missing_answers(found, answers, &decision);
    decision.questions.extend(missing);
    decision
}

/// Returns the decision; an open question is added to the questions, once.
fn known<T>(decided: Result<T, ImportError>, questions: &mut Vec<ImportError>) -> Option<T> {
    let question = match decided {
        Ok(known) => return Some(known),
        Err(question) => question,
    };
    if !questions.contains(&question) {
        questions.push(question);
    }
    None
}

/// Returns a column of values with the clock of its rows, which may be another column for the reference.
fn timed(
    found: &Found,
    answers: &Recipe,
    taken: Taken,
    time: Role,
    remarks: &mut Vec<String>,
) -> Result<Timed, ImportError> {
    let clock = clock(found, answers, time, taken.place, remarks)?;
    Ok(Timed { values: channel(found, answers, taken, remarks)?, clock })
}

/// Returns questions about further information that the chosen columns need.
fn missing_answers(found: &Found, answers: &Recipe, decision: &Decision) -> Vec<ImportError> {
    let mut questions: Vec<ImportError> =
        decision.channels().iter().filter_map(|channel| incomplete_records(found, channel.place)).collect();
    if let (Some(reference), Some(readings)) = (&decision.reference, decision.readings.first())
        && reference.clock.file() != readings.clock.file()
        && answers.align.is_none()
    {
        let align = ["motion", "none", "SECONDS"].map(|align| format!("--align {align}"));
        questions.push(ImportError::question(&all_files(found.tables), "two files with two clocks", align));
    }
    if is_stretch_without_zero(found, answers, decision) {
        let reference = decision.reference.map(|reference| reference.values.place);
        let (file, name) =
            reference.map_or_else(Default::default, |place| (found.table(place).file.clone(), found.name(place)));
        let what = format!("column {name} is a stretch ratio, which is 1 where strain is 0");
        questions.push(ImportError::question(&file, what, ["--zero strain=1".to_owned()]));
    }
    for channel in decision.reference.iter().chain(&decision.readings).map(|timed| timed.values) {
        let table = found.table(channel.place);
        match channel.role {
            Role::Displacement if answers.gauge_length_mm.or(table.metadata.gauge_length_mm).is_none() => {
                let what = "a displacement becomes strain by the length of the unstretched sensor";
                questions.push(ImportError::question(&table.file, what, ["--gauge-length-mm MM".to_owned()]));
            }
            Role::Adc if answers.front_end.or(table.metadata.front_end).is_none() => {
                let spec = quoted("divider reference_ohm=10000 side=low bits=12 noise_codes=0.5");
                let answer = format!("--front-end {spec} (or what is there)");
                let what = "converter codes become ohms by the electronics";
                questions.push(ImportError::question(&table.file, what, [answer]));
            }
            _ => {}
        }
    }
    questions
}

/// True if the reference is a stretch ratio, and its value at rest is unknown.
pub(crate) fn is_stretch_without_zero(found: &Found, answers: &Recipe, decision: &Decision) -> bool {
    let is_stretch = |channel: &Channel| {
        channel.role == Role::Strain
            && channel.unit.name == "1"
            && is_stretch_ratio(found.column(channel.place), found.facts(channel.place))
    };
    let is_answered = answers.zero.iter().any(|(role, _)| *role == Role::Strain);
    !is_answered && decision.reference.iter().any(|reference| is_stretch(&reference.values))
}

/// Refuses a label that is missing in half of the records or more: the structure of its file has not been understood.
fn incomplete_records(found: &Found, place: FileColumn) -> Option<ImportError> {
    let table = found.table(place);
    let is_record = table.layout.separator == Some(SEPARATOR);
    let (missing, first) =
        is_record.then(|| found.facts(place).empty).filter(|(missing, _)| missing * 2 >= table.len())?;
    let name = found.name(place);
    let expected = format!("{name} in every record, which ends where one of its labels comes again");
    let what = format!("none in {missing} of {}: print all values of a moment together", table.len());
    Some(ImportError::content(&table.file, first, Fault::new(expected, what)))
}

/// Returns a remark if one of several references is chosen because it shares the readings' name.
fn by_its_name(found: &Found, answers: &Recipe, reference: FileColumn, readings: FileColumn) -> Option<String> {
    let is_answered = Role::REFERENCES.iter().any(|role| answers.column(*role).is_some());
    let references = found.candidates.iter().filter(|one| one.is_named && Role::REFERENCES.contains(&one.role)).count();
    let (file, name, beside) = (&found.table(reference).file, found.name(reference), found.name(readings));
    let remark = format!("{file}: {name} is taken for the reference of {beside}, whose name it shares");
    (references > 1 && !is_answered).then_some(remark)
}

/// Returns a remark if no column is the reference and the user has not stated that there is none.
fn no_reference(found: &Found, answers: &Recipe) -> Option<String> {
    if Role::REFERENCES.iter().any(|role| answers.column(*role).is_some()) {
        return None;
    }
    let weak = found.candidates.iter().find(|one| Role::REFERENCES.contains(&one.role));
    let weak = weak.map(|one| (Taken { role: one.role, place: one.place() }, None));
    let answer = match weak.or_else(|| in_another_unit(found)) {
        None => "strain=NAME".to_owned(),
        Some((Taken { role, place }, scale)) => {
            let scale = scale.map_or_else(String::new, |scale| format!(" --unit {role}={scale} with its scale"));
            quoted(&format!("{role}={}", refer(found.tables, place))) + &scale
        }
    };
    let files = all_files(found.tables);
    Some(format!(
        "{files}: no column is taken for strain, displacement or angle, without which nothing can be calibrated; if one is, \
         say --column {answer}"
    ))
}

/// Returns a column with the name of a reference but the unit of another quantity: `Position (V)`.
fn in_another_unit(found: &Found) -> Option<(Taken, Option<&'static str>)> {
    found.places().find_map(|place| {
        let column = found.column(place);
        let (role, _) = names::role(&column.name, None).filter(|_| column.unit.is_some())?;
        scale_of_a_reference(role).map(|scale| (Taken { role, place }, Some(scale)))
    })
}

/// Returns the question whether the decimal mark is a point or a comma.
fn open_decimal(tables: &[Table]) -> Option<ImportError> {
    let (index, table) = tables.iter().enumerate().find(|(_, table)| table.layout.decimal_is_open)?;
    let file = if tables.len() > 1 { format!("{}:", index + 1) } else { String::new() };
    let what = "commas may be decimal marks or group thousands";
    Some(ImportError::question(&table.file, what, [",", "."].map(|mark| format!("--decimal {file}{mark}"))))
}

/// Returns the channel of the temperature, if it is in the readings' file.
fn temperature(
    found: &Found,
    answers: &Recipe,
    file: usize,
    remarks: &mut Vec<String>,
) -> Result<Option<Channel>, ImportError> {
    let role = Role::Temperature;
    let place = match answers.column(role) {
        Some(None) => None,
        Some(Some(wanted)) => Some(find(found, role, wanted)?),
        None => {
            let mut named = found.candidates.iter().filter(|one| one.role == role && one.table == file && one.is_named);
            let only = named.next().filter(|_| named.next().is_none()).map(|one| one.place());
            only.filter(|place| found.column(*place).unit.is_some())
        }
    };
    let Some(place) = place else { return Ok(None) };
    if place.file != file {
        let what = "a temperature is taken from the file of the readings";
        return Err(ImportError::question(&found.table(place).file, what, ["--column temperature=none".to_owned()]));
    }
    channel(found, answers, Taken { role, place }, remarks).map(Some)
}
