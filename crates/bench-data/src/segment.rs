use std::ops::Range;

use ohmstrain_model::Phase;

use crate::order::{LONGEST_GAP, extent, median, typical_step};

/// A range of rows in one phase.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Phase of the body's motion.
    pub phase: Phase,
    /// The rows, end excluded.
    pub rows: Range<usize>,
}

/// Threshold of the rate for a movement, as a fraction of the typical rate, if the reference has little noise.
const QUIET_SHARE: f64 = 0.02;
/// Largest such threshold for noisy references.
const NOISY_SHARE: f64 = 0.08;
/// Factor by which the noise of the rate must stay below the threshold.
const NOISE_MARGIN: f64 = 3.0;
/// Minimum duration of a segment, as a fraction of the time of a full stretch at the typical rate.
const SHORTEST_SHARE: f64 = 0.12;
/// Minimum distance of a movement, as a fraction of a full stretch.
const SMALLEST_SHARE: f64 = 0.01;
/// Widest window of the rate, rows to each side.
const WIDEST: usize = 128;

/// Cuts a reference into phases. The segments are in order and cover all rows but those of long gaps; adjoining ones differ
/// in phase.
///
/// The rate is the slope of a straight line through a window of rows, which is widened until the reference's own noise
/// no longer reaches the threshold. The threshold is 2 to 8 % of the *typical* rate, depending on the noise. The
/// typical rate is that at which half the distance is travelled, so that long holds do not count. A part that is
/// shorter than the window, or than 12 % of the time of a full stretch, is merged into its neighbours; a movement of
/// less than 1 % of a full stretch is a hold. Missing values (NaN) are interpolated linearly, but for gaps longer than ten
/// steps and than the shortest part.
///
/// ```
/// use ohmstrain_bench_data::segment;
/// use ohmstrain_model::Phase;
/// let time_s: Vec<f64> = (0..300).map(|i| f64::from(i) * 0.1).collect();
/// let strain: Vec<f64> = time_s.iter().map(|t| (t - 10.0).clamp(0.0, 10.0) * 0.03).collect();
/// let phases: Vec<Phase> = segment(&time_s, &strain).iter().map(|segment| segment.phase).collect();
/// assert_eq!(phases, [Phase::Hold, Phase::Extend, Phase::Hold]);
/// ```
#[must_use]
pub fn segment(time_s: &[f64], strain: &[f64]) -> Vec<Segment> {
    let rows = time_s.len().min(strain.len());
    let (time_s, reference) = (&time_s[..rows], &strain[..rows]);
    let strain = &bridge(time_s, reference);
    if rows == 0 {
        return Vec::new();
    }
    let motion = VisibleMotion::estimate(time_s, strain);
    let phase = |rate: &f64| match *rate {
        rate if rate > motion.threshold => Phase::Extend,
        rate if rate < -motion.threshold => Phase::Retract,
        _ => Phase::Hold,
    };
    let mut segments = runs(motion.rate.iter().map(phase));
    merge_short(&mut segments, time_s, motion.shortest_s);
    still_small(&mut segments, strain);
    merge_short(&mut segments, time_s, motion.shortest_s);
    let segments = gaps(time_s, reference, motion.shortest_s).iter().fold(segments, without);
    // The ends of a line across a gap reach a window's width beyond it.
    let merged = |part: &[Segment]| {
        let mut part = part.to_vec();
        merge_short(&mut part, time_s, motion.shortest_s);
        part
    };
    segments.chunk_by(|a, b| a.rows.end == b.rows.start).flat_map(merged).collect()
}

