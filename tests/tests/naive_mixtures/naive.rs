//! Naive filters of phase hypotheses: dense matrices, logarithms of weights, one hypothesis after the other. Their smoothers
//! are in `back.rs`.

mod back;

pub use back::Smoothed;

use libm::erfc;
use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{Belief, Dwell, Evidence, Reading};
use ohmstrain_model::{Direction, Observation, Phase, StrainRange, SwitchedModel, Symmetric, Transition};

/// Kind of filter.
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    /// Interacting multiple models.
    Imm(Dwell<f64>),
    /// Hypotheses split by the sign of the rate, with or without holds.
    Signs(Option<Dwell<f64>>),
    /// Phase histories.
    Histories(Dwell<f64>),
}

/// A filter of a sensor, with limited room for hypotheses.
#[derive(Clone, Copy, Debug)]
pub struct Naive<const B: usize, const N: usize> {
    /// The sensor.
    pub model: SwitchedModel<f64, B, N>,
    /// Kind of filter.
    pub rule: Rule,
    /// Evidence that weighs hypotheses.
    pub evidence: Evidence<f64>,
    /// Maximum number of hypotheses.
    pub room: usize,
}

/// Mean and covariance.
pub type Moments<const N: usize> = (SVector<f64, N>, SMatrix<f64, N, N>);

/// Origin of a child.
#[derive(Clone, Copy, Debug)]
struct Descent<const N: usize> {
    parent: usize,
    /// Transition from the parent's state to the prediction; a redrawn rate is noise.
    jacobian: SMatrix<f64, N, N>,
    predicted: Moments<N>,
    posterior: Moments<N>,
    log_weight: f64,
}

/// A phase, and the distribution of the state given it.
#[derive(Clone, Debug)]
pub struct Hypothesis<const N: usize> {
    /// Logarithm of its probability.
    pub log_weight: f64,
    /// Its phase.
    pub phase: Phase,
    /// Mean of the state.
    pub mean: SVector<f64, N>,
    /// Covariance of the state.
    pub covariance: SMatrix<f64, N, N>,
    per_inside: f64,
    /// Children merged into it.
    made_of: Vec<Descent<N>>,
}

/// All hypotheses, and the time without a reading.
#[derive(Clone, Debug)]
pub struct Hypotheses<const N: usize> {
    /// The hypotheses.
    pub all: Vec<Hypothesis<N>>,
    pause_s: f64,
    open: bool,
}

/// Comparison of a reading with its prediction.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// Innovation, and its variance.
    pub innovation: (f64, f64),
    /// Log density of the reading.
    pub log_density: f64,
}

impl<const N: usize> Hypotheses<N> {
    /// Creates one hypothesis with all the weight.
    pub fn single<const L: usize>(belief: &Belief<f64, N, L>, phase: Phase) -> Self {
        let (mean, covariance) = (belief.mean, belief.covariance.to_matrix());
        let one = Hypothesis { log_weight: 0.0, phase, mean, covariance, per_inside: 1.0, made_of: vec![] };
        Self { all: vec![one], pause_s: 0.0, open: false }
    }

    /// Returns mean and covariance of the mixture.
    pub fn moments(&self) -> Moments<N> {
        moments(&self.all.iter().map(|one| (one.log_weight.exp(), one.mean, one.covariance)).collect::<Vec<_>>())
    }
}

/// Returns mean and covariance of weighted Gaussians.
fn moments<const N: usize>(parts: &[(f64, SVector<f64, N>, SMatrix<f64, N, N>)]) -> Moments<N> {
    let total: f64 = parts.iter().map(|(weight, ..)| weight).sum();
    let mean = parts.iter().map(|(weight, mean, _)| mean * (weight / total)).sum::<SVector<f64, N>>();
    let around = |(weight, at, covariance): &(f64, SVector<f64, N>, SMatrix<f64, N, N>)| {
        (covariance + (at - mean) * (at - mean).transpose()) * (weight / total)
    };
    (mean, parts.iter().map(around).sum())
}

/// Returns the probability that a standard normal number is above z.
fn above(z: f64) -> f64 {
    0.5 * erfc(z / std::f64::consts::SQRT_2)
}

