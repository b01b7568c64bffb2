use super::catalogue::ModulusShape;
use super::exponentials::decay;
use super::law::{Datum, Derived, Moment, Parameter, SeparableLaw, Unit, value_and_gradient};
use super::moving::{intercept, time_constants};
use super::search::{Extent, Search};

/// Equations 8 and 9 in one: a movement and the hold after it share the modulus, and the hold starts where the movement
/// ends: `R′ = R_s (1 - r₀′ + r₀′ E(t))` with `R_s = r₀ E(t_s) v t_s + v η + r₁`, t_s the movement's duration.
///
/// A [`Moment`] with a movement before it is in the hold. For one movement and hold this is
/// `ohmstrain_model::RelaxingModulus`, which also jumps by `v η` from rest into the movement and keeps that in the hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovingHold {
    /// The modulus E(t), shared.
    pub modulus: ModulusShape,
    /// Whether the data have several speeds; see [`super::Moving::several_speeds`].
    pub several_speeds: bool,
}

/// E(t), relative to its start, and its derivatives with respect to the time constants, then to the shares.
struct Modulus {
    value: f64,
    slopes: Vec<f64>,
}

impl MovingHold {
    /// With a floor, each term has a share and the floor the rest.
    fn shares(&self) -> usize {
        if self.modulus.floor { self.modulus.terms } else { 0 }
    }

    /// `E(t) = 1 + Σ wᵢ (exp(-t/τᵢ) - 1)`.
    fn relaxed(&self, theta: &[f64], elapsed_s: f64) -> Modulus {
        let terms = self.modulus.terms;
        let mut out = Modulus { value: 1.0, slopes: vec![0.0; terms + self.shares()] };
        for i in 0..terms {
            let fall = (-elapsed_s / theta[i]).exp_m1();
            let share = if self.modulus.floor { theta[terms + i] } else { 1.0 };
            out.value += share * fall;
            out.slopes[i] = share * decay(elapsed_s, theta[i]).1;
            if self.modulus.floor {
                out.slopes[terms + i] = fall;
            }
        }
        out
    }
}

impl SeparableLaw for MovingHold {
    fn linear(&self) -> Vec<Parameter> {
        let mut out = vec![Parameter::new("r0", Unit::ReadingPerStrain)];
        out.extend(intercept(self.several_speeds));
        out
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        let mut out = time_constants(self.modulus.terms);
        out.extend((1..=self.shares()).map(|i| Parameter::new(format!("e{i}"), Unit::One)));
        out.push(Parameter::new("r0_hold", Unit::One));
        out
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        let mut out = extent.time_constants(self.modulus.terms);
        let even = 0.8 / self.modulus.terms as f64;
        out.extend((0..self.shares()).map(|_| Search::between(-20.0, 20.0, &[even])));
        // r₀′ of 1 and more would have the resistance relax to nothing.
        out.push(Search::between(-10.0, 1.0, &[0.1]));
        out
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let size = theta.len();
        let last = values.len() - 1;
        let (elapsed_s, travel) = at.before.map_or((at.elapsed_s, at.travel), |move_| (move_.duration_s, move_.travel));
        let moved = self.relaxed(theta, elapsed_s);
        values[0] = moved.value * travel;
        if self.several_speeds {
            values[1] = at.rate;
        }
        values[last] = 1.0;
        for (slope, own) in slopes.iter_mut().zip(&moved.slopes) {
            *slope = own * travel;
        }
        if at.before.is_none() {
            return;
        }
        let held = self.relaxed(theta, at.elapsed_s);
        let fraction = theta[size - 1];
        let share = 1.0 + fraction * (held.value - 1.0);
        for (j, value) in values.iter_mut().enumerate() {
            for k in 0..size - 1 {
                slopes[j * size + k] = slopes[j * size + k] * share + *value * fraction * held.slopes[k];
            }
            slopes[j * size + size - 1] = *value * (held.value - 1.0);
            *value *= share;
        }
    }

    fn order(&self, _weights: &mut [f64], theta: &mut [f64]) {
        let terms = self.modulus.terms;
        if !self.modulus.floor {
            return;
        }
        let (taus, shares) = theta.split_at_mut(terms);
        super::law::sort_terms(&mut shares[..terms], taus);
    }

    /// The reading at the start of the hold, and r₁′, if there is but one hold.
    fn derived(&self, weights: &[f64], theta: &[f64], data: &[Datum]) -> Vec<Derived> {
        let mut holds = data.iter().map(|datum| datum.at).filter(|at| at.before.is_some());
        let Some(first) = holds.next() else { return Vec::new() };
        if holds.any(|at| at.before != first.before) {
            return Vec::new();
        }
        let (start, slope) = value_and_gradient(self, weights, theta, &Moment { elapsed_s: 0.0, ..first });
        let rest = 1.0 - theta[theta.len() - 1];
        let mut gradient: Vec<f64> = slope.iter().map(|slope| slope * rest).collect();
        if let Some(last) = gradient.last_mut() {
            *last -= start;
        }
        let parameter = |name| Parameter::new(name, Unit::Reading);
        vec![
            Derived { parameter: parameter("r_start"), value: start, gradient: slope },
            Derived { parameter: parameter("r1_hold"), value: start * rest, gradient },
        ]
    }
}
