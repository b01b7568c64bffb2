use ohmstrain_ekf::correction;

/// A low-pass over readings with known times.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LowPass {
    low_pass: correction::LowPass<f64>,
    last_s: Option<f64>,
}

impl LowPass {
    pub(crate) fn new(tau_s: f64) -> Self {
        Self { low_pass: correction::LowPass::new(tau_s), last_s: None }
    }

    pub(crate) const fn tau_s(&self) -> f64 {
        self.low_pass.tau_s()
    }

    /// Adds a reading and returns the low-pass at its time.
    pub(crate) fn next(&mut self, time_s: f64, reading: f64) -> f64 {
        let dt_s = time_s - self.last_s.unwrap_or(time_s);
        self.last_s = Some(time_s);
        self.low_pass.next(dt_s, reading)
    }
}
