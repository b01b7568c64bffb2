//! The picture: the instruction, the plan around the present, and the readings.

use ohmstrain::Quantity;
use ohmstrain::number::shown;
use ohmstrain_bench_data::{ReferenceQuantity, counted};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::widgets::{Block, Gauge, GraphType, Paragraph, Wrap};

use super::recording::{Point, Recording};
use crate::chart::{chart, dataset};
use crate::printable::printable;

/// Length of the plan ahead that is shown, s, and its number of points.
const AHEAD_S: f64 = 20.0;
const AHEAD_POINTS: usize = 200;
/// Largest number of past points drawn.
const MOST_DRAWN: usize = 1000;
/// Height of a plot in rows.
const PLOT_HEIGHT: u16 = 6;
/// Beats of the metronome, per second.
const BEATS_HZ: f64 = 1.0;

/// Draws everything.
pub fn draw(frame: &mut Frame, recording: &Recording, status: &str) {
    let args = recording.args;
    let rows = [
        Constraint::Length(1),
        Constraint::Length(3),
        Constraint::Length(1),
        Constraint::Min(0),
        Constraint::Length(2),
        Constraint::Length(1),
    ];
    let [title, what, next, middle, message, keys] = Layout::vertical(rows).areas(frame.area());
    let heading = format!("ohmstrain record · {} · {} · {status}", args.port.source(), args.output.display());
    frame.render_widget(Paragraph::new(printable(&heading)).bold(), title);
    let now_s = recording.now_s();
    let instruction = recording.pacer.instruction(now_s);
    // A beat per second: a mark that appears and disappears.
    let beat = if ((now_s * 2.0 * BEATS_HZ) as u64).is_multiple_of(2) { "●" } else { "○" };
    let left = if instruction.left_s > 0.0 { format!("  {:.0}", instruction.left_s.ceil()) } else { String::new() };
    let gauge = Gauge::default()
        .block(Block::bordered())
        .gauge_style(Style::default().fg(Color::Cyan))
        .ratio(instruction.share)
        .label(printable(&format!("{beat}  {}{left}", instruction.text)).into_owned());
    frame.render_widget(gauge, what);
    let counts = &recording.counts;
    let then = recording.pacer.next().map_or_else(String::new, |next| format!("then: {next} · "));
    let progress = format!(
        "{then}{} left · {} · {} repeated · {} skipped",
        counted(recording.pacer.left(), "step"),
        counted(counts.rows, "row"),
        counted(counts.repeated, "step"),
        counted(counts.bad_lines, "line")
    );
    frame.render_widget(Paragraph::new(printable(&progress)).dim(), next);
    frame.render_widget(Paragraph::new(printable(&recording.message)).wrap(Wrap { trim: true }), message);
    frame.render_widget(Paragraph::new(key_line(recording)).dim(), keys);
    if middle.height >= 2 * PLOT_HEIGHT {
        let [plan, readings] = Layout::vertical([Constraint::Percentage(50), Constraint::Min(0)]).areas(middle);
        draw_plan(frame, recording, now_s, plan);
        draw_readings(frame, recording, args.window_s, readings);
    } else if middle.height >= PLOT_HEIGHT {
        draw_readings(frame, recording, args.window_s, middle);
    }
}

fn key_line(recording: &Recording) -> String {
    let names = recording.pacer.pacing().positions.iter().enumerate().take(9);
    let names: Vec<String> = names.map(|(k, position)| format!("{} {}", k + 1, position.name)).collect();
    printable(&format!("b back, again   space pause   held at: {}   q quit", names.join(", "))).into_owned()
}

fn draw_plan(frame: &mut Frame, recording: &Recording, now_s: f64, area: Rect) {
    let pacing = recording.pacer.pacing();
    let (factor, unit) = shown(match pacing.quantity {
        ReferenceQuantity::Strain => Quantity::Strain,
        ReferenceQuantity::AngleDeg => Quantity::AngleDeg,
    });
    let past_s = 0.5 * AHEAD_S;
    let past: Vec<(f64, f64)> = drawn(recording, |point| factor * point.planned)
        .into_iter()
        .filter(|(time_s, planned)| *time_s >= now_s - past_s && planned.is_finite())
        .collect();
    let ahead_at = |k: usize| now_s + AHEAD_S * k as f64 / AHEAD_POINTS as f64;
    let ahead: Vec<(f64, f64)> = (0..=AHEAD_POINTS)
        .map(ahead_at)
        .map_while(|time_s| Some((time_s, factor * recording.pacer.planned(time_s)?)))
        .collect();
    let now: Vec<(f64, f64)> = ahead.first().copied().into_iter().collect();
    let values = pacing.positions.iter().map(|position| factor * position.values[0]);
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let margin = 0.1 * (high - low).max(f64::MIN_POSITIVE);
    let (x, y) = ([now_s - past_s, now_s + AHEAD_S], [low - margin, high + margin]);
    let datasets = vec![
        dataset(&past, Color::DarkGray, GraphType::Line),
        dataset(&ahead, Color::Cyan, GraphType::Line),
        dataset(&now, Color::Yellow, GraphType::Scatter).marker(Marker::Block),
    ];
    let title = format!(" where the body should be,{unit}; time, s ");
    frame.render_widget(chart(datasets, title, x, y), area);
}

fn draw_readings(frame: &mut Frame, recording: &Recording, window_s: f64, area: Rect) {
    let mut readings = drawn(recording, |point| point.reading);
    readings.retain(|(_, reading)| reading.is_finite());
    let end_s = recording.points.back().map_or(window_s, |point| point.time_s);
    let of = |pick: fn(f64, f64) -> f64, start: f64| readings.iter().map(|(_, reading)| *reading).fold(start, pick);
    let (low, high) =
        if readings.is_empty() { (0.0, 1.0) } else { (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY)) };
    let margin = (0.05 * (high - low)).max(1e-4 * high.abs()).max(f64::MIN_POSITIVE);
    let (x, y) = ([end_s - window_s, end_s], [low - margin, high + margin]);
    let datasets = vec![dataset(&readings, Color::Green, GraphType::Line)];
    frame.render_widget(chart(datasets, " readings; time, s ".into(), x, y), area);
}

/// Returns a selection of the recorded points, enough for a wide terminal.
fn drawn(recording: &Recording, value: impl Fn(&Point) -> f64) -> Vec<(f64, f64)> {
    let every = recording.points.len().div_ceil(MOST_DRAWN).max(1);
    recording.points.iter().step_by(every).map(|point| (point.time_s, value(point))).collect()
}
