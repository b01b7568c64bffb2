//! Functions in C around a correction's sums over its rows.

use ohmstrain_ekf::live::Learned;
use ohmstrain_ekf::record::{write_mixture, write_scaled};

use super::function::Printed;
use crate::twin::OwnedLearned;

/// Returns all of them.
pub fn functions(learned: &OwnedLearned<f32>) -> Vec<Printed> {
    let (_, Learned { correction, quadratics }) = learned.learned();
    let mut all = vec![
        Printed {
            name: "scale",
            comment: "An input on a scale, moved into its range, and the square of how far it was outside.",
            parameters: &["float input", "float mean", "float sd", "float lower", "float upper"],
            function: write_scaled(),
        },
        Printed {
            name: "of_inputs",
            comment: "The distances of inputs outside of the range of the rows, and what is said before any row.",
            parameters: &["const float x[INPUTS]", "const float square[INPUTS]"],
            function: correction.write_inputs(quadratics.as_ref()),
        },
        Printed {
            name: "kernels",
            comment: "The kernels of inputs with a row.",
            parameters: &["const float x[INPUTS]", "const float row[INPUTS]"],
            function: correction.write_kernels(),
        },
        Printed {
            name: "direct",
            comment: "The strain from the features, of the sum over the rows and what inducing rows explain.",
            parameters: &["float sum", "float explained", "float reading", "float outside"],
            function: correction.write_direct(),
        },
        Printed {
            name: "residual",
            comment: "The filter's strain with what it lacks, and how new the inputs are.",
            parameters: &[
                "float sum",
                "float explained",
                "float strain",
                "float outside",
                "float filtered",
                "float filtered_variance",
            ],
            function: correction.write_residual(),
        },
        Printed {
            name: "mix",
            comment: "The mixture of two, each weighted by its variance to the power -3/2; an exact one is all that counts.",
            parameters: &["float mean_a", "float variance_a", "float mean_b", "float variance_b"],
            function: write_mixture(),
        },
        Printed {
            name: "learned",
            comment: "The variance of what is mixed, larger by what innovations say, and by how new the inputs are.",
            parameters: &["float variance", "float novelty", "float birge"],
            function: correction.write_learned(),
        },
    ];
    if let Some(simulated) = &correction.simulated {
        all.extend([
            Printed {
                name: "simulated_distance",
                comment: "The distance of features outside of the range of the simulated rows.",
                parameters: &["const float square[FEATURES]"],
                function: correction.write_simulated_distance(simulated),
            },
            Printed {
                name: "simulated_kernel",
                comment: "The kernel of features with a simulated row.",
                parameters: &["const float x[FEATURES]", "const float row[FEATURES]"],
                function: correction.write_simulated_kernel(simulated),
            },
            Printed {
                name: "simulated",
                comment: "The strain, as the law has it where the sensor was not seen, of the sum over the simulated rows.",
                parameters: &["float sum", "float reading", "float outside"],
                function: correction.write_simulated(simulated),
            },
        ]);
    }
    all
}
