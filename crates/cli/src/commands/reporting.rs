use std::path::Path;

use ohmstrain_report::{Drawn, FigureFiles, Reporting};

use crate::args::ReportArgs;
use crate::error::CliError;
use crate::output::{Claim, Kind, Outputs};
use crate::printable::printable;

/// Destination of report and figures.
pub struct Wanted<'a> {
    report: Option<Claim>,
    figures: Option<&'a Path>,
}

impl<'a> Wanted<'a> {
    /// Claims the requested files; `None` if none are requested.
    pub fn claim(args: &'a ReportArgs, outputs: &mut Outputs) -> Result<Option<Self>, CliError> {
        let report = args.report.as_deref().map(|path| outputs.claim(path, Kind::Report)).transpose()?;
        let figures = args.figures.as_deref();
        figures.map_or(Ok(()), |folder| outputs.folder(folder))?;
        Ok((report.is_some() || figures.is_some()).then_some(Self { report, figures }))
    }

    /// Puts report and figures into their places.
    pub fn put(self, drawn: Drawn, outputs: &mut Outputs) -> Result<(), CliError> {
        if let Some(claim) = self.report {
            outputs.put(claim, drawn.html);
        }
        let Some(folder) = self.figures else { return Ok(()) };
        put_figures(folder, drawn.figures, outputs)
    }
}

/// Puts figures into a folder.
pub fn put_figures(folder: &Path, figures: Vec<FigureFiles>, outputs: &mut Outputs) -> Result<(), CliError> {
    for FigureFiles { name, svg, csv } in figures {
        for (ending, content) in [("svg", svg), ("csv", csv)] {
            let claim = outputs.claim(&folder.join(format!("{name}.{ending}")), Kind::Figure)?;
            outputs.put(claim, content.into_bytes());
        }
    }
    Ok(())
}

/// Draws a report, under the name of its recording.
pub fn drawn(reporting: &Reporting) -> Result<Drawn, CliError> {
    let name = &reporting.recording.name;
    let title = Path::new(name).file_name().map_or_else(String::new, |name| name.to_string_lossy().into());
    reporting.drawn(&printable(&title)).map_err(|error| CliError::reporting(error, name))
}
