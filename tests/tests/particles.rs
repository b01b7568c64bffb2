//! The particle filter beyond linear models: on data from its own process it is calibrated, also after long holds; where
//! directions matter, it agrees with Gaussians truncated by direction; stops work; and invalid input is rejected.

use ohmstrain_ekf::{Belief, Dwell, Estimate, Evidence, Mixture, Reading, Settling, SignSplit, State, StepError};
use ohmstrain_model::{Phase, Scalar, StrainRange};
use ohmstrain_tests::particles::{ParticleCloud, Particles};
use ohmstrain_tests::sensor;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

type Cloud = ParticleCloud<f64, 5, 15>;

const DT_S: f64 = 0.1;

fn within<T: Scalar>(lower: f64, upper: f64) -> Evidence<T> {
    Evidence { limits: StrainRange { lower: T::of(lower), upper: T::of(upper) }, tempering: T::one() }
}

fn normal(rng: &mut ChaCha12Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn uniform(rng: &mut ChaCha12Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// The process of [`sensor`] with holds, in Euler steps of a twentieth of a step, written from the equations in NOTATION.md
/// with the sensor's numbers.
struct Process {
    rng: ChaCha12Rng,
    dwell_s: Option<(f64, f64)>,
    holds: bool,
    strain: f64,
    rate: f64,
    branches: [f64; 2],
    baseline: f64,
}

impl Process {
    /// Starts the process in its long-run distribution; `dwell_s`: mean durations of holds and of movements between them.
    fn new(dwell_s: Option<(f64, f64)>, seed: u64) -> Self {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut draw = |sd: f64| sd * normal(&mut rng);
        let (strain, rate, branches, baseline) = (0.15 + draw(0.1), draw(0.05), [draw(5e-3), draw(5e-3)], draw(0.02));
        Self { rng, dwell_s, holds: false, strain, rate, branches, baseline }
    }

    fn step(&mut self) -> f64 {
        const SUBSTEPS: u32 = 20;
        let h = DT_S / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            if let Some((hold_s, move_s)) = self.dwell_s {
                if self.holds && uniform(&mut self.rng) < h / hold_s {
                    self.holds = false;
                    self.rate = 0.05 * normal(&mut self.rng);
                } else if !self.holds && uniform(&mut self.rng) < h / move_s {
                    self.holds = true;
                }
            }
            let rate = if self.holds { 0.0 } else { self.rate };
            let strain = self.strain.clamp(-0.02, 0.35);
            let gain = if rate > 0.0 { 0.8 - 0.6 * strain } else { -0.5 - 0.4 * strain };
            for (c, tau_s) in self.branches.iter_mut().zip([4.0, 32.0]) {
                *c += h * (gain * rate - *c / tau_s) + 5e-3 * (2.0 * h / tau_s).sqrt() * normal(&mut self.rng);
            }
            self.baseline += -self.baseline * h / 30.0 + 0.02 * (2.0 * h / 30.0).sqrt() * normal(&mut self.rng);
            let pull = (0.05_f64 / 0.1).powi(2) * (self.strain - 0.15);
            self.strain += h * rate;
            self.rate += -h * (self.rate / 1.5 + pull) + 0.05 * (2.0 * h / 1.5).sqrt() * normal(&mut self.rng);
        }
        let inside = self.strain.clamp(-0.02, 0.35);
        let gauge = |e: f64| e * (1.6 + e * (-1.2 + e * 0.5));
        let slope = 1.6 + inside * (-2.4 + inside * 1.5);
        let rate = if self.holds { 0.0 } else { self.rate };
        let dash_pot = if rate > 0.0 { 0.02 } else { -0.01 } * rate;
        gauge(inside)
            + slope * (self.strain - inside)
            + dash_pot
            + self.branches.iter().sum::<f64>()
            + self.baseline
            + 2e-3 * normal(&mut self.rng)
    }
}

/// Checks readings of 10 s from a hundred bodies. With correct predictive moments, NIS has mean one whatever its
/// distribution; the mean of a hundred averages is known to a tenth of their spread. On average 95 of 100 intervals
/// cover the strain, and at least 88 in 99.8 % of cases (binomial).
fn check_calibration(dwell_s: Option<(f64, f64)>) {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    // A body that starts in either direction with equal probability turns around by its rate, not by the chain:
    // reversal 0.
    let hold = dwell_s.map(|(hold_s, move_s)| Dwell::new(hold_s, move_s, 0.0).unwrap());
    let (mut averages, mut covered) = (Vec::new(), 0);
    for seed in 0..100 {
        let filter = Particles::new(model, hold, within(-10.0, 10.0), 2000, seed);
        let mut process = Process::new(dwell_s, 1000 + seed);
        let mut cloud: Cloud = filter.start(&Belief::initial(&model), Phase::Extend);
        let mut sum = 0.0;
        for _ in 0..100 {
            let reading = Some(Reading::from(process.step()));
            let step = filter.step_prepared(&cloud, &prepared, DT_S, reading).unwrap();
            cloud = step.posterior;
            sum += step.nis.unwrap();
        }
        averages.push(sum / 100.0);
        let (wide, settling) = (StrainRange { lower: -10.0, upper: 10.0 }, Settling::unseen(model.noise(), 1));
        let strain = Estimate::new(&model, &cloud.moments(), &wide, 1.0, &settling).strain;
        covered += u32::from((strain.mean - process.strain).abs() < 1.96 * strain.sd());
    }
    let mean = averages.iter().sum::<f64>() / 100.0;
    let spread = (averages.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 99.0).sqrt();
    assert!((mean - 1.0).abs() < 4.0 * spread / 10.0, "{mean} ± {}", spread / 10.0);
    assert!(covered >= 88, "{covered} of 100");
}

#[test]
fn on_its_own_process_it_is_calibrated() {
    check_calibration(None);
    check_calibration(Some((2.0, 2.0)));
}

/// Ten seconds of motion, then a hold of 300 s, 15 times the mean duration that the filter expects: particles keep
/// starting to move, and in the end only copies of those that did not are left. Without the kernel, less than a quarter
/// of them would be distinct.
#[test]
fn long_holds_do_not_use_the_particles_up() {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    let dwell = Dwell::new(20.0, 5.0, 0.0).unwrap();
    let (mut covered, mut squares) = (0, 0.0);
    for seed in 0..20 {
        let filter = Particles::new(model, Some(dwell), within(-10.0, 10.0), 1000, seed);
        let mut process = Process::new(None, 2000 + seed);
        let mut cloud: Cloud = filter.start(&Belief::initial(&model), Phase::Extend);
        for k in 0..3100 {
            process.holds = k >= 100;
            let reading = Some(Reading::from(process.step()));
            cloud = filter.step_prepared(&cloud, &prepared, DT_S, reading).unwrap().posterior;
        }
        let mut strains: Vec<f64> = cloud.particles().iter().map(|p| p.state[0]).collect();
        strains.sort_unstable_by(f64::total_cmp);
        strains.dedup();
        assert!(strains.len() > 500, "{} different strains", strains.len());
        // Particles that started to move within the last second or two, one in twenty per second, may not have been
        // rejected yet.
        assert!(cloud.phase_probabilities()[1] > 0.5);
        let moments = cloud.moments();
        let error = moments.mean[0] - process.strain;
        let variance = moments.covariance[(0, 0)];
        covered += u32::from(error * error < 1.96 * 1.96 * variance);
        squares += error * error / variance;
    }
    // Of 20 intervals of 95 %, 16 or more cover in 99.7 % of cases; 99.9 % of χ² with 20 degrees of freedom is below 45.3.
    assert!(covered >= 16, "{covered} of 20");
    assert!(squares < 45.3, "{squares}");
}

/// A sign-split mixture of many Gaussians is close to the posterior that particles sample where directions decide. A mean
/// off by d standard deviations costs d²/2 nats of the log score per row; a standard deviation wrong by a factor f costs
/// ln² f. Both stay below 0.05 nats. The average over eight clouds removes most of the particles' own scatter.
#[test]
fn it_agrees_with_gaussians_cut_by_direction() {
    const CLOUDS: usize = 8;
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    let evidence = within(-0.1, 0.45);
    let split = SignSplit::<f64, 2, 5, 24>::new(model, DT_S, None, evidence).unwrap();
    let mut mixture = Mixture::<f64, 5, 15, 24>::single(Belief::initial(&model), Phase::Extend);
    let filters: [_; CLOUDS] = std::array::from_fn(|i| Particles::new(model, None, evidence, 4000, i as u64));
    let mut clouds: [Cloud; CLOUDS] = filters.each_ref().map(|f| f.start(&Belief::initial(&model), Phase::Extend));
    let mut process = Process::new(None, 9);
    let (mut mean_cost, mut deviation_cost, mut odds_apart) = (0.0, 0.0, 0.0);
    const STEPS: u32 = 200;
    for _ in 0..STEPS {
        let reading = Some(Reading::from(process.step()));
        split.step(&mut mixture, reading).unwrap();
        for (filter, cloud) in filters.iter().zip(&mut clouds) {
            *cloud = filter.step_prepared(cloud, &prepared, DT_S, reading).unwrap().posterior;
        }
        let average = |of: &dyn Fn(&Cloud) -> f64| clouds.iter().map(of).sum::<f64>() / CLOUDS as f64;
        let mean = average(&|cloud| cloud.moments().mean[0]);
        let variance = average(&|cloud| cloud.moments().covariance[(0, 0)]);
        let extends = average(&|cloud| cloud.phase_probabilities()[0]);
        let moments = mixture.moments();
        mean_cost += (moments.mean[0] - mean).powi(2) / variance / 2.0;
        deviation_cost += (moments.covariance[(0, 0)] / variance).sqrt().ln().powi(2);
        odds_apart += (mixture.phase_probabilities()[0] - extends).abs();
    }
    let steps = f64::from(STEPS);
    assert!(mean_cost / steps < 0.05, "{}", mean_cost / steps);
    assert!(deviation_cost / steps < 0.05, "{}", deviation_cost / steps);
    assert!(odds_apart / steps < 0.05, "{}", odds_apart / steps);
}

/// A body that starts at one stop forgets it: if the stops are symmetric about the mean strain, so are the particles in
/// the end. Without readings they are independent, so four standard errors bound their mean.
#[test]
fn stops_hold_and_do_not_push() {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    let filter = Particles::new(model, None, within(0.05, 0.25), 4000, 1);
    let mut mean = Belief::<f64, 5, 15>::initial(&model).mean;
    mean[0] = 0.05;
    let mut cloud: Cloud = filter.start(&Belief::independent(mean, &[0.0, 2.5e-3, 0.0, 0.0, 0.0]), Phase::Extend);
    for _ in 0..2000 {
        cloud = filter.step_prepared(&cloud, &prepared, DT_S, None).unwrap().posterior;
        assert!(cloud.particles().iter().all(|p| p.state[0] >= 0.05 && p.state[0] <= 0.25));
    }
    let strain = (cloud.moments().mean[0], cloud.moments().covariance[(0, 0)].sqrt());
    assert!((strain.0 - 0.15).abs() < 4.0 * strain.1 / 4000_f64.sqrt(), "{strain:?}");
    // A body at rest at a stop does not change.
    let endless = Dwell::new(1e12, 1.0, 0.0).unwrap();
    let filter = Particles::new(model, Some(endless), within(0.05, 0.25), 100, 1);
    let start: Cloud = filter.start(&Belief::independent(mean, &[1e-4, 0.0, 0.0, 0.0, 0.0]), Phase::Hold);
    let mut cloud = start.clone();
    for _ in 0..1000 {
        cloud = filter.step_prepared(&cloud, &prepared, DT_S, None).unwrap().posterior;
    }
    assert_eq!(cloud.moments().mean[0], start.moments().mean[0]);
}

#[test]
fn the_seed_decides_and_bad_input_is_refused_by_name() {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    let dwell = Dwell::new(2.0, 2.0, 0.0).unwrap();
    let run = |seed: u64| {
        let filter = Particles::new(model, Some(dwell), within(-0.1, 0.45), 200, seed);
        let mut process = Process::new(None, 4);
        let mut cloud: Cloud = filter.start(&Belief::initial(&model), Phase::Hold);
        for _ in 0..50 {
            let reading = Some(Reading::from(process.step()));
            cloud = filter.step_prepared(&cloud, &prepared, DT_S, reading).unwrap().posterior;
        }
        (filter, cloud)
    };
    let (filter, cloud) = run(7);
    assert_eq!(cloud, run(7).1);
    assert_ne!(cloud, run(8).1);
    let before = cloud.clone();
    let refused = |y: f64| filter.step_prepared(&cloud, &prepared, DT_S, Some(Reading::from(y))).unwrap_err();
    assert_eq!(refused(f64::NAN), StepError::NonFiniteReading);
    assert_eq!(refused(f64::INFINITY), StepError::NonFiniteReading);
    assert_eq!(refused(1e300), StepError::NonFiniteState);
    let negative = Some(Reading { value: 0.1, extra_variance: -1.0 });
    let refused = filter.step_prepared(&cloud, &prepared, DT_S, negative).unwrap_err();
    assert_eq!(refused, StepError::NegativeVariance);
    assert_eq!(cloud, before);
    // A missing reading changes no weight, and a step of zero seconds without a reading changes only the state of the
    // random numbers.
    let missing = filter.step_prepared(&cloud, &model.prepare(0.0), 0.0, None).unwrap();
    assert_eq!((missing.log_likelihood, missing.nis), (0.0, None));
    if missing.effective_count >= 100.0 {
        assert_eq!(missing.posterior.moments(), cloud.moments());
    }
}

/// A likelihood to the power 0 changes no weight, whatever the reading; branches and baseline are still updated.
#[test]
fn tempering_takes_weight_from_readings() {
    let model = sensor::<f64, 2, 5>();
    let flat = Evidence { tempering: 0.0, ..within(-0.1, 0.45) };
    let filter = Particles::new(model, None, flat, 100, 3);
    let cloud: Cloud = filter.start(&Belief::initial(&model), Phase::Extend);
    let step = filter.step_prepared(&cloud, &model.prepare(DT_S), DT_S, Some(Reading::from(0.6))).unwrap();
    // A hundred weights of 1/100 add up to one within a hundred roundings.
    assert!((step.effective_count - 100.0).abs() < 1e-11 && step.log_likelihood.abs() < 1e-13);
    assert!(step.posterior.moments().mean[4] > 0.0 && cloud.moments().mean[4] == 0.0);
}
