//! Motion between marks: holds, moves with a common velocity profile, and moves with a pace of their own.

use nalgebra::DVector;

use crate::marks::Mark;
use crate::marks::holds::Stillness;
use crate::marks::pace::{INNER_KNOTS, Pace, progress};
use crate::samples::Samples;

/// Default standard deviation of a mark's time, s: a person's reaction time.
pub(crate) const TIME_SD_S: f64 = 0.2;
/// Standard deviation of the ends of a hold that is detected from the readings, s.
const HOLD_SD_S: f64 = 0.6;
/// Default standard deviation of a mark's strain, as a fraction of the marks' span.
const STRAIN_SD: f64 = 0.02;
/// Standard deviation of a move's progress in its middle, as a fraction of its distance.
const SHAPE_SD: f64 = 0.03;
/// Minimum duration of a move, s.
const SHORTEST_S: f64 = 1e-3;

/// A mark, or the hold around it, with standard deviations.
#[derive(Clone, Copy, Debug)]
struct Stop {
    arrive_s: f64,
    depart_s: f64,
    is_hold: bool,
    time_sd_s: f64,
    strain: f64,
    strain_sd: f64,
}

/// A motion through marks. Its parameters z are in units of their prior standard deviations and have prior mean zero: two per mark (time
/// and strain), one more per hold (its end), [`INNER_KNOTS`] per irregular move.
#[derive(Clone, Debug)]
pub(crate) struct MarkedMotion {
    stops: Vec<Stop>,
    shape: f64,
    /// Pace of each move; `None` for a regular one.
    paces: Vec<Option<Pace>>,
    span: f64,
}

impl MarkedMotion {
    /// Builds a motion of regular moves through checked marks, whose strains span `span`.
    pub(crate) fn new(samples: &Samples, marks: &[Mark], span: f64, shape: f64) -> Self {
        let stillness = Stillness::new(samples);
        let ends = (samples.time_s.first().copied(), samples.time_s.last().copied());
        let mut stops: Vec<Stop> = Vec::with_capacity(marks.len());
        for (k, mark) in marks.iter().enumerate() {
            let before_s = stops.last().map(|stop| stop.depart_s).or(ends.0).unwrap_or(mark.time_s);
            let after_s = marks.get(k + 1).map(|next| next.time_s).or(ends.1).unwrap_or(mark.time_s);
            let time_sd_s = mark.time_sd_s.unwrap_or(TIME_SD_S);
            let held = mark.until_s.map(|until_s| (mark.time_s, until_s, time_sd_s));
            let found = || stillness.hold(mark.time_s, (before_s, after_s), time_sd_s);
            let held = held.or_else(|| found().map(|(from_s, until_s)| (from_s, until_s, HOLD_SD_S)));
            let (arrive_s, depart_s, time_sd_s) = held.unwrap_or((mark.time_s, mark.time_s, time_sd_s));
            stops.push(Stop {
                arrive_s,
                depart_s,
                is_hold: depart_s > arrive_s,
                time_sd_s,
                strain: mark.strain,
                strain_sd: mark.strain_sd.unwrap_or(STRAIN_SD * span),
            });
        }
        Self { paces: vec![None; marks.len() - 1], stops, shape, span }
    }

    /// Returns the number of parameters.
    pub(crate) fn parameters(&self) -> usize {
        let of_stops: usize = self.stops.iter().map(|stop| 2 + usize::from(stop.is_hold)).sum();
        of_stops + INNER_KNOTS * self.irregular()
    }

    /// Returns the number of moves.
    pub(crate) fn moves(&self) -> usize {
        self.paces.len()
    }

    /// Returns the number of moves with a pace of their own.
    pub(crate) fn irregular(&self) -> usize {
        self.paces.iter().flatten().count()
    }

    /// Returns the number of holds.
    pub(crate) fn holds(&self) -> usize {
        self.stops.iter().filter(|stop| stop.is_hold).count()
    }

