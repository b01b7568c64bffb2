use crate::import::motion_fit::{Blocks, Motion, Pull};

/// Blocks of the jackknife.
const ALIGNED_BLOCKS: usize = 10;
/// Offsets tried in the time of one full stretch, at first …
const COARSE_STEPS: f64 = 12.0;
/// … and between two of those, about the best of them.
const FINE_STEPS: i32 = 8;
/// Offsets leave at least this share of the shorter recording in common with the longer one.
const LEAST_OVERLAP: f64 = 0.4;
/// What is slower than so many full stretches is taken out …
const SLOW: f64 = 2.0;
/// … and, to see how much that matters, these.
const OTHER_SLOW: [f64; 2] = [1.0, 4.0];
/// Above this unexplained share of the readings' variance the motion does not show in them.
const MOST_UNEXPLAINED: f64 = 0.6;
/// Less than this unexplained share is as good.
const EXPLAINED: f64 = 1e-3;
/// Another offset is worse only if that shows in the blocks by this many standard errors.
const SURE: f64 = 3.0;

/// What to add to the reference's clock to get the readings'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// s.
    pub seconds: f64,
    /// Standard deviation, s: by leaving out a tenth of the readings at a time, and by what counts as slow.
    pub sd_s: f64,
    /// Share of the readings' variance that the reference leaves unexplained at this offset.
    pub unexplained: f64,
}

/// Why the motion does not tell an offset.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OffsetError {
    /// Too little of either.
    #[error("too few rows with readings or reference, or no motion")]
    Short,
    /// The reference explains too little of the readings.
    #[error("the motion does not show in the readings ({:.0} % of their variance stays unexplained at best)", 100.0 * .0)]
    Unseen(f64),
    /// The best offset is the largest one tried.
    #[error("the best offset, {0:.3} s, is the farthest that was tried")]
    AtEnd(f64),
    /// The motion repeats.
    #[error("the motion repeats, {0:.3} s and {1:.3} s fit alike")]
    Ambiguous(f64, f64),
}

/// The offset between the clocks of readings and reference, each `(times, values)`, by the motion that both show.
///
/// At each offset within ± `within_s` (all that leave two fifths in common, if there is no limit), the readings are
/// regressed on what the reference says of them there: its first three powers, and its movements, with and without their
/// sign, through low-passes of one and eight times the time of a full stretch. Differences that are slower than two full
/// stretches are larger than what an offset changes, and are taken out of both sides. The logarithm of what stays unexplained counts
/// by the share of the motion that has a counterpart: like movements fit when they are shifted by one, but the first of them is lost.
/// The best offset is the minimum of the parabola through the least unexplained variances. A sensor that answers a movement late looks like a clock that is
/// late: what a sensor has of a lag of its own is part of the answer.
///
/// # Errors
/// [`OffsetError`] if the motion does not tell, with what there is to see.
pub fn motion_offset(
    readings: (&[f64], &[f64]),
    reference: (&[f64], &[f64]),
    within_s: Option<f64>,
) -> Result<Offset, OffsetError> {
    let motion = Motion::new(reference, SLOW).ok_or(OffsetError::Short)?;
    let pull = Pull::new(readings, &motion).ok_or(OffsetError::Short)?;
    let coarse = motion.stretch_s / COARSE_STEPS;
    let coarse = within_s.map_or(coarse, |within| coarse.min(within / COARSE_STEPS));
    let (first, last) = range(&motion, &pull, within_s);
    let count = ((last - first) / coarse).ceil() as usize;
    let offsets: Vec<f64> = (0..=count).map(|i| first + i as f64 * coarse).collect();
    let unexplained = |offset: f64| pull.blocks(&motion, offset, 1).unexplained(None);
    let weighed = |offset: &f64| (1.0 - motion.left_out(&pull, *offset)) * unexplained(*offset).max(EXPLAINED).ln();
    let shares: Vec<f64> = offsets.iter().map(weighed).collect();
    let (best, _) = minimum(&shares).ok_or(OffsetError::Short)?;
    let least = unexplained(offsets[best]);
    if least > MOST_UNEXPLAINED {
        return Err(OffsetError::Unseen(least));
    }
    if best == 0 || best == count {
        return Err(OffsetError::AtEnd(offsets[best]));
    }
    let found = refine(&motion, &pull, offsets[best], coarse);
    if let Some(rival) = rival(&shares, best, (0.5 * motion.stretch_s / coarse).ceil() as usize) {
        let other = refine(&motion, &pull, offsets[rival], coarse);
        if !is_worse(&motion, &pull, &other, &found) {
            return Err(OffsetError::Ambiguous(found.seconds, other.seconds));
        }
    }
    let mut squares = found.sd_s * found.sd_s;
    for slow in OTHER_SLOW {
        let motion = Motion::new(reference, slow).ok_or(OffsetError::Short)?;
        let pull = Pull::new(readings, &motion).ok_or(OffsetError::Short)?;
        let other = refine(&motion, &pull, found.seconds, coarse);
        squares += (other.seconds - found.seconds).powi(2) / OTHER_SLOW.len() as f64;
    }
    Ok(Offset { sd_s: squares.sqrt(), ..found })
}