impl<const N: usize> Hypothesis<N> {
    fn distance(&self, other: &Self) -> f64 {
        let apart = |i: usize| {
            let apart = self.mean[i] - other.mean[i];
            let variance = self.covariance[(i, i)].max(other.covariance[(i, i)]);
            if apart == 0.0 { 0.0 } else { apart * apart / variance }
        };
        apart(0) + apart(1)
    }

    fn merge(&mut self, other: &Self) {
        let (mine, theirs) = (self.log_weight.exp(), other.log_weight.exp());
        let share = theirs / (mine + theirs);
        let parts = [(1.0 - share, self.mean, self.covariance), (share, other.mean, other.covariance)];
        (self.mean, self.covariance) = moments(&parts);
        self.per_inside += share * (other.per_inside - self.per_inside);
        self.log_weight = (mine + theirs).ln();
        self.made_of.extend(&other.made_of);
    }

    /// Truncates the rate to the phase's sign, and returns the remaining probability.
    fn cut(&mut self) -> f64 {
        let side = if self.phase == Phase::Retract { -1.0 } else { 1.0 };
        let (variance, toward) = (self.covariance[(1, 1)], side * self.mean[1]);
        if variance <= 0.0 {
            return f64::from(u8::from(toward >= 0.0));
        }
        let z = toward / variance.sqrt();
        let mass = above(-z);
        let hazard = (-0.5 * z * z).exp() / (std::f64::consts::TAU.sqrt() * mass);
        let regression: SVector<f64, N> = self.covariance.column(1) / variance;
        self.mean += regression * (side * hazard * variance.sqrt());
        self.covariance -= regression * regression.transpose() * (variance * hazard * (hazard + z));
        mass
    }

    fn weigh_limits(&mut self, limits: &StrainRange<f64>) {
        let sd = self.covariance[(0, 0)].sqrt();
        let [lower, upper] = [limits.lower, limits.upper].map(|limit| (limit - self.mean[0]) / sd);
        // Computed on the side with small tails.
        let inside = if lower > 0.0 { above(lower) - above(upper) } else { above(-upper) - above(-lower) };
        let inside = inside.max(1e-9);
        self.log_weight += (inside * self.per_inside).ln();
        self.per_inside = 1.0 / inside;
    }
}

/// A child's probability, innovation, innovation variance, and tempered log density.
struct Compared(f64, f64, f64, f64);

/// Children of a step.
struct Children<const N: usize> {
    kept: Vec<Hypothesis<N>>,
    room: usize,
    /// All children compared with the reading.
    compared: Vec<Compared>,
}

impl<const N: usize> Children<N> {
    fn nearest(&self, child: &Hypothesis<N>, but: Option<usize>) -> Option<usize> {
        let of_phase = (0..self.kept.len()).filter(|at| Some(*at) != but && self.kept[*at].phase == child.phase);
        of_phase.min_by(|a, b| self.kept[*a].distance(child).total_cmp(&self.kept[*b].distance(child)))
    }

    fn merge_into_nearest(&mut self, child: &Hypothesis<N>, but: Option<usize>) {
        let heaviest = self.kept.iter().fold(child.log_weight, |most, one| most.max(one.log_weight));
        if child.log_weight >= heaviest - 12.0
            && let Some(at) = self.nearest(child, but)
        {
            self.kept[at].merge(child);
        }
    }

    fn add(&mut self, child: Hypothesis<N>) {
        let like = self.kept.iter().position(|one| one.phase == child.phase && one.distance(&child) < 0.5);
        if let Some(at) = like {
            return self.kept[at].merge(&child);
        }
        if self.kept.len() < self.room {
            return self.kept.push(child);
        }
        let lightest = (1..self.kept.len()).fold(0, |lightest, at| {
            if self.kept[at].log_weight < self.kept[lightest].log_weight - 1e-4 { at } else { lightest }
        });
        if self.kept[lightest].log_weight >= child.log_weight - 1e-4 {
            return self.merge_into_nearest(&child, None);
        }
        let displaced = self.kept[lightest].clone();
        self.merge_into_nearest(&displaced, Some(lightest));
        self.kept[lightest] = child;
    }

