use ohmstrain_ekf::correction::Decay;

/// Exponential low-pass over readings with known times; it starts settled on the first reading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LowPass {
    tau_s: f64,
    /// Time and value of the last reading; `None` before the first one.
    last: Option<(f64, f64)>,
    value: f64,
}

impl LowPass {
    /// Creates a low-pass before the first reading; the time constant, s, is positive.
    pub(crate) const fn new(tau_s: f64) -> Self {
        Self { tau_s, last: None, value: 0.0 }
    }

    pub(crate) const fn tau_s(&self) -> f64 {
        self.tau_s
    }

    /// Adds a reading and returns the low-pass at its time.
    pub(crate) fn next(&mut self, time_s: f64, reading: f64) -> f64 {
        let moved =
            |(last_s, last): (f64, f64)| Decay::over(time_s - last_s, self.tau_s).moved(self.value, last, reading);
        self.value = self.last.map_or(reading, moved);
        self.last = Some((time_s, reading));
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::LowPass;

    /// A low-pass of a reading that goes straight from one known row to the next, against ten thousand small steps.
    #[test]
    fn low_passes_are_exact_however_long_the_step() {
        let (readings, steps_s) = ([0.2, 0.9, -0.4, 0.1], [0.3, 5.0, 0.0]);
        let (mut low_pass, mut time_s) = (LowPass::new(2.0), 0.0);
        let mut exact: f64 = low_pass.next(time_s, readings[0]);
        for (k, dt_s) in steps_s.into_iter().enumerate() {
            let fine = 10_000;
            for i in 0..fine {
                let share = (f64::from(i) + 0.5) / f64::from(fine);
                let reading = readings[k] + share * (readings[k + 1] - readings[k]);
                let decay = (-dt_s / f64::from(fine) / 2.0_f64).exp();
                exact = decay * exact + (1.0 - decay) * reading;
            }
            time_s += dt_s;
            // The midpoint rule leaves (dt/n)²/24 of a second derivative below one.
            assert!((low_pass.next(time_s, readings[k + 1]) - exact).abs() < 1e-7);
        }
    }
}
