/// Returns the squared distance of readings from the nearest of `rows`, averaged over channels, in units of the channels' typical
/// differences. NaN marks a channel that is not compared; if none is compared, the distance is zero.
#[must_use]
pub fn distance<'a>(ln_r: &[f64], rows: impl Iterator<Item = &'a [f64]>, channel_sd: &[f64]) -> f64 {
    let compared = ln_r.iter().filter(|value| value.is_finite()).count();
    if compared == 0 {
        return 0.0;
    }
    let squared = |row: &[f64]| {
        let terms = ln_r.iter().zip(row).zip(channel_sd).filter(|((value, _), _)| value.is_finite());
        terms.map(|((value, of_row), sd)| ((value - of_row) / sd).powi(2)).sum::<f64>()
    };
    rows.map(squared).fold(f64::INFINITY, f64::min) / compared as f64
}
