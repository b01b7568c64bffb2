//! Charts in the terminal.

use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType};

/// Returns a line, or dots, of a chart.
pub fn dataset(data: &[(f64, f64)], colour: Color, kind: GraphType) -> Dataset<'_> {
    Dataset::default().marker(Marker::Braille).graph_type(kind).style(Style::default().fg(colour)).data(data)
}

/// Returns a chart with these bounds.
pub fn chart<'a>(datasets: Vec<Dataset<'a>>, title: String, x: [f64; 2], y: [f64; 2]) -> Chart<'a> {
    let labels = |[low, high]: [f64; 2]| {
        let digits = if high - low < 1.0 { 3 } else { 1 };
        [low, 0.5 * (low + high), high].map(|x| Line::from(format!("{x:.digits$}")))
    };
    Chart::new(datasets)
        .block(Block::bordered().title(title))
        .x_axis(Axis::default().bounds(x).labels(labels(x)))
        .y_axis(Axis::default().bounds(y).labels(labels(y)))
}
