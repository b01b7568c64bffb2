//! The picture of several joints: a line for each, and the present numbers in the same colours.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::GraphType;

use super::Pictured;
use super::hand_session::HandSession;
use super::view::{Around, MOST_DRAWN, of_stream};
use crate::chart::{chart, dataset};
use crate::printable::printable;

/// Colours of the joints, in turn.
const COLOURS: [Color; 6] = [Color::Cyan, Color::Magenta, Color::Green, Color::Blue, Color::Red, Color::White];
/// Width of a joint's name in columns.
const NAME: usize = 11;

impl Pictured for HandSession<'_> {
    fn picture(&self, frame: &mut Frame, status: &str) {
        let around = Around { args: self.args, status, message: &self.track.message };
        around.draw(frame, numbers(self), |frame, area| draw_plot(frame, self, area));
    }
}

/// Returns the factor and the unit in which a joint is shown.
fn shown(session: &HandSession, joint: usize) -> (f64, &'static str) {
    if session.joints[joint].is_strain() { (100.0, " %") } else { (1.0, "°") }
}

fn colour(joint: usize) -> Color {
    COLOURS[joint % COLOURS.len()]
}

fn draw_plot(frame: &mut Frame, session: &HandSession, area: Rect) {
    let every = session.track.points.len().div_ceil(MOST_DRAWN).max(1);
    let line = |joint: usize| -> Vec<(f64, f64)> {
        let factor = shown(session, joint).0;
        session.track.points.iter().step_by(every).map(|point| (point.time_s, factor * point.values[joint])).collect()
    };
    let lines: Vec<Vec<(f64, f64)>> = (0..session.joints.len()).map(line).collect();
    let window_s = session.args.window_s;
    let end_s = session.track.points.back().map_or(window_s, |point| point.time_s);
    let x = [end_s - window_s, end_s];
    let all = || lines.iter().flatten().map(|point| point.1);
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    // A hand at rest is not drawn as if it moved: the plot has at least ten degrees, or percent.
    let (middle, half) = if low <= high { (0.5 * (low + high), (0.55 * (high - low)).max(5.0)) } else { (0.0, 5.0) };
    let y = [middle - half, middle + half];
    let marks: Vec<(f64, f64)> = session.track.marks.iter().map(|mark_s| (*mark_s, y[0])).collect();
    let mut datasets = vec![dataset(&marks, Color::Yellow, GraphType::Scatter).marker(Marker::Block)];
    datasets.extend(lines.iter().enumerate().map(|(joint, line)| dataset(line, colour(joint), GraphType::Line)));
    let of_strain = session.joints.iter().filter(|joint| joint.is_strain()).count();
    let what = match session.joints.len() - of_strain {
        0 => "strain, %",
        angles if angles == session.joints.len() => "angle, °",
        _ => "strain, %, and angle, °",
    };
    frame.render_widget(chart(datasets, format!(" {what}; time, s "), x, y), area);
}

fn numbers(session: &HandSession) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    let named = |name: &str| Span::from(format!("{name:<NAME$}")).dim();
    // The numbers below are equally old.
    if let Some(silent_s) = session.track.pulse.silent_s() {
        lines.push(Line::from(vec![named("silent"), format!("for {silent_s:.0} s").into()]));
    }
    if session.last.is_empty() {
        lines.push("no reading yet".into());
    }
    for (joint, row) in session.last.iter().enumerate() {
        let (factor, unit) = shown(session, joint);
        let name = Span::from(format!("{:<NAME$}", printable(session.joints[joint].name)));
        let number = format!("{:.1} ± {:.1}{unit}", factor * row.value, factor * 1.96 * row.sd);
        lines.push(Line::from(vec![name.style(Style::default().fg(colour(joint))), number.into()]));
    }
    of_stream(&session.track.pulse, session.track.recorder.as_ref(), &mut |name, text| {
        lines.push(Line::from(vec![named(name), text.into()]));
    });
    let flags: Vec<&str> = session.last.iter().flat_map(|row| &row.flags).map(String::as_str).collect();
    lines.extend(flags.iter().enumerate().map(|(place, flag)| {
        Line::from(vec![named(if place == 0 { "flags" } else { "" }), printable(flag).to_string().into()])
    }));
    lines
}
