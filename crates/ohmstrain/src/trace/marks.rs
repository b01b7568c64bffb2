use ohmstrain_bench_data::pacing::{PERSON_SD_S, probable_hold};
use ohmstrain_bench_data::{Metadata, Reference, ReferenceQuantity, StrainUnit};
use ohmstrain_calib::{Mark, MarkedReference, MarksError};

use super::TraceFile;
use crate::number::significant;
use crate::{Error, Recording, marked_references};

/// Marks of a recording, from a file of their own or from the recording itself.
#[derive(Clone, Debug)]
pub struct Marked {
    /// Index of the recording.
    pub recording: usize,
    /// Name of the file that contains the marks.
    pub name: String,
    /// Name of their header in messages: file and line.
    pub header: String,
    /// Quantity of the marks' strains.
    pub quantity: ReferenceQuantity,
    /// The marks, in order of time.
    pub marks: Vec<Mark>,
    /// Line of each mark in the file; empty if a mark comes from several lines.
    pub lines: Vec<u64>,
}

impl Marked {
    /// Returns the marks of a recording itself; see [`TraceFile::marks`].
    #[must_use]
    pub fn of_trace(recording: usize, file: &TraceFile) -> Option<Self> {
        let quantity = file.trace.reference.as_ref()?.quantity;
        let (name, header) = (file.name.clone(), file.header.clone());
        Some(Self { recording, name, header, quantity, marks: file.marks()?, lines: Vec::new() })
    }

    /// Converts the marks of a file to those of a recording with these metadata, as a reference in the recording itself is
    /// converted: strains by `unit`, and angles by a joint.
    ///
    /// # Errors
    /// If the joint is invalid.
    pub fn of_recording(mut self, metadata: &Metadata, unit: Option<StrainUnit>) -> Result<Self, Error> {
        match (self.quantity, metadata.joint) {
            (ReferenceQuantity::Strain, _) => self.convert(|strain| unit.map_or(1.0, StrainUnit::factor) * strain),
            (ReferenceQuantity::AngleDeg, Some(joint)) => {
                let joint = joint.build().map_err(Error::Joint)?;
                self.convert(|angle_deg| joint.strain(angle_deg.to_radians()));
                self.quantity = ReferenceQuantity::Strain;
            }
            (ReferenceQuantity::AngleDeg, None) => {}
        }
        Ok(self)
    }

    /// Converts the strains of all marks by a linear function.
    fn convert(&mut self, to: impl Fn(f64) -> f64) {
        for mark in &mut self.marks {
            mark.strain_sd = mark.strain_sd.map(|sd| (to(sd) - to(0.0)).abs());
            mark.strain = to(mark.strain);
        }
    }

    /// Formats a fault with the file and the line, or the mark, that it concerns.
    #[must_use]
    pub fn fault(&self, fault: &MarksError) -> String {
        let line = |mark: usize| match (self.lines.get(mark), self.marks.get(mark)) {
            (Some(line), _) => format!(":{line}"),
            (None, Some(found)) => format!(": hold {} (from {} s)", mark + 1, found.time_s),
            (None, None) => String::new(),
        };
        format!("{}{}: {fault}", self.name, fault.mark().map_or(String::new(), line))
    }

    /// Describes the reference that was found.
    #[must_use]
    pub fn remark(&self, found: &MarkedReference) -> String {
        let marks = self.marks.iter().map(|mark| mark.strain);
        let (low, high) = marks.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let known = || found.strain_sd.iter().filter(|sd| sd.is_finite());
        let variance = known().map(|sd| sd * sd).sum::<f64>() / known().count().max(1) as f64;
        format!(
            "{}: {} marks, held at {}; {} of {} moves with a duration of their own; the reference between them is good to {} % of the marks' span",
            self.name,
            self.marks.len(),
            found.holds,
            found.irregular,
            found.moves,
            significant(100.0 * variance.sqrt() / (high - low), 2)
        )
    }
}

impl TraceFile {
    /// Returns the marks in the recording itself: a strain with a standard deviation that is known in holds and unknown between
    /// them, as `ohmstrain record` writes it. A hold is extended beyond the rows in which it is certain; see [`probable_hold`].
    /// `None` for any other recording.
    #[must_use]
    pub fn marks(&self) -> Option<Vec<Mark>> {
        let reference = self.trace.reference.as_ref().filter(|reference| !reference.sd.is_empty())?;
        let strain = &reference.values;
        let rows: Vec<usize> = (0..strain.len()).collect();
        let is_alike = |a: &usize, b: &usize| strain[*a] == strain[*b] || (strain[*a].is_nan() && strain[*b].is_nan());
        let runs: Vec<&[usize]> = rows.chunk_by(is_alike).collect();
        let is_unknown = |run: &[usize]| strain[run[0]].is_nan();
        if runs.len() < 2 || runs.windows(2).any(|pair| !is_unknown(pair[0]) && !is_unknown(pair[1])) {
            return None;
        }
        let mark = |run: &&[usize]| {
            let (first, last) = (run[0], run[run.len() - 1]);
            let until_s = (last > first).then_some(self.trace.time_s[last]);
            Mark { until_s, strain_sd: Some(reference.sd[first]), ..Mark::new(self.trace.time_s[first], strain[first]) }
        };
        let known = runs.iter().filter(|run| !is_unknown(run)).map(mark);
        let mut marks: Vec<Mark> = known.collect();
        let ends_s: Vec<(f64, f64)> =
            marks.iter().map(|mark| (mark.time_s, mark.until_s.unwrap_or(mark.time_s))).collect();
        for (k, mark) in marks.iter_mut().enumerate().filter(|(_, mark)| mark.until_s.is_some()) {
            let before_s = k.checked_sub(1).map(|before| ends_s[before].1);
            let after_s = ends_s.get(k + 1).map(|after| after.0);
            let (from_s, until_s) = probable_hold(ends_s[k], (before_s, after_s));
            *mark = Mark { time_s: from_s, until_s: Some(until_s), time_sd_s: Some(PERSON_SD_S), ..*mark };
        }
        Some(marks)
    }
}

