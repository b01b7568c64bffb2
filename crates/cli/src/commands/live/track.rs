//! The rows of a view: those of the plot, their marks, and their recording.

use std::collections::VecDeque;

use ohmstrain::trace::{LEAST_AT_REST, REST_S};

use super::pulse::Pulse;
use super::recorder::Recorder;

/// Largest number of rows kept for the plot.
const MOST_POINTS: usize = 1 << 16;

/// A row of a plot.
pub trait Timed {
    /// Returns its time, s.
    fn time_s(&self) -> f64;
}

/// Rows so far.
pub struct Track<P> {
    pub points: VecDeque<P>,
    /// Times of the marks, s.
    pub marks: VecDeque<f64>,
    new_mark: Option<u32>,
    pub pulse: Pulse,
    pub recorder: Option<Recorder>,
    /// Last message.
    pub message: String,
}

impl<P: Timed> Track<P> {
    /// Creates a track without rows.
    pub fn new() -> Self {
        Self {
            points: VecDeque::new(),
            marks: VecDeque::new(),
            new_mark: None,
            pulse: Pulse::default(),
            recorder: None,
            message: String::new(),
        }
    }

    /// Adds a row, and drops the rows and marks that are too old for the plot and for a rest.
    pub fn push(&mut self, point: P, window_s: f64) {
        let oldest_s = point.time_s() - window_s.max(REST_S);
        self.points.push_back(point);
        while self.points.len() > MOST_POINTS || self.points.front().is_some_and(|point| point.time_s() < oldest_s) {
            self.points.pop_front();
        }
        while self.marks.front().is_some_and(|mark_s| *mark_s < oldest_s) {
            self.marks.pop_front();
        }
    }

    /// Returns the known readings of the last second, or at least the last few.
    pub fn at_rest(&self, reading: impl Fn(&P) -> f64) -> Vec<f64> {
        let known = || self.points.iter().rev().filter(|point| reading(point).is_finite());
        let is_recent = |point: &&P| self.points.back().is_some_and(|last| point.time_s() >= last.time_s() - REST_S);
        let count = known().take_while(is_recent).count().max(LEAST_AT_REST);
        known().take(count).map(&reading).collect()
    }

    /// Forgets everything that depends on time, for another clock.
    pub fn clear(&mut self, message: &str) {
        self.pulse.restart();
        self.points.clear();
        self.marks.clear();
        self.message = message.into();
    }

    /// Counts a line that is not used.
    pub fn skip(&mut self, message: String) {
        self.pulse.counts.bad_lines += 1;
        self.message = message;
    }

    /// Puts a mark on the next row.
    pub fn mark(&mut self) {
        let Some(last_s) = self.points.back().map(P::time_s) else { return };
        self.pulse.counts.marks += 1;
        self.new_mark = Some(self.pulse.counts.marks);
        self.marks.push_back(last_s);
        self.message = format!("mark {} at {last_s:.2} s", self.pulse.counts.marks);
    }

    /// Records a row with its mark; a recording that cannot be written ends.
    pub fn record(&mut self, time_s: f64, values: impl Iterator<Item = f64>) {
        let mark = self.new_mark.take();
        let Some(recorder) = &mut self.recorder else { return };
        if let Err(error) = recorder.write(time_s, values, mark) {
            self.message = format!("cannot record: {error}");
            self.recorder = None;
        }
    }
}