    fn finish(mut self) -> (Vec<Hypothesis<N>>, Option<Comparison>) {
        let heaviest = self.kept.iter().fold(f64::NEG_INFINITY, |most, one| most.max(one.log_weight));
        self.kept.retain(|one| one.log_weight > heaviest - 12.0);
        let total: f64 = self.kept.iter().map(|one| one.log_weight.exp()).sum();
        for one in &mut self.kept {
            one.log_weight -= total.ln();
        }
        let sum = |of: &dyn Fn(&Compared) -> f64| self.compared.iter().map(of).sum::<f64>();
        let weight = sum(&|child| child.0);
        let mean = sum(&|child| child.0 * child.1) / weight;
        let variance = sum(&|child| child.0 * (child.2 + (child.1 - mean).powi(2))) / weight;
        let log_density = (sum(&|child| child.0 * child.3.exp()) / weight).ln();
        let comparison = Comparison { innovation: (mean, variance), log_density };
        (self.kept, (weight > 0.0).then_some(comparison))
    }
}

impl<const B: usize, const N: usize> Naive<B, N> {
    /// Takes one step of `dt_s` seconds. `L` is `N (N + 1) / 2`.
    pub fn step<const L: usize>(
        &self,
        from: &Hypotheses<N>,
        dt_s: f64,
        reading: Option<Reading<f64>>,
    ) -> (Hypotheses<N>, Option<Comparison>) {
        let pause_s = if reading.is_some() { 0.0 } else { from.pause_s + dt_s };
        let forgets_s =
            if self.model.motion().phase_rate() == 0.0 { 0.75 * self.model.longest_step_s() } else { f64::INFINITY };
        let open = matches!(self.rule, Rule::Signs(_)) && pause_s > forgets_s * 1.0005;
        let mut children = Children { kept: Vec::new(), room: self.room, compared: Vec::new() };
        let parents = if let Rule::Imm(dwell) = self.rule { self.mixed(from, &dwell, dt_s) } else { from.all.clone() };
        for parent in parents.iter().enumerate() {
            for (phase, probability) in Phase::ALL.into_iter().zip(self.follows(parent.1.phase, dt_s, open)) {
                if probability > 0.0 {
                    self.child::<L>(parent, (phase, probability), (dt_s, from.open, open), reading, &mut children);
                }
            }
        }
        let (all, comparison) = children.finish();
        (Hypotheses { all, pause_s, open }, comparison)
    }

    fn follows(&self, phase: Phase, dt_s: f64, open: bool) -> [f64; 3] {
        let chain = match self.rule {
            Rule::Imm(_) => return Phase::ALL.map(|of| f64::from(u8::from(of == phase))),
            Rule::Histories(dwell) => return dwell.probabilities(dt_s)[phase.index()],
            Rule::Signs(hold) => hold.map(|dwell| dwell.probabilities(dt_s)),
        };
        let stops = chain.map_or(0.0, |chain| chain[0][1]);
        match (chain, phase) {
            (Some(chain), Phase::Hold) => chain[1],
            (_, Phase::Retract) if open => [0.0, stops, 1.0 - stops],
            _ if open => [1.0 - stops, stops, 0.0],
            _ => [1.0 - stops, stops, 1.0 - stops],
        }
    }

    /// Returns the state when a moving phase begins: the rate is redrawn.
    fn enter(&self, parent: &Hypothesis<N>, phase: Phase) -> Hypothesis<N> {
        let (mut entered, sign) = (parent.clone(), if phase == Phase::Retract { -1.0 } else { 1.0 });
        let (variance, speed) = (self.model.motion().stationary_variance()[1], self.model.motion().phase_rate());
        entered.covariance.fill_row(1, 0.0);
        entered.covariance.fill_column(1, 0.0);
        let half = 2.0 / std::f64::consts::PI;
        (entered.mean[1], entered.covariance[(1, 1)]) = if speed > 0.0 {
            (sign * speed, variance)
        } else {
            (sign * (half * variance).sqrt(), (1.0 - half) * variance)
        };
        entered
    }

