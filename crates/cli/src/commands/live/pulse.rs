//! Rows of a stream as they arrive: counts, the usual rate, silence.

use std::time::Instant;

/// Ratio of a step to the usual step above which it is a gap.
const GAP: f64 = 5.0;
/// Shortest pause that is reported, s.
const SILENCE_S: f64 = 2.0;
/// Weight of a new step in the running mean of steps.
const NEW_STEP: f64 = 0.1;

/// Counts of rows, gaps, bad lines and the like.
#[derive(Clone, Copy, Default)]
pub struct Counts {
    pub rows: u64,
    pub missing: u64,
    pub gaps: u64,
    pub bad_lines: u64,
    pub restarts: u64,
    pub marks: u32,
}

/// Arrivals of a stream's rows.
#[derive(Default)]
pub struct Pulse {
    pub counts: Counts,
    usual_step_s: Option<f64>,
    last_s: Option<f64>,
    /// Arrival of the last row.
    taken: Option<Instant>,
}

impl Pulse {
    /// Counts a row that arrives now, with the number of its missing readings.
    pub fn count(&mut self, time_s: f64, missing: u64) {
        self.counts.rows += 1;
        self.counts.missing += missing;
        self.taken = Some(Instant::now());
        let Some(step_s) = self.last_s.replace(time_s).map(|last_s| time_s - last_s) else { return };
        let usual_s = self.usual_step_s.get_or_insert(step_s);
        if step_s > GAP * *usual_s {
            self.counts.gaps += 1;
        } else {
            *usual_s += NEW_STEP * (step_s - *usual_s);
        }
    }

    /// Forgets the times, for another clock.
    pub fn restart(&mut self) {
        (self.usual_step_s, self.last_s) = (None, None);
    }

    /// Returns the usual rate of rows per second.
    pub fn rate_hz(&self) -> Option<f64> {
        self.usual_step_s.filter(|step_s| *step_s > 0.0).map(f64::recip)
    }

    /// Returns the time since the last row, s, if it is longer than usual.
    pub fn silent_s(&self) -> Option<f64> {
        let longest_s = SILENCE_S.max(GAP * self.usual_step_s.unwrap_or(0.0));
        self.taken.map(|taken| taken.elapsed().as_secs_f64()).filter(|silent_s| *silent_s > longest_s)
    }
}
