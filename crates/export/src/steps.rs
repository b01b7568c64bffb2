//! Constants of steps of several lengths: tabulated, since clocks jitter and readings are lost.

use ohmstrain_ekf::Real;

/// Number of lengths at which the numbers are tabulated.
pub const NODES: usize = 9;
/// Shortest and longest step, in multiples of the usual one.
const SHORTEST: f64 = 1.0 / 16.0;
const LONGEST: f64 = 2.0;

/// Numbers of a step as functions of its length: polynomials through Chebyshev nodes. The functions are exponentials of the
/// length over time constants that it hardly exceeds; interpolation is accurate to single precision.
#[derive(Clone, Debug)]
pub struct StepTable {
    /// Shortest and longest length, s.
    pub range: (f64, f64),
    /// The nodes, from -1 to 1 over that range.
    pub nodes: [f64; NODES],
    /// Reciprocal of the product of a node's distances from the others.
    pub inverses: [f64; NODES],
    /// The numbers at each node.
    pub rows: Vec<Vec<f64>>,
    /// Index pairs of numbers of which one is the reciprocal of the other.
    pub reciprocals: Vec<(usize, usize)>,
}

impl StepTable {
    /// Tabulates the numbers around a usual length, s; `numbers` computes them for a length, `names` are those of `step_names`.
    pub fn new<E>(usual_s: f64, names: &[String], numbers: impl Fn(f64) -> Result<Vec<f64>, E>) -> Result<Self, E> {
        let range = (SHORTEST * usual_s, LONGEST * usual_s);
        let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / NODES as f64;
        let nodes: [f64; NODES] = std::array::from_fn(|j| f64::from(angle(j).cos() as f32));
        let others = |j: usize| (0..NODES).filter(move |other| *other != j);
        let inverses = std::array::from_fn(|j| 1.0 / others(j).map(|other| nodes[j] - nodes[other]).product::<f64>());
        let length = |node: f64| 0.5 * (range.0 + range.1) + 0.5 * (range.1 - range.0) * node;
        let rows: Result<Vec<_>, E> = nodes.iter().map(|node| numbers(length(*node))).collect();
        let place = |name: String| names.iter().position(|known| *known == name);
        let reciprocal = |(at, name): (usize, &String)| Some((at, place(name.replace("per_reach", "reach"))?));
        let reciprocals =
            names.iter().enumerate().filter(|(_, name)| name.contains("per_reach")).filter_map(reciprocal);
        Ok(Self { range, nodes, inverses, rows: rows?, reciprocals: reciprocals.collect() })
    }

    /// Computes the numbers of a step of `dt_s` as the exported program does.
    pub fn at<T: Real>(&self, dt_s: T) -> Vec<T> {
        let number = |x: f64| T::of(f64::from(x as f32));
        let (lower, upper) = (number(self.range.0), number(self.range.1));
        let inside = if dt_s < lower { lower } else { dt_s };
        let u = (inside + inside - (lower + upper)) / (upper - lower);
        let mut numbers = vec![T::zero(); self.rows[0].len()];
        for (j, row) in self.rows.iter().enumerate() {
            let mut weight = number(self.inverses[j]);
            for (_, node) in self.nodes.iter().enumerate().filter(|(other, _)| *other != j) {
                weight *= u - number(*node);
            }
            for (sum, at_node) in numbers.iter_mut().zip(row) {
                *sum += weight * number(*at_node);
            }
        }
        for (at, of) in &self.reciprocals {
            numbers[*at] = T::one() / numbers[*of];
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use super::StepTable;

    /// Tests exponentials of up to a time constant per step, and powers of the length, to single precision of the largest; a
    /// reciprocal to its own precision.
    #[test]
    fn numbers_between_the_nodes_are_those_of_the_functions() {
        let functions = |t: f64| [(-t).exp(), -(-t).exp_m1(), t * t * t, t, 1.0 / t];
        let names = ["decay_0", "gain_0", "noise_0", "b0_reach_0", "b0_per_reach_0"].map(String::from);
        let numbers = |t: f64| Ok::<_, ()>(functions(t).to_vec());
        let table = StepTable::new(0.5, &names, numbers).unwrap();
        for k in 0..200 {
            let t = 0.5 / 16.0 + (1.0 - 0.5 / 16.0) * f64::from(k) / 199.0;
            let exact = functions(f64::from(t as f32));
            for (k, (found, exact)) in table.at(t as f32).into_iter().zip(exact).enumerate() {
                // Nine products with weights of up to three in total, each with its own rounding.
                let size = if k == 4 { exact * exact } else { 1.0 };
                assert!((f64::from(found) - exact).abs() < 2e-6 * size, "{}: {found} {exact} at {t}", names[k]);
            }
        }
    }
}
