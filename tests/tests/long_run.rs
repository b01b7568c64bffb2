//! Long runs of a filter in f32: ten million steps in a row, and a day at a thousand readings a second.

use std::ops::Range;

use ohmstrain_ekf::{Belief, Dynamics, Ekf, Reading, seconds_between};
use ohmstrain_model::{Phase, SwitchedModel};
use ohmstrain_tests::{Draws, sensor};

/// Returns the smallest eigenvalue of the correlation matrix.
fn smallest_correlation_eigenvalue<const N: usize, const L: usize>(belief: &Belief<f32, N, L>) -> f64 {
    let p = belief.covariance.to_matrix().map(f64::from);
    nalgebra::DMatrix::from_fn(N, N, |i, j| p[(i, j)] / (p[(i, i)] * p[(j, j)]).sqrt()).symmetric_eigenvalues().min()
}

/// More than a day of a sensor read at 100 Hz.
#[test]
fn ten_million_steps_keep_the_covariance_positive_semi_definite() {
    const STEPS: u32 = 10_000_000;
    const DT_S: f32 = 0.01;
    let model = sensor::<f32, 2, 5>();
    let ekf = Ekf::new(model);
    let prepared = Dynamics::<f32, 5, 15>::prepare(&model, DT_S);
    let mut belief: Belief<f32, 5, 15> = Belief::initial(&model);
    let mut noise = 1_u32;
    for k in 0..STEPS {
        // A slow movement with holds, every seventh reading missing, and a little noise.
        let phase = f64::from(k % 6000) / 6000.0;
        let strain = 0.3 * (2.0 * phase - 0.5).clamp(0.0, 1.0) as f32;
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let jitter = (f64::from(noise) / f64::from(u32::MAX) - 0.5) as f32 * 5e-3;
        let reading = (k % 7 != 0).then(|| Reading::from(1.6 * strain - 1.2 * strain * strain + jitter));
        belief = ekf.step_prepared(&belief, &prepared, reading).unwrap().posterior;
        if k % 1000 == 0 {
            // Rounding of the entries alone changes an eigenvalue by up to 5 · 6e-8.
            let smallest = smallest_correlation_eigenvalue(&belief);
            assert!(smallest > -3e-7, "step {k}: {smallest}");
        }
    }
    assert!(belief.is_finite());
}

type Model<T> = SwitchedModel<T, 1, 4>;
type State<T> = Belief<T, 4, 10>;

const DAY_US: u64 = 86_400_000_000;
const MILLISECOND_US: u64 = 1_000;
const BETWEEN_BURSTS_US: u64 = 250_000;
/// Interval between bursts, and length of half a burst, µs.
const EVERY_US: u64 = 900_000_000;
const BURST_US: u64 = 1_000_000;
/// Time after which a 32-bit count of microseconds wraps.
const WRAP_US: u64 = 1 << 32;

/// Largest difference between the strains of f32 and f64. A step rounds a strain below 0.35, by at most 2⁻²⁶, about ten times in
/// prediction and update, with either sign. It rounds the innovation, a difference of sums below one, four times by at most
/// 2⁻²⁵, of which the gain takes half, because the gauge's slope is two. Thirty seconds, the correlation time of the baseline,
/// contain two thousand steps of a burst and a hundred others, so that the remembered roundings add up to √(2100 · 14) · 2⁻²⁶ =
/// 2.6e-6. Chance never reaches five times that.
const APART: f64 = 1.28e-5;

/// True if the sensor is read every millisecond: in the second before and after every quarter of an hour and every wrap.
fn in_burst(time_us: u64) -> bool {
    [EVERY_US, WRAP_US].into_iter().any(|period| {
        let since = time_us % period;
        since < BURST_US || period - since <= BURST_US
    })
}

/// Returns the times of the readings, µs: a thousand per second in bursts, four otherwise, all with jitter.
fn instants() -> impl Iterator<Item = u64> {
    let mut jitter = Draws::new(7);
    let mut time_us = 0;
    std::iter::from_fn(move || {
        let step = if in_burst(time_us) { MILLISECOND_US } else { BETWEEN_BURSTS_US };
        time_us += step - 20 + (40.0 * jitter.uniform()) as u64;
        (time_us < DAY_US).then_some(time_us)
    })
}

/// Returns the strain and its rate, 1/s: up to 30 % in five seconds, hold, back in five, hold.
fn movement(time_us: u64) -> (f64, f64) {
    let time_s = (time_us % 20_000_000) as f64 * 1e-6;
    match time_s {
        t if t < 5.0 => (0.06 * t, 0.06),
        t if t < 10.0 => (0.3, 0.0),
        t if t < 15.0 => (0.06 * (15.0 - t), -0.06),
        _ => (0.0, 0.0),
    }
}

