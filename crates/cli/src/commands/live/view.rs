//! The picture: a plot of the last seconds, and the present numbers. It adapts to any size of terminal.

use ohmstrain::number::{shown, significant};
use ohmstrain::{Estimate, Quantity, ReadingUnit};
use ohmstrain_bench_data::counted;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, GraphType, Paragraph, Wrap};

use super::Pictured;
use super::pulse::Pulse;
use super::recorder::Recorder;
use super::session::Session;
use crate::args::LiveArgs;
use crate::chart::{chart, dataset};
use crate::printable::printable;

/// Width of the numbers in columns, and the smallest width of a plot beside them.
const NUMBERS_WIDTH: u16 = 38;
const PLOT_WIDTH: u16 = 30;
const PLOT_HEIGHT: u16 = 6;
/// Height in rows below which a terminal counts as low.
const LOW: u16 = 10;
/// Largest number of points drawn: a few per dot of a wide terminal.
pub const MOST_DRAWN: usize = 2000;
/// Width of a bar that stands for a probability.
const BAR: usize = 10;

impl Pictured for Session<'_> {
    fn picture(&self, frame: &mut Frame, status: &str) {
        let around = Around { args: self.args, status, message: &self.track.message };
        around.draw(frame, numbers(self), |frame, area| draw_plot(frame, self, self.args.window_s, area));
    }
}

/// Text around a plot.
pub struct Around<'a> {
    pub args: &'a LiveArgs,
    /// State of the port.
    pub status: &'a str,
    pub message: &'a str,
}

impl Around<'_> {
    /// Draws title, message and keys, and between them the numbers, beside the plot if there is room for one.
    pub fn draw(&self, frame: &mut Frame, numbers: Vec<Line>, plot: impl FnOnce(&mut Frame, Rect)) {
        // A low terminal has room for the numbers, and for messages in place of the keys.
        let is_low = frame.area().height < LOW;
        let message_height = if self.message.is_empty() { 0 } else { 1 };
        let (message, keys) = if is_low { (message_height, 1 - message_height) } else { (2, 1) };
        let rows = [Constraint::Length(1), Constraint::Min(0), Constraint::Length(message), Constraint::Length(keys)];
        let [title, middle, message, keys] = Layout::vertical(rows).areas(frame.area());
        let sensor = self.args.estimate.sensor.file_name().unwrap_or_default().to_string_lossy();
        let heading = format!("ohmstrain live · {} · {sensor} · {}", self.args.port.source(), self.status);
        frame.render_widget(Paragraph::new(printable(&heading)).bold(), title);
        frame.render_widget(Paragraph::new(printable(self.message)).wrap(Wrap { trim: true }), message);
        frame.render_widget(Paragraph::new("z zero at rest   r record   m mark   q quit").dim(), keys);
        if middle.width >= NUMBERS_WIDTH + PLOT_WIDTH && middle.height >= PLOT_HEIGHT {
            let columns = [Constraint::Min(0), Constraint::Length(NUMBERS_WIDTH)];
            let [left, right] = Layout::horizontal(columns).areas(middle);
            plot(frame, left);
            frame.render_widget(Paragraph::new(numbers).block(Block::bordered()), right);
        } else {
            frame.render_widget(Paragraph::new(numbers), middle);
        }
    }
}

