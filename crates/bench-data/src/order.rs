/// Returns the median of known values, the upper of two middle ones; `None` if there are none.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| !value.is_nan());
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Returns the smallest and the largest of known values; without any the first is larger than the second.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// Longest gap that is bridged, in typical steps.
pub(crate) const LONGEST_GAP: f64 = 10.0;

/// Returns the typical step of times, if they increase.
pub(crate) fn typical_step(times: &[f64]) -> Option<f64> {
    median(times.windows(2).map(|pair| pair[1] - pair[0]).collect()).filter(|step| *step > 0.0)
}