/// The sensor that the filters assume, read with its noise. Steps are short compared with the branch's time constant.
struct Sensor {
    model: Model<f64>,
    branch: f64,
    noise: Draws,
}

impl Sensor {
    fn read(&mut self, times_us: Range<u64>) -> f32 {
        let (law, dt_s) = (self.model.law(), (times_us.end - times_us.start) as f64 * 1e-6);
        let (strain, rate) = movement(times_us.end);
        let phase = match rate {
            v if v > 0.0 => Phase::Extend,
            v if v < 0.0 => Phase::Retract,
            _ => Phase::Hold,
        };
        let decay = (-dt_s / law.branches[0].tau_s).exp();
        self.branch = self.branch * decay + law.gain(0, strain, phase).0 * rate * dt_s;
        let noise = self.model.noise().reading_sd * self.noise.normal();
        (law.relative_change(strain, rate, &[self.branch], 0.0, phase) + noise) as f32
    }
}

/// Result of a day.
struct Day {
    readings: usize,
    in_bursts: usize,
    wraps: usize,
    /// Largest difference of the strains.
    apart: f64,
    /// Largest error of the strain in the last burst, in standard deviations, of the filter in f64.
    off_sd: f64,
    /// Smallest eigenvalue of the correlation matrix of the filter in f32.
    smallest_eigenvalue: f64,
}

/// Steps both filters through a day. `seconds` returns the length of a step for the filter in f32.
fn day(seconds: impl Fn(Range<u64>) -> f32) -> Day {
    let (single, double) = (Ekf::new(sensor::<f32, 1, 4>()), Ekf::new(sensor::<f64, 1, 4>()));
    let (mut state32, mut state64): (State<f32>, State<f64>) =
        (Belief::initial(single.model()), Belief::initial(double.model()));
    let mut sensor = Sensor { model: *double.model(), branch: 0.0, noise: Draws::new(8) };
    let mut out =
        Day { readings: 0, in_bursts: 0, wraps: 0, apart: 0.0, off_sd: 0.0, smallest_eigenvalue: f64::INFINITY };
    let mut before_us = 0;
    for time_us in instants() {
        let step = before_us..time_us;
        before_us = time_us;
        let rho = sensor.read(step.clone());
        out.readings += 1;
        out.in_bursts += usize::from(in_burst(time_us));
        out.wraps += usize::from(step.start / WRAP_US < step.end / WRAP_US);

        let dt_s = (step.end - step.start) as f64 * 1e-6;
        state64 = double.step(&state64, dt_s, Some(Reading::from(f64::from(rho)))).unwrap().posterior;
        state32 = single.step(&state32, seconds(step), Some(Reading::from(rho))).unwrap().posterior;

        let sd = state64.covariance[(0, 0)].sqrt();
        out.apart = out.apart.max((f64::from(state32.mean[0]) - state64.mean[0]).abs());
        if time_us > DAY_US - BURST_US {
            out.off_sd = out.off_sd.max((state64.mean[0] - movement(time_us).0).abs() / sd);
        }
        if out.readings.is_multiple_of(20) {
            out.smallest_eigenvalue = out.smallest_eigenvalue.min(smallest_correlation_eigenvalue(&state32));
        }
    }
    out
}

/// All 86.4 million steps would take minutes. A day can reveal errors of the clock, which bursts of millisecond steps
/// show at any time of the day, and accumulated rounding, for which half a million steps are enough: even the baseline,
/// the slowest state, forgets within thirty seconds.
#[test]
fn a_day_of_milliseconds_in_f32_is_that_in_f64() {
    let day = day(|step| seconds_between(step.start as u32, step.end as u32));
    assert_eq!(day.wraps, 20);
    assert!(day.in_bursts > 200_000, "{}", day.in_bursts);
    assert!(day.apart < APART, "{:e}", day.apart);
    // Rounding of the entries alone changes an eigenvalue by up to 4 · 6e-8.
    assert!(day.smallest_eigenvalue > -2.4e-7, "{:e}", day.smallest_eigenvalue);
    // Agreement would mean little if both had diverged: in the last burst, the error of the strain is a few standard
    // deviations.
    assert!(day.off_sd < 4.0, "{}", day.off_sd);
}

/// The same day with the mistake that `seconds_between` prevents.
#[test]
fn a_clock_of_f32_seconds_is_off() {
    let clock_s = |time_us: u64| (time_us as f64 * 1e-6) as f32;
    let dt_s = clock_s(DAY_US - MILLISECOND_US) - clock_s(DAY_US - 2 * MILLISECOND_US);
    assert!((dt_s - 1e-3).abs() > 0.9e-3, "a millisecond at the end of the day is {dt_s} s");
    let day = day(|step| clock_s(step.end) - clock_s(step.start));
    assert!(day.apart > 20.0 * APART, "{:e}", day.apart);
}
