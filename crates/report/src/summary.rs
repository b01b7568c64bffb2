//! Sentences of the report.

use ohmstrain_sensor::Quantity;

use super::innovations::Innovations;
use super::recording::PlottedRecording;
use super::{Scored, axis};
use ohmstrain::Scores;
use ohmstrain::number::{percent, plain, significant};

/// Returns the result in words.
pub fn headline(recording: &PlottedRecording) -> String {
    match recording.scores.first() {
        Some(row) => scored(&row.scores, recording),
        None if recording.truth.is_some() => "Nothing was scored against the reference.".into(),
        None => "There is no reference, so errors are not known.".into(),
    }
}

fn scored(scores: &Scores, recording: &PlottedRecording) -> String {
    let what = recording.quantity_name();
    let own = match recording.params.quantity {
        Quantity::Strain => format!("{} % strain", significant(100.0 * scores.rmse, 2)),
        Quantity::AngleDeg => format!("{}°", significant(scores.rmse, 2)),
    };
    let part = match recording.scored {
        Scored { from_s: None, until_s: None } => String::new(),
        Scored { from_s: Some(from), until_s: None } => format!(", scored from {} s on", plain(from)),
        Scored { from_s: None, until_s: Some(until) } => format!(", scored until {} s", plain(until)),
        Scored { from_s: Some(from), until_s: Some(until) } => {
            format!(", scored from {} to {} s", plain(from), plain(until))
        }
    };
    let coverage = scores.coverage_95.map_or_else(String::new, |share| {
        format!("; the 95 % interval holds the reference in {} of the rows", percent(share))
    });
    let error = percent(scores.rmse_percent_fs / 100.0);
    format!("{what} to {error} of full scale RMS ({own}), {}{part}{coverage}.", recording.sample.name())
}

/// Describes the length of the recording, and missing data.
pub fn extent_of(recording: &PlottedRecording) -> String {
    let rows = recording.time_s.len();
    let missing = rows.saturating_sub(recording.reading.iter().filter(|reading| reading.is_finite()).count());
    let duration = axis::extent(recording.time_s.iter().copied()).map_or(0.0, |(first, last)| last - first);
    let rows = if rows == 1 { "1 row".into() } else { format!("{rows} rows") };
    let missing = match missing {
        0 => "no reading is missing".into(),
        1 => "1 reading is missing".into(),
        more => format!("{more} readings are missing"),
    };
    format!("The recording has {rows} over {} s; {missing}.", plain(duration))
}

/// Describes the filter's consistency by its innovations.
pub fn consistency(innovations: &Innovations) -> String {
    if innovations.count == 0 {
        return "There is no reading, so there is nothing to compare the filter's predictions with.".into();
    }
    let (low, high) = innovations.mean_square_range();
    let verdict = match innovations.mean_square {
        mean if mean > high => "readings are further from the predictions than the filter expects",
        mean if mean < low => "readings are closer to the predictions than the filter expects",
        _ => "as it should be",
    };
    format!(
        "The mean of NIS, the squared innovation over its predicted variance, is {} over {}: {verdict} \
         (95 % range of a consistent filter: {} to {}). Beyond the 95 % line lie {} of the readings; 5 % should.",
        plain(innovations.mean_square),
        if innovations.count == 1 { "1 reading".into() } else { format!("{} readings", innovations.count) },
        plain(low),
        plain(high),
        percent(innovations.share_beyond),
    )
}
