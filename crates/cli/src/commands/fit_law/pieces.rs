use std::ops::Range;

use ohmstrain::trace::TraceFile;
use ohmstrain_bench_data::{Segment, segment};
use ohmstrain_calib::Samples;
use ohmstrain_calib::closed_form::{ClosedForm, Datum, hold_data, moving_data, whole_data};
use ohmstrain_model::Phase;

use crate::args::{FitLawArgs, SegmentChoice, phase_name};
use crate::error::CliError;

/// Piece for one fit: a segment, or a movement with the hold after it.
pub struct Piece {
    /// Its segments, as `--segment` names them.
    pub label: String,
    /// The law to fit.
    pub law: ClosedForm,
    /// Its phase; that of the movement if there are two; `None` for a whole recording.
    pub phase: Option<Phase>,
    /// The preceding movement, if this is a hold alone.
    pub after: Option<Phase>,
    /// Mean speed, in strain per second, of the movement or of the preceding one; `None` if there is neither.
    pub speed_per_s: Option<f64>,
    /// Time of its first row, s.
    pub from_s: f64,
    /// Time of its last row, s.
    pub until_s: f64,
    /// The readings.
    pub data: Vec<Datum>,
}

impl Piece {
    /// True if it contains a segment of this choice.
    fn contains(&self, choice: SegmentChoice) -> bool {
        let (one, phase) = (choice.to_string(), format!("{choice}:"));
        self.label.split('+').any(|label| label == one || label.starts_with(&phase))
    }

    /// Appends the readings of another piece.
    pub fn join(&mut self, other: Self) {
        self.label = format!("{},{}", self.label, other.label);
        self.until_s = other.until_s;
        if self.speed_per_s != other.speed_per_s {
            self.speed_per_s = None;
        }
        self.data.extend(other.data);
    }
}

/// A segment with its number among those of its phase, from 1.
struct Numbered {
    segment: Segment,
    number: usize,
}

/// Returns the pieces of a recording that the arguments choose.
pub fn pieces(recording: &TraceFile, args: &FitLawArgs) -> Result<Vec<Piece>, CliError> {
    if args.segment.contains(&SegmentChoice::Whole) {
        return whole(recording, args).map(|piece| vec![piece]);
    }
    for choice in &args.segment {
        check(args.law, *choice)?;
    }
    let samples = recording.samples()?;
    let segments = numbered(segment(samples.time_s(), samples.strain()));
    let cutter = Cutter { samples, segments: &segments };
    let chosen = if args.law == ClosedForm::Eq8And9 { cutter.pairs(args) } else { cutter.singles(args) };
    let is_missing = |choice: &&SegmentChoice| !chosen.iter().any(|piece| piece.contains(**choice));
    let missing: Vec<&SegmentChoice> = args.segment.iter().filter(is_missing).collect();
    if chosen.is_empty() || !missing.is_empty() {
        return Err(CliError::Input(nothing(&recording.name, args, &missing, &segments)));
    }
    Ok(chosen)
}

/// True if a law describes a phase.
const fn is_about(law: ClosedForm, phase: Phase) -> bool {
    match law {
        ClosedForm::Eq8And9 => true,
        ClosedForm::Eq8 | ClosedForm::Tunnelling => !matches!(phase, Phase::Hold),
        _ => matches!(phase, Phase::Hold),
    }
}

/// Checks that the law fits the chosen phase. Laws of time alone fit any relaxation; the others need their own phase.
fn check(law: ClosedForm, choice: SegmentChoice) -> Result<(), CliError> {
    let bound = matches!(law, ClosedForm::Eq8 | ClosedForm::Eq9 | ClosedForm::Tunnelling);
    match choice {
        SegmentChoice::Phase(phase, _) if bound && !is_about(law, phase) => {
            Err(CliError::Arguments(format!("{law} is not about segments of the kind {}", phase_name(phase))))
        }
        _ => Ok(()),
    }
}

fn whole(recording: &TraceFile, args: &FitLawArgs) -> Result<Piece, CliError> {
    if args.segment.len() > 1 || matches!(args.law, ClosedForm::Eq8 | ClosedForm::Eq8And9) {
        return Err(CliError::Arguments(format!("--segment whole goes alone, and not with eq8 (law {})", args.law)));
    }
    let trace = &recording.trace;
    let rows = 0..trace.time_s.len();
    let data = if args.law == ClosedForm::Tunnelling {
        moving_data(&recording.samples()?, rows)
    } else {
        let reading = &trace.readings.values;
        let samples = Samples::new(&trace.time_s, reading, reading);
        whole_data(&samples.map_err(|error| CliError::Input(format!("{}: data {error}", recording.name)))?, rows)
    };
    Ok(Piece {
        label: "whole".into(),
        law: args.law,
        phase: None,
        after: None,
        speed_per_s: None,
        from_s: trace.time_s.first().copied().unwrap_or(f64::NAN),
        until_s: trace.time_s.last().copied().unwrap_or(f64::NAN),
        data,
    })
}

