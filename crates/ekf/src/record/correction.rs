use super::{Expression, Function, Writer, write_down};
use crate::Gaussian;
use crate::correction::{
    Correction, FILTER_INPUTS, InputRows, InputScale, OUTPUTS, Process, Quadratic, Simulated, Triangle, mixture,
};
use ohmstrain_model::{Number, StrainRange};
use std::format;
use std::vec::Vec;

/// Functions around the sums over rows in a filter's correction. Inputs and results have the names of the arguments.
impl Correction<'_, f32, FILTER_INPUTS> {
    /// Records the part before the rows. From inputs `x` on the scale of the rows, and their squared distances outside the range,
    /// it computes the distances `outside_direct` and `outside_residual`, and the processes' predictions without rows, `direct` and
    /// `residual`.
    #[must_use]
    pub fn write_inputs(&self, quadratics: Option<&[Quadratic<'_, f32>; 2]>) -> Function {
        write_down(|writer| {
            let (direct, residual) = (process(&self.direct), process(&self.residual));
            let [x, squares] = ["x", "square"].map(|name| inputs_from(writer, 0, name));
            let [of_direct, of_residual] = quadratics.map_or([Expression::ZERO; 2], |[of_direct, of_residual]| {
                [value(of_direct, &x[OUTPUTS..]), value(of_residual, &x)]
            });
            writer.give("outside_direct", direct.distance(&squares, OUTPUTS));
            writer.give("outside_residual", residual.distance(&squares, 0));
            writer.give("direct", direct.mean + of_direct);
            writer.give("residual", residual.mean + of_residual);
        })
    }

    /// Records the kernels of `x` with a `row`: `of_direct` and `of_residual`.
    #[must_use]
    pub fn write_kernels(&self) -> Function {
        write_down(|writer| {
            let (squares, [x, row]) = apart(writer, 0);
            let product = |input: usize| row[input] * x[input];
            writer.give("of_direct", self.direct.kernels(&squares, OUTPUTS, product(OUTPUTS)));
            writer.give("of_residual", self.residual.kernels(&squares, 0, product(0)));
        })
    }

    /// Records the distance from the range of the simulated rows, given the squared distance of each feature.
    #[must_use]
    pub fn write_simulated_distance(&self, of: &Simulated<'_, f32, FILTER_INPUTS>) -> Function {
        write_down(|writer| {
            let distance = process(&of.process).distance(&inputs_from(writer, OUTPUTS, "square"), OUTPUTS);
            writer.give("return", distance);
        })
    }

    /// Records the kernel of `x` with a simulated `row`.
    #[must_use]
    pub fn write_simulated_kernel(&self, of: &Simulated<'_, f32, FILTER_INPUTS>) -> Function {
        write_down(|writer| {
            let (squares, [x, row]) = apart(writer, OUTPUTS);
            let kernel = of.process.kernels(&squares, OUTPUTS, row[OUTPUTS] * x[OUTPUTS]);
            writer.give("return", kernel);
        })
    }

    /// Records the prediction of the simulated rows, given the sum over them, `sum`, the scaled reading and the
    /// distance `outside`: `mean` and `variance`.
    #[must_use]
    pub fn write_simulated(&self, of: &Simulated<'_, f32, FILTER_INPUTS>) -> Function {
        write_down(|writer| {
            let (correction, process) = (self.numbers(), process(&of.process));
            let predicted = process.prediction(writer.input("sum"), Number::of(0.0), writer.input("reading"));
            give(writer, correction.widened(predicted, &process, writer.input("outside"), Number::of(0.0)));
        })
    }

    /// Records the prediction of the direct process, given its `sum`, the variance that inducing rows explain, the scaled reading and the
    /// distance `outside`: `mean` and `variance`.
    #[must_use]
    pub fn write_direct(&self) -> Function {
        write_down(|writer| {
            let correction = self.numbers();
            let predicted =
                correction.direct.prediction(writer.input("sum"), writer.input("explained"), writer.input("reading"));
            let outside = writer.input("outside");
            give(writer, correction.widened(predicted, &correction.direct, outside, Number::of(0.0)));
        })
    }

    /// Records the combination of the residual process and the filter (`filtered`, `filtered_variance`): `mean`, `variance`, and the
    /// `novelty` of the inputs.
    #[must_use]
    pub fn write_residual(&self) -> Function {
        write_down(|writer| {
            let correction = self.numbers();
            let filtered = Gaussian { mean: writer.input("filtered"), variance: writer.input("filtered_variance") };
            let residual = correction.residual_beside(filtered);
            let predicted = residual.prediction(writer.input("sum"), writer.input("explained"), writer.input("strain"));
            let (corrected, novelty) = correction.of_residual(predicted, writer.input("outside"), filtered.mean);
            give(writer, corrected);
            writer.give("novelty", novelty);
        })
    }

    /// Records the variance of the corrected strain, given the variance of the members' mixture, `novelty` and `birge`.
    #[must_use]
    pub fn write_learned(&self) -> Function {
        write_down(|writer| {
            let mixed = Gaussian { mean: Number::of(0.0), variance: writer.input("variance") };
            let learned = self.numbers().learned(mixed, writer.input("novelty"), writer.input("birge"));
            writer.give("return", learned.variance);
        })
    }

    /// Returns the correction's numbers without rows.
    fn numbers<'t>(&self) -> Correction<'t, Expression<'t>, FILTER_INPUTS> {
        let [lower, upper] = [self.limits.lower, self.limits.upper].map(constant);
        Correction {
            rows: InputRows::new(&[], 0),
            scales: &UNSCALED,
            direct: process(&self.direct),
            one_sided: [],
            residual: process(&self.residual),
            simulated: None,
            limits: StrainRange { lower, upper },
            strain_variance: constant(self.strain_variance),
            variance_factor: constant(self.variance_factor),
        }
    }
}

