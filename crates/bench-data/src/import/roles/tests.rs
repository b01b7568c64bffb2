//! A table of findings, answers and decisions.

use std::cell::OnceCell;

use crate::import::bytes::Cells;
use crate::import::roles::facts::{Dates, Facts, Numbers, among};
use crate::import::roles::{Channel, Clock, Decision, Found, Recipe, decide};
use crate::import::table::{Column, Table};
use crate::import::words::names;
use crate::import::words::stamp::Order;

/// Columns with their findings; an answer; the decision: role, column, unit, and the beginnings of remarks (!) and questions (?). Two bars
/// separate files.
const TABLE: &str = "
Time (s) | R (Ohm) | Strain (%) ;; time 1 s, resistance 2 ohm, strain 3 percent
Time (s) | R (kOhm) | Strain (%) ; column strain=none ; time 1 s, resistance 2 kohm
Time (s) | R (Ohm) | Strain (%) ; column resistance=Force ; strain 3 percent ? f1: --column resistance=Force: there is
Time (s) | R (Ohm) | Strain (%) ; unit strain=K ; time 1 s, resistance 2 ohm ? f1: --unit strain=K: there is no such un
Time (s) | R (Ohm) | Strain (%) | Temp (°C) ;; time 1 s, resistance 2 ohm, strain 3 percent, temperature 4 celsius
Time (s) | R (Ohm) | Strain (%) | R_1 (Ohm) ;; time 1 s, resistance 2 ohm, strain 3 percent
Time (s) | R (Ohm) | Strain (%) | Sensor B (Ohm) ;; strain 3 percent ? f1: `R (Ohm)` and `Sensor B (Ohm)` may b
Time (s) | R (Ohm) | Strain (%) | Sensor B (Ohm) ; column resistance=4 ; time 1 s, resistance 4 ohm, strain 3 percent
Time (s) | Thumb (Ohm) | Index (Ohm) | Thumb angle (deg) | Index angle (deg) ; column resistance=3 ; time 1 s, resistance 3 ohm, angle 5 deg ! f1: `Index angle (deg)` is taken for the
Time (s) | R1 (Ohm) | R2 (Ohm) | strain 1 (%) | strain 2 (%) ; column resistance=2 ; time 1 s, resistance 2 ohm, strain 4 percent ! f1: `strain 1 (%)` is taken for the refe
Time (s) | R1 (Ohm) | Left (deg) | Right angle (deg) | Left angle (deg) ;; time 1 s, resistance 2 ohm ? f1: `Right angle (deg)` and `Left angle
Time (s) | conductance (uS) | Strain (%) ;; time 1 s, resistance 2 uS, strain 3 percent
Time (s) | R (Ohm) ;; time 1 s, resistance 2 ohm ! f1: no column is taken for strain, displ
t {steps 0.05} | R {about 1600} | strain {about 0.3} ;; time 1 s, resistance 2 ohm, strain 3 1 ! f1: column `t` has no unit ! f1: column `R` has no unit ! f1: column `strain` has no unit
t {whole 50} | R (Ohm) | Strain (%) ;; ? f1: column `t` (time): its unit is not k
t {whole 50} | R (Ohm) | Strain (%) ; unit time=ms ; time 1 ms, resistance 2 ohm, strain 3 percent
Time (s) | R {cell 1.6k} | Strain (%) ;; time 1 s, resistance 2 ohm, strain 3 percent ! f1: column `R` has no unit
Time (s) | R {about 1.6} | Strain (%) ; unit resistance=kohm ; time 1 s, resistance 2 kohm, strain 3 percent
Time (s) | R/R0 {about 1.1} | strain_p {about 8} ;; time 1 s, ratio 2 1 ! f1: column `R/R0` has no unit ? f1: column `strain_p` (strain): `p` may
Time (s) | dR/R0 {about 1.1} | Strain (%) ;; strain 3 percent ? f1: column `dR/R0` (ratio): its unit is
Time {dates dmy} | R (Ohm) | Strain (%) ;; time 1 dmy, resistance 2 ohm, strain 3 percent
Time {dates open} | R (Ohm) | Strain (%) ;; ? f1: column `Time`: day and month cannot
Time {dates open} | R (Ohm) | Strain (%) ; unit time=mdy ; time 1 mdy, resistance 2 ohm, strain 3 percent
a {steps 0.1} | R (Ohm) | Strain (%) ;; ? f1: which column is the time among `a`, ? f1: which column is the time among `a`,
a {steps 0.1} | R (Ohm) | Strain (%) ; rate-hz 20 ; 20 Hz, resistance 2 ohm, strain 3 percent
Time (s) | R (Ohm) | Time (s) | Strain (%) ;; time 1 s, resistance 2 ohm, reference-time 3 s, strain 4 percent ! f1: `Time (s)` is taken for the clock of ! f1: `Time (s)` is taken for the clock of
Time (s) | R (Ohm) || Time (s) | Strain (%) ;; time 1 s, resistance 2 ohm, reference-time 2:1 s, strain 2:2 percent ? f1, f2: two files with two clocks
Time (s) | R (Ohm) || Time (s) | Strain (%) ; align motion ; time 1 s, resistance 2 ohm, reference-time 2:1 s, strain 2:2 percent
Time (s) | R (Ohm) | Position (mm) ; gauge-length-mm 30 ; time 1 s, resistance 2 ohm, displacement 3 mm
Time (s) | R (Ohm) | Position (V) ; column displacement=3 ; time 1 s, resistance 2 ohm ? f1: column `Position (V)`: the unit `V`
Time (s) | adc | Position (mm) ;; time 1 s, adc 2 1, displacement 3 mm ? f1: a displacement becomes strain by the ? f1: converter codes become ohms by the e
";

#[test]
fn findings_and_answers_decide() {
    for row in TABLE.trim().lines() {
        let [columns, answers, expected] = row.split(';').map(str::trim).collect::<Vec<_>>()[..] else {
            panic!("{row}")
        };
        let files: Vec<Vec<(Column, OnceCell<Facts>)>> =
            columns.split("||").map(|file| file.split('|').map(column).collect()).collect();
        assert_eq!(shown(&decided(files, &recipe(answers))), expected, "{row}");
    }
}

fn column(text: &str) -> (Column, OnceCell<Facts>) {
    let (heading, facts) = text.trim_end_matches([' ', '}']).split_once('{').unwrap_or((text, ""));
    let column = Column::new(heading.trim().to_owned(), None, Cells::default());
    let (what, value) = facts.split_once(' ').unwrap_or_default();
    let number = value.parse().unwrap_or(f64::NAN);
    let mut facts = Facts::default();
    match what {
        "about" => facts.numbers = Numbers { median: number, size: number, largest: number, ..facts.numbers },
        "steps" => facts.numbers = Numbers { step: number, has_fractions: true, rise: true, ..facts.numbers },
        "whole" => facts.numbers = Numbers { step: number, rise: true, ..facts.numbers },
        "dates" => facts.dates = if value == "open" { Dates::Open } else { Dates::In(Order::Dmy) },
        _ => facts.prefixed = Some(value.to_owned()).filter(|cell| !cell.is_empty()),
    }
    (column, OnceCell::from(facts))
}

fn recipe(answer: &str) -> Recipe {
    let mut recipe = Recipe::default();
    let (flag, value) = answer.split_once(' ').unwrap_or_default();
    let (role, rest) = value.split_once('=').unwrap_or((value, ""));
    match flag {
        "column" => recipe.columns.push((role.parse().unwrap(), rest.parse().unwrap())),
        "unit" => recipe.units.push((role.parse().unwrap(), rest.to_owned())),
        "rate-hz" => recipe.rate_hz = value.parse().ok(),
        "gauge-length-mm" => recipe.gauge_length_mm = value.parse().ok(),
        _ => recipe.align = value.parse().ok(),
    }
    recipe
}

fn decided(files: Vec<Vec<(Column, OnceCell<Facts>)>>, answers: &Recipe) -> Decision {
    let (columns, facts): (Vec<Vec<Column>>, _) = files.into_iter().map(|file| file.into_iter().unzip()).unzip();
    let table = |(file, columns)| Table { file: format!("f{file}"), columns, ..Table::default() };
    let tables: Vec<Table> = (1..).zip(columns).map(table).collect();
    let says = |column: &Column| names::role(&column.name, column.unit.as_deref());
    let says = |table: &Table| table.columns.iter().map(says).collect::<Vec<_>>();
    let candidates = tables.iter().enumerate().flat_map(|(file, table)| among(file, &says(table))).collect();
    decide(&Found { tables: &tables, facts, candidates, preset: None }, answers)
}

fn shown(decision: &Decision) -> String {
    let rate = decision.readings.iter().filter_map(|readings| match readings.clock {
        Clock::Rate { hz, .. } => Some(format!("{hz} Hz")),
        Clock::Column(_) => None,
    });
    let channel = |Channel { role, place, unit }| {
        let file = if place.file > 0 { format!("{}:", place.file + 1) } else { String::new() };
        format!("{role} {file}{} {}", place.column + 1, unit.name)
    };
    let taken: Vec<String> = rate.chain(decision.channels().into_iter().map(channel)).collect();
    let begins = |text: String| format!("{:.40}", text.split(';').next().unwrap_or_default());
    let remarks = decision.remarks.iter().map(|remark| " ! ".to_owned() + begins(remark.clone()).trim());
    let questions = decision.questions.iter().map(|question| " ? ".to_owned() + begins(question.to_string()).trim());
    (taken.join(", ") + &remarks.chain(questions).collect::<String>()).trim().to_owned()
}
