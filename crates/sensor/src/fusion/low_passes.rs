/// Low-passes of ln R of several channels, exact for steps of any length. After a gap, a channel continues from its old state,
/// which has faded with the time constant.
#[derive(Clone, Debug)]
pub struct LowPasses {
    time_constants_s: Vec<f64>,
    /// Time of the last reading of each channel.
    last_s: Vec<Option<f64>>,
    /// State for each time constant and channel.
    states: Vec<Vec<f64>>,
}

impl LowPasses {
    /// Creates low-passes without any reading.
    #[must_use]
    pub fn new(time_constants_s: &[f64], channels: usize) -> Self {
        let states = vec![vec![f64::NAN; channels]; time_constants_s.len()];
        Self { time_constants_s: time_constants_s.to_vec(), last_s: vec![None; channels], states }
    }

    /// Takes ln R of each channel at a time; NaN for a missing reading. The first reading of a channel initialises its
    /// state.
    pub fn step(&mut self, time_s: f64, ln_r: &[f64]) {
        for (channel, value) in ln_r.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let elapsed_s = self.last_s[channel].map(|last_s| time_s - last_s);
            for (state, constant_s) in self.states.iter_mut().zip(&self.time_constants_s) {
                state[channel] = elapsed_s.map_or(*value, |elapsed_s| {
                    state[channel] - (value - state[channel]) * (-elapsed_s / constant_s).exp_m1()
                });
            }
            self.last_s[channel] = Some(time_s);
        }
    }

    /// States: one list of channels for each time constant.
    #[must_use]
    pub fn states(&self) -> &[Vec<f64>] {
        &self.states
    }
}

#[cfg(test)]
mod tests {
    use super::LowPasses;

    /// A step from 0 to 1 at time 0 leaves a low-pass of 2 s at 1 − exp(−t/2) at time t, in any number of steps, also in a channel
    /// that was not read in between.
    #[test]
    fn steps_of_any_length_are_exact() {
        let mut low_passes = LowPasses::new(&[2.0], 2);
        low_passes.step(0.0, &[0.0, 0.0]);
        for time_s in [0.1, 0.5, 0.6, 3.0] {
            low_passes.step(time_s, &[1.0, f64::NAN]);
        }
        low_passes.step(4.0, &[1.0, 1.0]);
        let expected = 1.0 - (-2.0_f64).exp();
        assert!(low_passes.states()[0].iter().all(|state| (state - expected).abs() < 1e-15), "{low_passes:?}");
    }
}