fn draw_plot(frame: &mut Frame, session: &Session, window_s: f64, area: Rect) {
    let (factor, unit) = shown(session.sensor.params().quantity);
    let limits = session.sensor.params().limits;
    let every = session.track.points.len().div_ceil(MOST_DRAWN).max(1);
    let line = |offset: f64| -> Vec<(f64, f64)> {
        let points = session.track.points.iter().step_by(every);
        let inside = |x: f64| x.max(limits.lower).min(limits.upper);
        points.map(|p| (p.time_s, factor * inside(p.strain + offset * p.half_width))).collect()
    };
    let (mean, upper, lower) = (line(0.0), line(1.0), line(-1.0));
    let end_s = session.track.points.back().map_or(window_s, |point| point.time_s);
    let x = [end_s - window_s, end_s];
    let margin = 0.05 * limits.span();
    let y = [factor * (limits.lower - margin), factor * (limits.upper + margin)];
    let marks: Vec<(f64, f64)> = session.track.marks.iter().map(|mark_s| (*mark_s, y[0])).collect();
    let datasets = vec![
        dataset(&upper, Color::DarkGray, GraphType::Line),
        dataset(&lower, Color::DarkGray, GraphType::Line),
        dataset(&mean, Color::Cyan, GraphType::Line),
        dataset(&marks, Color::Yellow, GraphType::Scatter).marker(Marker::Block),
    ];
    let name = match session.sensor.params().quantity {
        Quantity::Strain => "strain",
        Quantity::AngleDeg => "angle",
    };
    let title = format!(" {name},{unit}, with its 95 % interval; time, s ");
    frame.render_widget(chart(datasets, title, x, y), area);
}

fn numbers(session: &Session) -> Vec<Line<'static>> {
    let mut lines = vec![];
    let mut line =
        |name: &str, text: String| lines.push(Line::from(vec![Span::from(format!("{name:<11}")).dim(), text.into()]));
    // The numbers below are equally old.
    if let Some(silent_s) = session.track.pulse.silent_s() {
        line("silent", format!("for {silent_s:.0} s"));
    }
    if let Some(row) = &session.last {
        of_estimate(session, row, &mut line);
    } else {
        line("", "no reading yet".into());
    }
    of_stream(&session.track.pulse, session.track.recorder.as_ref(), &mut line);
    lines
}

/// Lists the counts of a stream.
pub fn of_stream(pulse: &Pulse, recorder: Option<&Recorder>, line: &mut impl FnMut(&str, String)) {
    let counts = &pulse.counts;
    let rate = pulse.rate_hz().map_or_else(String::new, |hz| format!(" at {hz:.1}/s"));
    line("rows", format!("{}{rate}", counts.rows));
    line("drop-outs", format!("{} missing, {}", counts.missing, counted(counts.gaps, "gap")));
    line("skipped", counted(counts.bad_lines, "line"));
    line("record", recorder.map_or("off".into(), |recorder| counted(recorder.count, "row")));
    line("marks", counts.marks.to_string());
}

fn of_estimate(session: &Session, row: &Estimate, line: &mut impl FnMut(&str, String)) {
    let (factor, unit) = shown(session.sensor.params().quantity);
    let name = if unit == "°" { "angle" } else { "strain" };
    line(name, format!("{:.2} ± {:.2}{unit}", factor * row.strain, factor * 1.96 * row.strain_sd));
    if let (Some(angle), Some(sd)) = (row.angle_deg, row.angle_sd) {
        line("joint", format!("{angle:.1} ± {:.1}°", 1.96 * sd));
    }
    line("rate", format!("{:+.2}{unit}/s", factor * row.strain_rate));
    for (name, share) in [("stretching", row.p_extend), ("held", row.p_hold), ("released", row.p_retract)] {
        if let Some(share) = share {
            let full = (share.clamp(0.0, 1.0) * BAR as f64).round() as usize;
            line(name, format!("{}{} {:3.0} %", "█".repeat(full), "·".repeat(BAR - full), 100.0 * share));
        }
    }
    let reading_unit = match session.sensor.params().reading {
        ReadingUnit::Ohm => " Ω",
        ReadingUnit::Ratio => "",
    };
    line("reading", row.resistance.map_or("missing".into(), |reading| significant(reading, 5) + reading_unit));
    line("relaxation", format!("{:+.4} R0", row.relaxation));
    line(
        "settles at",
        format!("{:.1} ± {:.1}{reading_unit}", row.settled_resistance, 1.96 * row.settled_resistance_sd),
    );
    line("NIS", row.nis.map_or("-".into(), |nis| format!("{nis:.2}")));
    line("flags", if row.flags == ohmstrain::Flags::NONE { "none".into() } else { row.flags.to_string() });
}
