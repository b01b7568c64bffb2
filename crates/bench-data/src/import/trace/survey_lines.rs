//! Survey of a recording in words.

use crate::counted::counted;
use crate::import::trace::survey::{ChannelSurvey, ClockSurvey, PhaseSurvey, Survey};

impl Survey {
    /// Returns names and sentences for people. A sentence that continues the one before has no name.
    #[must_use]
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let mut lines = vec![("clock", clock_line(&self.clock)), ("readings", channel_line(&self.readings))];
        lines.extend(allan_line(&self.readings, self.reference.is_some()).map(|allan| ("", allan)));
        let flips = |share| format!("flips with every reading: neighbours differ by {:.2} %", 100.0 * share);
        lines.extend(self.alternation.map(|share| ("polarity", flips(share))));
        lines.extend(self.drift.map(|drift| ("drift", self.drift_line(drift))));
        lines.extend(self.reference.iter().map(|reference| ("reference", channel_line(reference))));
        lines.extend(self.phases.iter().map(|phases| ("phases", phases_line(phases))));
        lines.extend(self.lag_line().map(|lag| ("lag", lag)));
        lines
    }

    fn drift_line(&self, drift: f64) -> String {
        let rest =
            if self.reference.is_some() { "at rest, from the first to the last time" } else { "from start to end" };
        format!("{:+.2} % {rest}", 100.0 * drift)
    }

    fn lag_line(&self) -> Option<String> {
        let Some(lag) = self.lag else { return self.lag_unknown.as_ref().map(|why| format!("not known: {why}")) };
        let (word, seconds) = if lag.lag_s < 0.0 { ("leads", -lag.lag_s) } else { ("lags", lag.lag_s) };
        let doubt = if lag.is_sure() { "" } else { "; not significant" };
        Some(format!(
            "the reference {word} the readings by {seconds:.3} ± {:.3} s, for ± {:.3} s of which the sensor's own delay may account{doubt}",
            lag.sd_s.hypot(lag.own_s),
            lag.own_s
        ))
    }
}

fn clock_line(clock: &ClockSurvey) -> String {
    let ms = |seconds: f64| number(1e3 * seconds);
    let mut line = format!(
        "{} Hz: steps of {} ms, 90 % of them {} to {} ms; {} s",
        number(1.0 / clock.step_s),
        ms(clock.step_s),
        ms(clock.step_range_s.0),
        ms(clock.step_range_s.1),
        number(clock.span_s.1 - clock.span_s.0)
    );
    if clock.gaps.0 > 0 {
        line += &format!("; {}, the longest {} s", counted(clock.gaps.0, "gap"), number(clock.gaps.1));
    }
    line + &format!("; {}", counted(clock.duplicates, "duplicate"))
}

fn channel_line(channel: &ChannelSurvey) -> String {
    let mut line = format!("{} to {}, {} missing", number(channel.range.0), number(channel.range.1), channel.counts.1);
    for (count, end) in [(channel.clipped.0, "smallest"), (channel.clipped.1, "largest")] {
        if count > 0 {
            line += &format!("; {count} clipped at the {end}");
        }
    }
    format!("{line}; noise {} from row to row", number(channel.noise))
}

fn allan_line(channel: &ChannelSurvey, has_reference: bool) -> Option<String> {
    let first = channel.allan.first()?;
    let least = channel.allan.iter().min_by(|a, b| a.deviation.total_cmp(&b.deviation))?;
    let at = |deviation: f64, tau_s: f64| format!("{} over {} s", number(deviation), number(tau_s));
    Some(format!(
        "Allan deviation{} {}, least {}",
        if has_reference { " in the longest hold" } else { "" },
        at(first.deviation, first.tau_s),
        at(least.deviation, least.tau_s)
    ))
}

fn phases_line(survey: &PhaseSurvey) -> String {
    let names = [("stretch", "stretches"), ("hold", "holds"), ("release", "releases")];
    let phases = survey.phases.iter().zip(names).map(|((count, seconds), (one, many))| {
        format!("{count} {} ({} s)", if *count == 1 { one } else { many }, number(*seconds))
    });
    phases.collect::<Vec<_>>().join(", ")
}

/// Formats a number with four digits.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (3 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
