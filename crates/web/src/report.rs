//! The HTML report on a recording, and its figures.

use ohmstrain::trace::TraceFile;
use ohmstrain::{Sensor, Tested};
use ohmstrain_report::{FigureFiles, Reporting, ReportingError, Sample, Scored};
use wasm_bindgen::prelude::*;

/// A report and its figures.
#[wasm_bindgen]
pub struct Drawn(ohmstrain_report::Drawn);

#[wasm_bindgen]
impl Drawn {
    /// Returns the report, one self-contained page of HTML.
    #[wasm_bindgen(getter)]
    pub fn html(&self) -> String {
        self.0.html.clone()
    }

    /// Returns names and contents of the figures' files, alternating.
    pub fn figures(&self) -> Vec<String> {
        let files = |figure: &FigureFiles| {
            let name = &figure.name;
            [format!("{name}.svg"), figure.svg.clone(), format!("{name}.csv"), figure.csv.clone()]
        };
        self.0.figures.iter().flat_map(files).collect()
    }
}

/// Filters and smooths a recording, scores the estimates and draws the report.
pub fn drawn(
    sensor: &Sensor,
    recording: &TraceFile,
    facts: &[(&'static str, String)],
    tested: Option<&Tested>,
) -> Result<Drawn, String> {
    let (recording, sensor) = (&*recording.at_reference_temperature(sensor), &recording.sensor_for(sensor));
    let part = Scored::default();
    let sample = Sample::of(&recording.trace.time_s, &recording.sha256, sensor.params(), part);
    let reporting = Reporting { recording, sensor, kind: None, rest_resistance: None, part, sample, tested, facts };
    let drawn = reporting.drawn(&recording.name).map_err(|error| match error {
        ReportingError::Report(error) => error.to_string(),
        error => format!("{}: {error}", recording.name),
    });
    drawn.map(Drawn)
}
