use super::datum::{Datum, Moment};
use super::exponentials::{ModulusShape, decay};
use super::law::{Derived, Parameter, SeparableLaw, Unit, sort_terms, value_and_gradient};
use super::moving::{intercept, time_constants};
use super::search::{Extent, Search};

/// Equations 8 and 9 in one: a movement and the hold after it share the modulus, and the hold starts where the movement
/// ends: `R′ = R_s (1 - r₀′ + r₀′ E(t))` with `R_s = r₀ E(t_s) v t_s + v η + r₁`, t_s the movement's duration.
///
/// A [`Moment`] with a movement before it is in the hold.
///
/// A modulus with a floor, `E = E∞ + Σ Eᵢ exp(-t/τᵢ)` with E(0) = 1, is fitted by `bᵢ = r₀′ Eᵢ`, `κ = r₀/r₀′` and `r₀ E∞`, which stay
/// finite if the stiffness changes sign during the search. r₀, r₀′ and Eᵢ are derived from them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovingHold {
    /// The modulus E(t), shared.
    pub modulus: ModulusShape,
    /// True if the data have several speeds; see [`Moving`](super::moving::Moving).
    pub several_speeds: bool,
}

/// `Σ bᵢ exp(-t/τᵢ)` and its change since the start, with derivatives with respect to τ, then to b.
struct Relaxed {
    value: f64,
    value_slopes: Vec<f64>,
    fall: f64,
    fall_slopes: Vec<f64>,
}

impl MovingHold {
    fn relaxed(&self, theta: &[f64], elapsed_s: f64) -> Relaxed {
        let terms = self.modulus.terms;
        let zeros = vec![0.0; theta.len()];
        let mut out = Relaxed { value: 0.0, value_slopes: zeros.clone(), fall: 0.0, fall_slopes: zeros };
        for i in 0..terms {
            let (left, slope) = decay(elapsed_s, theta[i]);
            let gone = (-elapsed_s / theta[i]).exp_m1();
            let weight = theta[terms + i];
            out.value += weight * left;
            out.fall += weight * gone;
            (out.value_slopes[i], out.fall_slopes[i]) = (weight * slope, weight * slope);
            (out.value_slopes[terms + i], out.fall_slopes[terms + i]) = (left, gone);
        }
        if !self.modulus.floor {
            // Without a floor the stiffness is r₀ itself: one exponential, without r₀′.
            let (left, slope) = decay(elapsed_s, theta[0]);
            (out.value, out.value_slopes[0], out.value_slopes[1]) = (left, slope, 0.0);
        }
        out
    }
}

impl SeparableLaw for MovingHold {
    fn linear(&self) -> Vec<Parameter> {
        let names: &[&str] = if self.modulus.floor { &["r0/r0_hold", "r0*e_inf"] } else { &["r0"] };
        let mut out: Vec<Parameter> = names.iter().map(|name| Parameter::new(*name, Unit::ReadingPerStrain)).collect();
        out.extend(intercept(self.several_speeds));
        out
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        let mut out = time_constants(self.modulus.terms);
        let name = |i| if self.modulus.floor { format!("r0_hold*e{i}") } else { "r0_hold".into() };
        out.extend((1..=self.modulus.terms).map(|i| Parameter::new(name(i), Unit::One)));
        out
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        let terms = self.modulus.terms;
        let mut out = extent.time_constants(terms);
        // At a fraction of 1 the resistance would relax to zero.
        out.extend((0..terms).map(|_| Search::between(-10.0, 1.0, &[0.1 / terms as f64])));
        out
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let (size, last) = (theta.len(), values.len() - 1);
        let (elapsed_s, travel) = at.before.map_or((at.elapsed_s, at.travel), |move_| (move_.duration_s, move_.travel));
        let moved = self.relaxed(theta, elapsed_s);
        values[0] = moved.value * travel;
        for (slope, own) in slopes.iter_mut().zip(&moved.value_slopes) {
            *slope = own * travel;
        }
        if self.modulus.floor {
            values[1] = travel;
        }
        if self.several_speeds {
            values[last - 1] = at.rate;
        }
        values[last] = 1.0;
        if at.before.is_none() {
            return;
        }
        let held = self.relaxed(theta, at.elapsed_s);
        let left = 1.0 + held.fall;
        for (j, value) in values.iter_mut().enumerate() {
            for k in 0..size {
                slopes[j * size + k] = slopes[j * size + k] * left + *value * held.fall_slopes[k];
            }
            *value *= left;
        }
    }