/// Turns the marks of recordings into references, sets them and returns them.
///
/// # Errors
/// As [`marked_references`]; indices of recordings in errors refer to `marked`.
pub fn take_marks(recordings: &mut [TraceFile], marked: &[Marked]) -> Result<Vec<MarkedReference>, Error> {
    if marked.is_empty() {
        return Ok(Vec::new());
    }
    let known = marked.iter().map(|one| {
        let trace = &recordings[one.recording].trace;
        Recording::new(&trace.time_s, &trace.readings.values, &trace.time_s)
    });
    let known = known.collect::<Result<Vec<_>, _>>()?;
    let marks: Vec<Vec<Mark>> = marked.iter().map(|one| one.marks.clone()).collect();
    let found = marked_references(&known, &marks)?;
    for (one, found) in marked.iter().zip(&found) {
        let (values, sd) = (found.strain.clone(), found.strain_sd.clone());
        let recording = &mut recordings[one.recording];
        recording.reference_header.clone_from(&one.header);
        recording.trace.reference = Some(Reference { quantity: one.quantity, values, sd });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ohmstrain_bench_data::TraceReader;

    fn marks(rows: &str) -> Option<Vec<Mark>> {
        let text = format!("time_s,resistance_ohm,strain,strain_sd\n{rows}");
        let rows = TraceReader::with_overrides(text.as_bytes(), "t.csv", &Metadata::default()).unwrap();
        TraceFile::collect(rows, String::new()).unwrap().marks()
    }

    #[test]
    fn holds_between_unknown_rows_are_marks() {
        let found = marks("0,9,0,0.01\n1,9,0,0.01\n2,9,,\n3,9,0.2,0.02\n4,9,,\n").unwrap();
        let (until_s, time_sd_s) = (Some(1.7), Some(PERSON_SD_S));
        let rest = Mark { until_s, strain_sd: Some(0.01), time_sd_s, ..Mark::new(0.0, 0.0) };
        let moment = Mark { strain_sd: Some(0.02), ..Mark::new(3.0, 0.2) };
        assert_eq!(found, [rest, moment]);
    }

    /// Tests conversions as of columns `strain` and `angle_deg`: 5 ± 1 %, and 90 ± 1.8° around an axis 10 mm away, of a sensor of 50 mm.
    #[test]
    fn marks_are_converted_as_a_reference_is() {
        let converted = |quantity, (value, sd), joint: Option<&str>, unit| {
            let marks = vec![Mark { strain_sd: Some(sd), ..Mark::new(0.0, value) }];
            let (name, header) = (String::new(), String::new());
            let metadata = Metadata { joint: joint.map(|joint| joint.parse().unwrap()), ..Metadata::default() };
            let marked = Marked { recording: 0, name, header, quantity, marks, lines: Vec::new() };
            let found = marked.of_recording(&metadata, unit).unwrap();
            (found.quantity, found.marks[0].strain, found.marks[0].strain_sd.unwrap())
        };
        let near = |(quantity, value, sd): (ReferenceQuantity, f64, f64), expected: (ReferenceQuantity, f64, f64)| {
            let is_near = (value - expected.1).abs() < 1e-12 && (sd - expected.2).abs() < 1e-12;
            assert!(quantity == expected.0 && is_near, "{quantity:?} {value} {sd}");
        };
        let (strain, angle) = (ReferenceQuantity::Strain, ReferenceQuantity::AngleDeg);
        let (knee, turn) = (Some("prestrain=0.05 moment_arm_mm=-10 gauge_length_mm=50"), std::f64::consts::FRAC_PI_2);
        near(converted(strain, (5.0, 1.0), knee, Some(StrainUnit::Percent)), (strain, 0.05, 0.01));
        near(converted(strain, (0.05, 0.01), None, None), (strain, 0.05, 0.01));
        near(converted(angle, (90.0, 1.8), None, Some(StrainUnit::Percent)), (angle, 90.0, 1.8));
        near(converted(angle, (90.0, 1.8), knee, None), (strain, 0.05 - 0.2 * turn, 0.004 * turn));
    }

    #[test]
    fn strains_that_move_in_known_rows_are_no_marks() {
        assert!(marks("0,9,0,0.01\n1,9,0.1,0.01\n2,9,,\n").is_none());
        assert!(marks("0,9,0.1,0.01\n1,9,0.1,0.01\n").is_none());
        assert!(marks("0,9,,\n1,9,,\n").is_none());
    }
}
