use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Uniform};

use super::protocol::LEAD_IN_S;
use super::{Protocol, SimulationSettings};

/// Strain over time, linear between knots.
pub(super) struct Profile {
    time_s: Vec<f64>,
    strain: Vec<f64>,
}

impl Profile {
    /// Computes the strain of a protocol. `random` is used by a person, [`Protocol::LongHolds`] and [`Protocol::Mixed`] only.
    pub(super) fn new(settings: &SimulationSettings, random: &mut ChaCha8Rng) -> Self {
        let (full, rate) = (settings.full_strain(), settings.strain_rate());
        if let Some(followed) = &settings.followed {
            return followed.profile(full, random);
        }
        let mut profile = Self::at(0.0);
        profile.hold(LEAD_IN_S);
        match settings.protocol {
            Protocol::ExtendRetract { cycles, rest_s } => {
                for _ in 0..cycles {
                    profile.ramp(full, rate);
                    profile.ramp(0.0, rate);
                }
                profile.hold(rest_s);
            }
            Protocol::ExtendHold { cycles, hold_s, rest_s } => {
                for _ in 0..cycles {
                    profile.ramp(full, rate);
                    profile.hold(hold_s);
                    profile.ramp(0.0, rate);
                    profile.hold(rest_s);
                }
            }
            Protocol::LoadSteps { step_g, hold_s } => {
                let steps = (Protocol::HEAVIEST_LOAD_G / step_g + 1e-9).floor() as u32;
                for step in 1..=steps {
                    profile.ramp(settings.material.strain_under_load(f64::from(step) * step_g), rate);
                    profile.hold(hold_s);
                }
            }
            Protocol::LongHolds { cycles, hold_s, rest_s } => {
                let mut share = |low: f64| low + (1.0 - low) * unit(random);
                for cycle in 0..cycles {
                    profile.ramp(if cycle == 0 { full } else { full * share(0.4) }, rate * share(0.2));
                    profile.hold(hold_s);
                    profile.ramp(0.0, rate * share(0.2));
                    profile.hold(rest_s * share(0.2));
                }
            }
            Protocol::Mixed { duration_s } => {
                profile.mixed(full, rate, duration_s, random);
                profile.cut(duration_s);
            }
        }
        profile
    }

    /// Starts at a strain, at time zero.
    pub(super) fn at(strain: f64) -> Self {
        Self { time_s: vec![0.0], strain: vec![strain] }
    }

    /// Appends a straight line to a strain; a time in the past is ignored.
    pub(super) fn line_to(&mut self, time_s: f64, strain: f64) {
        if time_s > self.duration_s() {
            self.time_s.push(time_s);
            self.strain.push(strain);
        }
    }

    /// Holds the strain until a time.
    pub(super) fn until(&mut self, time_s: f64) {
        self.hold(time_s - self.duration_s());
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or_default()
    }

    pub(super) fn peak_strain(&self) -> f64 {
        self.strain.iter().copied().fold(0.0, f64::max)
    }

    pub(super) fn segments(&self) -> impl Iterator<Item = [(f64, f64); 2]> {
        let knots = || self.time_s.iter().copied().zip(self.strain.iter().copied());
        knots().zip(knots().skip(1)).map(|(a, b)| [a, b])
    }

    fn last(&self) -> (f64, f64) {
        (self.duration_s(), self.strain.last().copied().unwrap_or_default())
    }

    fn ramp(&mut self, to: f64, rate: f64) {
        let (time_s, strain) = self.last();
        self.line_to(time_s + (to - strain).abs() / rate, to);
    }

    fn hold(&mut self, duration_s: f64) {
        let (time_s, strain) = self.last();
        self.line_to(time_s + duration_s, strain);
    }

    /// Appends blocks in a fixed order, so that each half of the recording has some of every kind, with random sizes and speeds.
    fn mixed(&mut self, full: f64, fastest: f64, duration_s: f64, random: &mut ChaCha8Rng) {
        let mut draw = |low: f64, high: f64| low + (high - low) * unit(random);
        for speed_share in [0.2, 1.0, 0.5].into_iter().cycle() {
            self.ramp(full, speed_share * fastest);
            self.ramp(0.0, speed_share * fastest);
            for _ in 0..3 {
                self.ramp(full * draw(0.2, 1.0), fastest * draw(0.2, 1.0));
                self.hold(draw(4.0, 12.0));
            }
            self.ramp(0.0, fastest * draw(0.2, 1.0));
            self.hold(draw(4.0, 12.0));
            for _ in 0..10 {
                self.ramp(full * draw(0.0, 1.0), fastest * draw(0.1, 1.0));
            }
            if self.duration_s() >= duration_s {
                return;
            }
        }
    }

    /// Ends the profile at `end_s`.
    fn cut(&mut self, end_s: f64) {
        let keep = self.time_s.partition_point(|time| *time < end_s);
        if keep == 0 || keep == self.time_s.len() {
            return;
        }
        let (t0, t1, e0, e1) = (self.time_s[keep - 1], self.time_s[keep], self.strain[keep - 1], self.strain[keep]);
        self.time_s.truncate(keep);
        self.strain.truncate(keep);
        self.line_to(end_s, e0 + (e1 - e0) * (end_s - t0) / (t1 - t0));
    }
}

/// Draws a uniform number in [0, 1).
pub(super) fn unit(random: &mut ChaCha8Rng) -> f64 {
    // The bounds are ordered constants, so the distribution always exists; its mean is a safe fallback.
    Uniform::new(0.0, 1.0).map_or(0.5, |uniform| uniform.sample(random))
}
