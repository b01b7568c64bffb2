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
            comment: "Standardised input, clamped to its range, and its squared distance from the range.",
            parameters: &["float input", "float mean", "float sd", "float lower", "float upper"],
            function: write_scaled(),
        },
        Printed {
            name: "of_inputs",
            comment: "Distances of inputs outside the range of the rows, and the means of the processes.",
            parameters: &["const float x[INPUTS]", "const float square[INPUTS]"],
            function: correction.write_inputs(quadratics.as_ref()),
        },
        Printed {
            name: "kernels",
            comment: "Kernels of inputs with a row.",
            parameters: &["const float x[INPUTS]", "const float row[INPUTS]"],
            function: correction.write_kernels(),
        },
        Printed {
            name: "direct",
            comment: "Strain from the features, given the sum over the rows and the share that inducing rows explain.",
            parameters: &["float sum", "float explained", "float reading", "float outside"],
            function: correction.write_direct(),
        },
        Printed {
            name: "residual",
            comment: "Filter's strain plus its predicted error, and the novelty of the inputs.",
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
            comment: "Mixture of two estimates with weights of variance^(-3/2); an exact one has all of the weight.",
            parameters: &["float mean_a", "float variance_a", "float mean_b", "float variance_b"],
            function: write_mixture(),
        },
        Printed {
            name: "learned",
            comment: "Variance of a member, larger by the ratio of innovations and by the novelty of the inputs.",
            parameters: &["float variance", "float novelty", "float birge"],
            function: correction.write_learned(),
        },
    ];
    if let Some(simulated) = &correction.simulated {
        all.extend([
            Printed {
                name: "simulated_distance",
                comment: "Distance of features outside the range of the simulated rows.",
                parameters: &["const float square[FEATURES]"],
                function: correction.write_simulated_distance(simulated),
            },
            Printed {
                name: "simulated_kernel",
                comment: "Kernel of features with a simulated row.",
                parameters: &["const float x[FEATURES]", "const float row[FEATURES]"],
                function: correction.write_simulated_kernel(simulated),
            },
            Printed {
                name: "simulated",
                comment: "Strain in motions without recordings, by the law, given the sum over the simulated rows.",
                parameters: &["float sum", "float reading", "float outside"],
                function: correction.write_simulated(simulated),
            },
        ]);
    }
    all
}