    fn order(&self, _weights: &mut [f64], theta: &mut [f64]) {
        let (taus, shares) = theta.split_at_mut(self.modulus.terms);
        sort_terms(shares, taus);
    }

    /// Returns r₀, r₀′ and Eᵢ where the fit has them in products. For a single hold it adds the reading at its start, its settled reading,
    /// and r₁′.
    fn derived(&self, weights: &[f64], theta: &[f64], data: &[Datum]) -> Vec<Derived> {
        let terms = self.modulus.terms;
        let (linear, size) = (weights.len(), weights.len() + theta.len());
        let shares = linear + terms..size;
        let sum: f64 = theta[terms..].iter().sum();
        // r₀′ and its gradient: 1 · b without a floor, (κ Σ b + r₀ E∞) / κ with one.
        let (fraction, fraction_slope) = {
            let mut slope = vec![0.0; size];
            slope[shares.clone()].fill(1.0);
            let rest = if self.modulus.floor { weights[1] / weights[0] } else { 0.0 };
            if self.modulus.floor {
                (slope[0], slope[1]) = (-rest / weights[0], 1.0 / weights[0]);
            }
            (sum + rest, slope)
        };
        let mut out = Vec::new();
        let mut push = |name: String, unit, value, gradient| {
            out.push(Derived { parameter: Parameter::new(name, unit), value, gradient });
        };
        if self.modulus.floor {
            let mut slope: Vec<f64> = fraction_slope.iter().map(|slope| slope * weights[0]).collect();
            slope[0] += fraction;
            push("r0".into(), Unit::ReadingPerStrain, weights[0] * fraction, slope);
            push("r0_hold".into(), Unit::One, fraction, fraction_slope.clone());
            for i in 0..terms {
                let share = theta[terms + i] / fraction;
                let mut slope: Vec<f64> = fraction_slope.iter().map(|slope| -share * slope / fraction).collect();
                slope[shares.start + i] += 1.0 / fraction;
                push(format!("e{}", i + 1), Unit::One, share, slope);
            }
        }
        let Some(first) = only_hold(data) else { return out };
        let (start, start_slope) = value_and_gradient(self, weights, theta, &Moment { elapsed_s: 0.0, ..first });
        let left_of_start = |gone: f64, gone_slope: &[f64]| -> Vec<f64> {
            start_slope
                .iter()
                .zip(gone_slope)
                .map(|(own, gone_slope)| own * (1.0 - gone) - start * gone_slope)
                .collect()
        };
        push("r1_hold".into(), Unit::Reading, start * (1.0 - fraction), left_of_start(fraction, &fraction_slope));
        if self.modulus.floor {
            let mut slope = vec![0.0; size];
            slope[shares].fill(1.0);
            push("r_settled".into(), Unit::Reading, start * (1.0 - sum), left_of_start(sum, &slope));
        }
        push("r_start".into(), Unit::Reading, start, start_slope);
        out
    }
}

/// Returns a moment in the hold if all holds follow the same movement.
fn only_hold(data: &[Datum]) -> Option<Moment> {
    let mut holds = data.iter().map(|datum| datum.at).filter(|at| at.before.is_some());
    let first = holds.next()?;
    holds.all(|at| at.before == first.before).then_some(first)
}