fn numbered(segments: Vec<Segment>) -> Vec<Numbered> {
    let mut count = [0; 3];
    let number = |segment: Segment| {
        count[segment.phase.index()] += 1;
        Numbered { number: count[segment.phase.index()], segment }
    };
    segments.into_iter().map(number).collect()
}

impl Numbered {
    fn label(&self) -> String {
        format!("{}:{}", phase_name(self.segment.phase), self.number)
    }

    fn is_chosen(&self, choices: &[SegmentChoice]) -> bool {
        choices.iter().any(|choice| match choice {
            SegmentChoice::Whole => true,
            SegmentChoice::Phase(phase, number) => {
                *phase == self.segment.phase && number.is_none_or(|number| number == self.number)
            }
        })
    }

    /// True if no gap in the reference lies between both.
    fn follows(&self, before: &Self) -> bool {
        self.segment.rows.start == before.segment.rows.end
    }

    fn is_hold(&self) -> bool {
        self.segment.phase == Phase::Hold
    }
}

/// A recording with its segments.
struct Cutter<'a> {
    samples: Samples<'a>,
    segments: &'a [Numbered],
}

impl Cutter<'_> {
    /// Returns one piece per segment.
    fn singles(&self, args: &FitLawArgs) -> Vec<Piece> {
        let wanted = |i: &usize| {
            let own = &self.segments[*i];
            if args.segment.is_empty() {
                // Rest before the first movement has nothing to relax from.
                is_about(args.law, own.segment.phase) && (!own.is_hold() || self.before(*i).is_some())
            } else {
                own.is_chosen(&args.segment)
            }
        };
        (0..self.segments.len()).filter(wanted).map(|i| self.single(i, args.law)).collect()
    }

    /// Returns movements, each with the following hold; for the table of all, also segments that stand alone.
    fn pairs(&self, args: &FitLawArgs) -> Vec<Piece> {
        let chosen = |own: &Numbered| args.segment.is_empty() || own.is_chosen(&args.segment);
        let mut out = Vec::new();
        for (i, own) in self.segments.iter().enumerate().filter(|(_, own)| !own.is_hold()) {
            match self.segments.get(i + 1).filter(|next| next.is_hold() && next.follows(own)) {
                Some(hold) if chosen(own) || chosen(hold) => out.push(self.pair(i, hold)),
                None if args.table && chosen(own) => out.push(self.single(i, ClosedForm::Eq8)),
                _ => {}
            }
        }
        out
    }

    fn pair(&self, i: usize, hold: &Numbered) -> Piece {
        let mut piece = self.single(i, ClosedForm::Eq8And9);
        let (moved, held) = (self.segments[i].segment.rows.clone(), hold.segment.rows.clone());
        piece.label = format!("{}+{}", piece.label, hold.label());
        piece.until_s = self.samples.time_s()[held.end - 1];
        piece.data.extend(hold_data(&self.samples, held, Some(moved)));
        piece
    }

    fn single(&self, i: usize, law: ClosedForm) -> Piece {
        let own = &self.segments[i];
        let Range { start, end } = own.segment.rows;
        let before = if own.is_hold() { self.before(i) } else { None };
        let data = if own.is_hold() {
            hold_data(&self.samples, start..end, before.map(|before| before.segment.rows.clone()))
        } else {
            moving_data(&self.samples, start..end)
        };
        let moves = !own.is_hold() || before.is_some();
        Piece {
            label: own.label(),
            law,
            phase: Some(own.segment.phase),
            after: before.map(|before| before.segment.phase),
            speed_per_s: data.first().filter(|_| moves).map(|datum| datum.at.rate.abs()),
            from_s: self.samples.time_s()[start],
            until_s: self.samples.time_s()[end - 1],
            data,
        }
    }

    /// Returns the movement before a hold.
    fn before(&self, i: usize) -> Option<&Numbered> {
        i.checked_sub(1).map(|before| &self.segments[before]).filter(|before| self.segments[i].follows(before))
    }
}

fn nothing(file: &str, args: &FitLawArgs, missing: &[&SegmentChoice], segments: &[Numbered]) -> String {
    let wanted = if args.segment.is_empty() {
        match args.law {
            ClosedForm::Eq8And9 => "a movement followed by a hold".to_string(),
            ClosedForm::Eq8 | ClosedForm::Tunnelling => "a movement".into(),
            _ => "a hold after a movement".into(),
        }
    } else {
        let all = || args.segment.iter().collect();
        let names: Vec<&SegmentChoice> = if missing.is_empty() { all() } else { missing.to_vec() };
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        format!("segments {}", names.join(", "))
    };
    let found = |phase: Phase| {
        let count = segments.iter().filter(|own| own.segment.phase == phase).count();
        format!("{count} {}", phase_name(phase))
    };
    let is_hold = |own: &Numbered| own.is_hold();
    let instead = match args.law {
        ClosedForm::Eq8And9 if args.segment.is_empty() && !segments.iter().any(is_hold) => {
            "; --law eq8 is about movements alone"
        }
        _ => "",
    };
    format!("{file}: expected {wanted} for {}, found {}{instead}", args.law, Phase::ALL.map(found).join(", "))
}