/// The offsets to try.
fn range(motion: &Motion, pull: &Pull, within_s: Option<f64>) -> (f64, f64) {
    let ((r0, r1), (s0, s1)) = (pull.span(), motion.span());
    let common = LEAST_OVERLAP * (r1 - r0).min(s1 - s0);
    let (first, last) = (r0 + common - s1, r1 - common - s0);
    within_s.map_or((first, last), |within| (first.max(-within), last.min(within)))
}

fn minimum(shares: &[f64]) -> Option<(usize, f64)> {
    let known = shares.iter().copied().enumerate().filter(|(_, share)| share.is_finite());
    known.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The lowest other valley.
fn rival(shares: &[f64], best: usize, apart: usize) -> Option<usize> {
    let is_valley = |i: &usize| {
        *i > 0
            && i + 1 < shares.len()
            && shares[*i] <= shares[i - 1]
            && shares[*i] <= shares[i + 1]
            && i.abs_diff(best) > apart
    };
    (0..shares.len()).filter(is_valley).min_by(|a, b| shares[*a].total_cmp(&shares[*b]))
}

/// The minimum near an offset, and what it scatters by when blocks are left out.
fn refine(motion: &Motion, pull: &Pull, about: f64, coarse: f64) -> Offset {
    let step = coarse / f64::from(FINE_STEPS);
    let offsets: Vec<f64> = (-2 * FINE_STEPS..=2 * FINE_STEPS).map(|i| about + f64::from(i) * step).collect();
    let all: Vec<Blocks> = offsets.iter().map(|offset| pull.blocks(motion, *offset, ALIGNED_BLOCKS)).collect();
    let without = |left_out: Option<usize>| {
        let shares: Vec<f64> = all.iter().map(|blocks| blocks.unexplained(left_out)).collect();
        let (best, least) = minimum(&shares).unwrap_or((2 * FINE_STEPS as usize, 1.0));
        let around = best.checked_sub(1).and_then(|before| Some((*shares.get(before)?, *shares.get(best + 1)?)));
        let moved = around.map_or(0.0, |(before, after)| {
            let curvature = before - 2.0 * least + after;
            if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 }
        });
        (offsets[best] + moved * step, least)
    };
    let (seconds, unexplained) = without(None);
    let left_out: Vec<f64> = (0..ALIGNED_BLOCKS).map(|block| without(Some(block)).0).collect();
    let mean = left_out.iter().sum::<f64>() / ALIGNED_BLOCKS as f64;
    let squares: f64 = left_out.iter().map(|offset| (offset - mean).powi(2)).sum();
    Offset { seconds, sd_s: (squares * (ALIGNED_BLOCKS - 1) as f64 / ALIGNED_BLOCKS as f64).sqrt(), unexplained }
}

/// Whether the blocks agree that one offset explains less than another.
fn is_worse(motion: &Motion, pull: &Pull, other: &Offset, best: &Offset) -> bool {
    let of = |offset: &Offset| pull.blocks(motion, offset.seconds, ALIGNED_BLOCKS).by_block();
    let more: Vec<f64> =
        of(other).iter().zip(of(best)).map(|(other, best)| other - best).filter(|more| more.is_finite()).collect();
    let n = more.len() as f64;
    let mean = more.iter().sum::<f64>() / n;
    let variance = more.iter().map(|more| (more - mean).powi(2)).sum::<f64>() / (n - 1.0);
    mean > SURE * (variance / n).sqrt()
}
