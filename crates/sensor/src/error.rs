use ohmstrain_ekf::StepError;
use ohmstrain_model::ParameterError;
use thiserror::Error;

use crate::params::estimator::{EstimatorKind, NoParameters};
use crate::params::law::MOST_BRANCHES;
use crate::params::validate::FieldError;

/// Reason why no filter can be built from a sensor's parameters.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A number outside its valid range.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// No parameters for the requested estimator.
    #[error("{0}")]
    NoParameters(#[from] NoParameters),
    /// A parameter that the model rejects.
    #[error("parameter: {0}")]
    Model(#[from] ParameterError),
    /// Parameters with which the filter cannot start.
    #[error("{0}")]
    Start(#[source] StepError),
    /// More branches than filters are built for.
    #[error("a law with {found} branches; at most {MOST_BRANCHES} are supported")]
    Branches {
        /// Number of branches found.
        found: usize,
    },
    /// An estimator with phase hypotheses, but without durations of the phases.
    #[error("`{}` needs `phases` in its parameters", kind.name())]
    NoPhases {
        /// Kind of estimator.
        kind: EstimatorKind,
    },
}