/// Returns the rows without a reference where it is missing for longer than `least_s` and than ten of its usual steps.
fn gaps(time_s: &[f64], reference: &[f64], least_s: f64) -> Vec<Range<usize>> {
    let known: Vec<usize> = (0..reference.len()).filter(|row| reference[*row].is_finite()).collect();
    let (Some(first), Some(last)) = (known.first(), known.last()) else { return Vec::new() };
    let known_s: Vec<f64> = known.iter().map(|row| time_s[*row]).collect();
    let longest_s = (LONGEST_GAP * typical_step(&known_s).unwrap_or(0.0)).max(least_s);
    let inner = known.windows(2).map(|pair| (pair[0] + 1..pair[1], pair[0], pair[1]));
    let ends = [(0..*first, 0, *first), (last + 1..reference.len(), *last, reference.len() - 1)];
    let all = inner.chain(ends).filter(|(rows, ..)| !rows.is_empty());
    all.filter(|(_, a, b)| time_s[*b] - time_s[*a] > longest_s).map(|(rows, ..)| rows).collect()
}

/// Returns the segments without the rows of a gap.
fn without(segments: Vec<Segment>, gap: &Range<usize>) -> Vec<Segment> {
    let parts = |Segment { phase, rows }| {
        let (before, after) = (rows.start..rows.end.min(gap.start), rows.start.max(gap.end)..rows.end);
        [before, after].into_iter().filter(|rows| !rows.is_empty()).map(move |rows| Segment { phase, rows })
    };
    segments.into_iter().flat_map(parts).collect()
}

/// Motion of the body, to the extent that it exceeds the noise.
struct VisibleMotion {
    rate: Vec<f64>,
    threshold: f64,
    shortest_s: f64,
}

impl VisibleMotion {
    fn estimate(time_s: &[f64], strain: &[f64]) -> Self {
        let noise = noise_sd(time_s, strain);
        let step_s = median(time_s.windows(2).map(|pair| pair[1] - pair[0]).collect()).unwrap_or(1.0);
        let mut half = 1;
        loop {
            let rate = slopes(time_s, strain, half);
            let typical = typical_rate(time_s, &rate);
            let threshold = (NOISE_MARGIN * slope_sd(noise, half, step_s)).max(QUIET_SHARE * typical);
            if half >= WIDEST || threshold <= NOISY_SHARE * typical {
                let window_s = 2.0 * half as f64 * step_s;
                let shortest_s = window_s.max(SHORTEST_SHARE * span(strain) / typical);
                // Without motion the typical rate is zero; the fraction is then NaN, which `max` ignores.
                return Self { rate, threshold, shortest_s };
            }
            half *= 2;
        }
    }
}

/// Interpolates gaps linearly; returns zeros if there is no value at all.
fn bridge(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    let known: Vec<usize> = (0..values.len()).filter(|i| values[*i].is_finite()).collect();
    let mut out = values.to_vec();
    let (Some(first), Some(last)) = (known.first(), known.last()) else { return vec![0.0; values.len()] };
    out[..*first].fill(values[*first]);
    out[*last..].fill(values[*last]);
    for pair in known.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        for i in a + 1..b {
            out[i] = values[a] + (values[b] - values[a]) * (time_s[i] - time_s[a]) / (time_s[b] - time_s[a]);
        }
    }
    out
}

/// Returns the standard deviation of the reference's noise, from the distance of each value from the line between its
/// neighbours.
///
/// The median excludes corners and steps, and is scaled to a normal distribution. If the resolution is coarser than the
/// noise, most distances are zero; then the mean of the lower nine tenths, without the zeros, is used.
pub(crate) fn noise_sd(time_s: &[f64], values: &[f64]) -> f64 {
    let mut deviations: Vec<f64> = (1..values.len().saturating_sub(1))
        .map(|i| {
            let share = (time_s[i] - time_s[i - 1]) / (time_s[i + 1] - time_s[i - 1]);
            let line = values[i - 1] + share * (values[i + 1] - values[i - 1]);
            (values[i] - line).abs() / (1.0 + share * share + (1.0 - share) * (1.0 - share)).sqrt()
        })
        .collect();
    deviations.sort_by(f64::total_cmp);
    let kept = &deviations[..deviations.len() * 9 / 10];
    if kept.is_empty() {
        return 0.0;
    }
    let mean = kept.iter().sum::<f64>() / kept.len() as f64;
    (deviations[deviations.len() / 2] / 0.6745).max(mean)
}