    fn mixed(&self, from: &Hypotheses<N>, dwell: &Dwell<f64>, dt_s: f64) -> Vec<Hypothesis<N>> {
        let chain = dwell.probabilities(dt_s);
        let mix = |phase: Phase| {
            let begins = |one: &Hypothesis<N>| phase != Phase::Hold && one.phase != phase;
            let entered = |one: &Hypothesis<N>| if begins(one) { self.enter(one, phase) } else { one.clone() };
            let weight = |one: &Hypothesis<N>| chain[one.phase.index()][phase.index()] * one.log_weight.exp();
            let total: f64 = from.all.iter().map(weight).sum();
            let parts: Vec<_> = from.all.iter().map(|one| (weight(one), entered(one))).collect();
            let part = |(parent, (weight, one)): (usize, &(f64, Hypothesis<N>))| {
                let mut jacobian = SMatrix::identity();
                jacobian[(1, 1)] = f64::from(u8::from(!begins(&from.all[parent])));
                let here = (one.mean, one.covariance);
                Descent { parent, jacobian, predicted: here, posterior: here, log_weight: weight.ln() }
            };
            let made_of = parts.iter().enumerate().map(part).collect();
            let (mean, covariance) =
                moments(&parts.iter().map(|(w, one)| (*w, one.mean, one.covariance)).collect::<Vec<_>>());
            let per_inside = parts.iter().map(|(w, one)| w / total * one.per_inside).sum();
            Hypothesis { log_weight: total.ln(), phase, mean, covariance, per_inside, made_of }
        };
        Phase::ALL.map(mix).into_iter().filter(|one| one.log_weight.is_finite()).collect()
    }

    fn child<const L: usize>(
        &self,
        (place, parent): (usize, &Hypothesis<N>),
        (phase, probability): (Phase, f64),
        (dt_s, was_open, open): (f64, bool, bool),
        reading: Option<Reading<f64>>,
        children: &mut Children<N>,
    ) {
        let signs = matches!(self.rule, Rule::Signs(_));
        let begins = match self.rule {
            Rule::Imm(_) => false,
            Rule::Signs(hold) => hold.is_some() && parent.phase == Phase::Hold && phase != Phase::Hold,
            Rule::Histories(_) => phase != Phase::Hold && parent.phase != phase,
        };
        let mut child = if begins { self.enter(parent, phase) } else { parent.clone() };
        child.phase = phase;
        let step = self.model.prepare(dt_s);
        let packed = Symmetric::<f64, N, L>::from_lower(&child.covariance);
        let direction = if !signs || begins || phase == Phase::Hold || (parent.phase == Phase::Hold && !open) {
            Direction::Known(phase)
        } else if open {
            self.model.uncertain_direction(&step, &packed)
        } else {
            let retracts = if was_open { child.mean[1] < 0.0 } else { parent.phase == Phase::Retract };
            let before = if retracts { Phase::Retract } else { Phase::Extend };
            Direction::Within { phase, turning: self.model.turning(&step, &child.mean, &packed, before) }
        };
        let moved: Transition<f64, N, L> = self.model.transition(&step, &child.mean, direction);
        child.mean = moved.mean;
        child.covariance = moved.jacobian * child.covariance * moved.jacobian.transpose() + moved.noise.to_matrix();
        let (predicted, mut jacobian) = ((child.mean, child.covariance), moved.jacobian);
        if begins {
            jacobian.fill_column(1, 0.0);
        }
        let mut mass = if signs && !open && phase != Phase::Hold { child.cut() } else { 1.0 };
        if mass <= 1e-3 {
            return;
        }
        if begins && mass > 0.5 {
            mass = 1.0;
        }
        child.log_weight += (probability * mass).ln();
        if let Some(reading) = reading {
            let Observation { value, gradient, variance } = self.model.observe(&child.mean, Direction::Known(phase));
            let with: SVector<f64, N> = child.covariance * gradient;
            let total = gradient.dot(&with) + variance + reading.extra_variance;
            let innovation = reading.value - value;
            let log_density = -0.5 * (innovation * innovation / total + (std::f64::consts::TAU * total).ln());
            let tempered = self.evidence.tempering * log_density;
            children.compared.push(Compared(child.log_weight.exp(), innovation, total, tempered));
            child.mean += with * (innovation / total);
            child.covariance -= with * with.transpose() / total;
            child.log_weight += tempered;
        }
        child.weigh_limits(&self.evidence.limits);
        let (posterior, log_weight) = ((child.mean, child.covariance), child.log_weight);
        child.made_of = vec![Descent { parent: place, jacobian, predicted, posterior, log_weight }];
        children.add(child);
    }
}
