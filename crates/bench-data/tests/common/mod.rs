//! Quantities of a simulated sensor, measured on its recordings as on a real bench.

use ohmstrain_bench_data::simulate::{Disturbances, Material, Protocol, SimulationSettings, simulate};

/// A bench without disturbances, so that findings are properties of the sensor.
#[derive(Clone, Copy)]
pub struct Bench {
    pub material: Material,
    pub mismatched: bool,
}

/// Times, strains and R/R₀ of a recording.
pub struct Curve {
    pub time_s: Vec<f64>,
    pub strain: Vec<f64>,
    pub ratio: Vec<f64>,
}

impl Bench {
    pub fn record(self, protocol: Protocol, elongation_mm: f64, speed_mm_s: f64) -> Curve {
        let settings = SimulationSettings {
            elongation_mm,
            speed_mm_s,
            mismatched: self.mismatched,
            disturbances: Disturbances::NONE,
            sample_rate_hz: 50.0,
            ..SimulationSettings::new(self.material, protocol)
        };
        let trace = simulate(&settings).unwrap();
        let rest_ohm = self.material.rest_resistance_ohm();
        Curve {
            time_s: trace.time_s,
            strain: trace.reference.unwrap().values,
            ratio: trace.readings.values.iter().map(|ohm| ohm / rest_ohm).collect(),
        }
    }

    /// Returns the area of an extend-retract loop in the plane of ε/ε_max and R/R₀, which is the mean gap between its
    /// two branches, for the first and the sixth cycle.
    pub fn loop_areas(self, elongation_mm: f64, speed_mm_s: f64) -> [f64; 2] {
        let curve = self.record(Protocol::ExtendRetract { cycles: 6, rest_s: 0.0 }, elongation_mm, speed_mm_s);
        let ramp_s = elongation_mm / speed_mm_s;
        [0.0, 5.0].map(|cycle| {
            let turn_s = 2.0 + (2.0 * cycle + 1.0) * ramp_s;
            let gap = |share: f64| curve.at(turn_s - share * ramp_s) - curve.at(turn_s + share * ramp_s);
            (0..100).map(|i| gap((f64::from(i) + 0.5) / 100.0).abs()).sum::<f64>() / 100.0
        })
    }

    /// Returns the highest R/R₀ of a first ramp to 10 mm, and its strain.
    pub fn ramp_peak(self, speed_mm_s: f64) -> (f64, f64) {
        let curve = self.record(Protocol::ExtendRetract { cycles: 1, rest_s: 0.0 }, 10.0, speed_mm_s);
        curve.peak(2.0..2.0 + 10.0 / speed_mm_s)
    }

    /// Simulates a ramp to 10 mm, a hold of 290 s, a release and a rest of 290 s.
    pub fn long_hold(self, speed_mm_s: f64) -> LongHold {
        let curve = self.record(Protocol::ExtendHold { cycles: 1, hold_s: 290.0, rest_s: 290.0 }, 10.0, speed_mm_s);
        let ramp_s = 10.0 / speed_mm_s;
        LongHold { curve, start_s: 2.0 + ramp_s, ramp_s }
    }
}

/// A recording of a long hold with the time at which the hold starts.
pub struct LongHold {
    pub curve: Curve,
    pub start_s: f64,
    pub ramp_s: f64,
}

impl LongHold {
    /// Returns the fraction of R that is lost within `after_s` seconds of the hold.
    pub fn lost(&self, after_s: f64) -> f64 {
        1.0 - self.curve.at(self.start_s + after_s) / self.curve.at(self.start_s)
    }

    /// Returns the highest R/R₀ of the release, and its strain.
    pub fn release_peak(&self) -> (f64, f64) {
        self.curve.peak(self.start_s + 290.0..self.start_s + 290.0 + self.ramp_s)
    }

    /// Returns R/R₀ - 1 at the end of the rest.
    pub fn left(&self) -> f64 {
        self.curve.ratio[self.curve.ratio.len() - 1] - 1.0
    }
}

impl Curve {
    /// Returns R/R₀ at a time, interpolated linearly.
    pub fn at(&self, time_s: f64) -> f64 {
        let next = self.time_s.partition_point(|time| *time < time_s).clamp(1, self.time_s.len() - 1);
        let share = (time_s - self.time_s[next - 1]) / (self.time_s[next] - self.time_s[next - 1]);
        self.ratio[next - 1] + share * (self.ratio[next] - self.ratio[next - 1])
    }

    /// Returns the highest R/R₀ within a time span, and its strain.
    pub fn peak(&self, span_s: std::ops::Range<f64>) -> (f64, f64) {
        (0..self.time_s.len())
            .filter(|i| span_s.contains(&self.time_s[*i]))
            .map(|i| (self.ratio[i], self.strain[i]))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap()
    }
}