/// Records the scaling of an `input` (`mean`, `sd`, `lower`, `upper`): `x`, and the `square` of its distance outside the
/// range.
#[must_use]
pub fn write_scaled() -> Function {
    write_down(|writer| {
        let [input, mean, sd, lower, upper] = ["input", "mean", "sd", "lower", "upper"].map(|name| writer.input(name));
        let (x, square) = InputScale { mean, sd, lower, upper }.standardised(input);
        writer.give("x", x);
        writer.give("square", square);
    })
}

/// Records the mixture of two members, `mean_a`, `variance_a`, `mean_b` and `variance_b`: `mean` and `variance`.
#[must_use]
pub fn write_mixture() -> Function {
    write_down(|writer| {
        let members = [["mean_a", "variance_a"], ["mean_b", "variance_b"]]
            .map(|[mean, variance]| Gaussian { mean: writer.input(mean), variance: writer.input(variance) });
        give(writer, mixture(members));
    })
}

/// Unused scales.
const UNSCALED: [InputScale<Expression<'static>>; FILTER_INPUTS] = {
    let none = Expression::ZERO;
    [InputScale { mean: none, sd: none, lower: none, upper: none }; FILTER_INPUTS]
};

fn constant<'t>(number: f32) -> Expression<'t> {
    Number::of(number.into())
}

/// Returns a process' numbers without rows.
fn process<'t>(of: &Process<'_, f32, FILTER_INPUTS>) -> Process<'t, Expression<'t>, FILTER_INPUTS> {
    Process {
        relevance: of.relevance.map(constant),
        mean: constant(of.mean),
        weights: &[],
        explained: Triangle::NONE,
        variance: constant(of.variance),
        noise: constant(of.noise),
        widening: constant(of.widening),
        least_variance: constant(of.least_variance),
    }
}

fn value<'t>(of: &Quadratic<'_, f32>, x: &[Expression<'t>]) -> Expression<'t> {
    let [linear, square] = [of.linear, of.square].map(|all| all.iter().copied().map(constant).collect::<Vec<_>>());
    Quadratic { linear: &linear, square: &square }.value(x)
}

/// Returns inputs from a first one on, passed as a list; those before it are unused.
fn inputs_from<'t>(writer: &Writer<'t>, first: usize, name: &str) -> [Expression<'t>; FILTER_INPUTS] {
    core::array::from_fn(|i| {
        i.checked_sub(first).map_or(Expression::ZERO, |place| writer.input(&format!("{name}[{place}]")))
    })
}

/// Returns the squared distances of `x` from a `row` in each input, and both lists.
fn apart<'t>(
    writer: &Writer<'t>,
    first: usize,
) -> ([Expression<'t>; FILTER_INPUTS], [[Expression<'t>; FILTER_INPUTS]; 2]) {
    let [x, row] = ["x", "row"].map(|name| inputs_from(writer, first, name));
    let squares = core::array::from_fn(|i| {
        let apart = x[i] - row[i];
        apart * apart
    });
    (squares, [x, row])
}

fn give<'t>(writer: &mut Writer<'t>, corrected: Gaussian<Expression<'t>>) {
    writer.give("mean", corrected.mean);
    writer.give("variance", corrected.variance);
}