    /// Returns the move, including the hold before it, at a time; `None` before the first mark and after the last.
    pub(crate) fn move_at(&self, time_s: f64) -> Option<usize> {
        let (first, last) = (self.stops.first()?, self.stops.last()?);
        let begun = self.stops.partition_point(|stop| stop.arrive_s <= time_s);
        (first.arrive_s..=last.depart_s).contains(&time_s).then(|| begun.saturating_sub(1).min(self.moves() - 1))
    }

    /// Gives moves a pace of their own, estimated from the readings.
    pub(crate) fn make_irregular(&mut self, moves: &[usize], samples: &Samples) {
        for &k in moves {
            let (from_s, until_s) = (self.stops[k].depart_s, self.stops[k + 1].arrive_s);
            self.paces[k] = Some(Pace::new(samples, (from_s, until_s), self.shape));
        }
    }

    /// Returns the strains at these times under parameters `z`; NaN before the first mark and after the last.
    pub(crate) fn strains(&self, z: &DVector<f64>, time_s: &[f64]) -> Vec<f64> {
        let moved = self.moved(z);
        time_s.iter().map(|t| moved.strain(*t)).collect()
    }

    /// Returns the standard deviation of the strain at a time due to a regular move's shape.
    pub(crate) fn shape_sd(&self, time_s: f64) -> f64 {
        let Some(k) = self.move_at(time_s).filter(|k| self.paces[*k].is_none()) else { return 0.0 };
        let (from, to) = (&self.stops[k], &self.stops[k + 1]);
        let u = ((time_s - from.depart_s) / (to.arrive_s - from.depart_s).max(SHORTEST_S)).clamp(0.0, 1.0);
        SHAPE_SD * (to.strain - from.strain).abs() * 4.0 * u * (1.0 - u)
    }

    /// Returns the motion with its stops displaced by `z`.
    fn moved(&self, z: &DVector<f64>) -> Moved<'_> {
        let mut rest = z.iter().copied();
        let mut next = || rest.next().unwrap_or(0.0);
        let mut before_s = f64::NEG_INFINITY;
        let mut stops = self.stops.clone();
        for stop in &mut stops {
            let shift = stop.time_sd_s * next();
            stop.strain += stop.strain_sd * next();
            let end_shift = if stop.is_hold { stop.time_sd_s * next() } else { shift };
            // Stops keep their order.
            stop.arrive_s = (stop.arrive_s + shift).max(before_s + SHORTEST_S);
            stop.depart_s = (stop.depart_s + end_shift).max(stop.arrive_s);
            before_s = stop.depart_s;
        }
        let inner = |pace: &Option<Pace>| pace.as_ref().map(|_| std::array::from_fn(|_| next()));
        let inner = self.paces.iter().map(inner).collect();
        Moved { motion: self, stops, inner }
    }
}

/// A motion with given parameters.
struct Moved<'a> {
    motion: &'a MarkedMotion,
    stops: Vec<Stop>,
    inner: Vec<Option<[f64; INNER_KNOTS]>>,
}

impl Moved<'_> {
    fn strain(&self, time_s: f64) -> f64 {
        if self.motion.move_at(time_s).is_none() {
            return f64::NAN;
        }
        let next = self.stops.partition_point(|stop| stop.arrive_s <= time_s);
        let before = next.checked_sub(1).and_then(|k| self.stops.get(k));
        // The ends may have moved inward: the body has then already arrived, or has not yet left.
        let (from, to) = match (before, self.stops.get(next)) {
            (Some(from), Some(to)) => (from, to),
            (Some(only), None) | (None, Some(only)) => return only.strain,
            (None, None) => return f64::NAN,
        };
        let u = ((time_s - from.depart_s) / (to.arrive_s - from.depart_s).max(SHORTEST_S)).clamp(0.0, 1.0);
        let distance = to.strain - from.strain;
        let Some((pace, inner)) = self.motion.paces[next - 1].as_ref().zip(self.inner[next - 1].as_ref()) else {
            return from.strain + distance * progress(u, self.motion.shape);
        };
        // A move between equal strains may still deviate from them.
        let reach = distance.abs().max(0.1 * self.motion.span).copysign(distance);
        from.strain + distance * pace.progress(u) + reach * pace.deviation(u, inner)
    }
}
