use crate::samples::Samples;

/// Returns the longest time, s, for which a reading was repeated in recordings; missing readings do not end a repeat.
pub(crate) fn longest_repeat_s(recordings: &[Samples]) -> f64 {
    let mut longest: f64 = 0.0;
    for samples in recordings {
        let mut run: Option<(f64, f64)> = None;
        let known = samples.time_s.iter().zip(samples.reading).filter(|(_, reading)| !reading.is_nan());
        for (&time_s, &reading) in known {
            match run {
                Some((value, since_s)) if value == reading => longest = longest.max(time_s - since_s),
                _ => run = Some((reading, time_s)),
            }
        }
    }
    longest
}
