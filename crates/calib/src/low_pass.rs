/// Exponential low-pass, τ L′ = y − L, exact for readings that move linearly from one known row to the next, however
/// long the step. It starts settled on the first reading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LowPass {
    tau_s: f64,
    /// Time and value of the last reading.
    last: Option<(f64, f64)>,
    value: f64,
}

impl LowPass {
    pub(crate) const fn new(tau_s: f64) -> Self {
        Self { tau_s, last: None, value: 0.0 }
    }

    pub(crate) const fn tau_s(&self) -> f64 {
        self.tau_s
    }

    /// Takes a reading and returns the low-pass at its time.
    pub(crate) fn next(&mut self, time_s: f64, reading: f64) -> f64 {
        self.value = match self.last {
            None => reading,
            Some((last_s, last)) => {
                let x = (time_s - last_s) / self.tau_s;
                // exp(-x), and its mean over the step.
                let (decay, mean_decay) = ((-x).exp(), if x > 0.0 { -(-x).exp_m1() / x } else { 1.0 });
                decay * self.value + (mean_decay - decay) * last + (1.0 - mean_decay) * reading
            }
        };
        self.last = Some((time_s, reading));
        self.value
    }
}