/// Returns the standard deviation of the slope of a line through `2 half + 1` values: `σ √(12 / n(n²-1)) / Δt`.
fn slope_sd(noise_sd: f64, half: usize, step_s: f64) -> f64 {
    let n = (2 * half + 1) as f64;
    noise_sd * (12.0 / (n * (n * n - 1.0))).sqrt() / step_s
}

/// Returns the slope of the line through each row and `half` rows to both sides, fewer at the ends.
fn slopes(time_s: &[f64], values: &[f64], half: usize) -> Vec<f64> {
    (0..values.len())
        .map(|i| {
            let window = i.saturating_sub(half)..(i + half + 1).min(values.len());
            let n = window.len() as f64;
            let mean_time = window.clone().map(|j| time_s[j] - time_s[i]).sum::<f64>() / n;
            let (mut product, mut square) = (0.0, 0.0);
            for j in window {
                let t = time_s[j] - time_s[i] - mean_time;
                product += t * (values[j] - values[i]);
                square += t * t;
            }
            if square > 0.0 { product / square } else { 0.0 }
        })
        .collect()
}

/// Returns the rate at which half the distance is travelled.
fn typical_rate(time_s: &[f64], rate: &[f64]) -> f64 {
    let mut ways: Vec<(f64, f64)> =
        (1..rate.len()).map(|i| (rate[i].abs(), rate[i].abs() * (time_s[i] - time_s[i - 1]))).collect();
    ways.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = ways.iter().map(|(_, way)| way).sum::<f64>() / 2.0;
    let mut travelled = 0.0;
    for (rate, way) in ways {
        travelled += way;
        if travelled >= half {
            return rate;
        }
    }
    0.0
}

fn runs(phases: impl Iterator<Item = Phase>) -> Vec<Segment> {
    let mut out: Vec<Segment> = Vec::new();
    for (row, phase) in phases.enumerate() {
        match out.last_mut() {
            Some(last) if last.phase == phase => last.rows.end = row + 1,
            _ => out.push(Segment { phase, rows: row..row + 1 }),
        }
    }
    out
}

/// Converts movements that go nowhere, such as the sway of a body at rest, to holds, and joins them with neighbouring
/// holds.
fn still_small(segments: &mut Vec<Segment>, strain: &[f64]) {
    let smallest = SMALLEST_SHARE * span(strain);
    for segment in segments.iter_mut() {
        if (strain[segment.rows.end - 1] - strain[segment.rows.start]).abs() < smallest {
            segment.phase = Phase::Hold;
        }
    }
    segments.dedup_by(|next, last| {
        let same = next.phase == last.phase;
        if same {
            last.rows.end = next.rows.end;
        }
        same
    });
}

/// Merges segments that are too short into their neighbours, the shortest first; one between two others is split.
fn merge_short(segments: &mut Vec<Segment>, time_s: &[f64], shortest_s: f64) {
    let end_s = |row: usize| time_s[row.min(time_s.len() - 1)];
    let duration = |segment: &Segment| end_s(segment.rows.end) - time_s[segment.rows.start];
    while segments.len() > 1 {
        let shortest = (0..segments.len()).min_by(|a, b| duration(&segments[*a]).total_cmp(&duration(&segments[*b])));
        let Some(i) = shortest.filter(|i| duration(&segments[*i]) < shortest_s) else { break };
        let gone = segments.remove(i);
        let middle = match i {
            0 => gone.rows.start,
            i if i == segments.len() => gone.rows.end,
            _ => usize::midpoint(gone.rows.start, gone.rows.end),
        };
        if i > 0 {
            segments[i - 1].rows.end = middle;
        }
        if i < segments.len() {
            segments[i].rows.start = middle;
        }
        if i > 0 && i < segments.len() && segments[i - 1].phase == segments[i].phase {
            segments[i - 1].rows.end = segments[i].rows.end;
            segments.remove(i);
        }
    }
}

fn span(values: &[f64]) -> f64 {
    let (low, high) = extent(values.iter().copied());
    high - low
}
