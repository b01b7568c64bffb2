use ohmstrain_ekf::StepError;
use ohmstrain_model::ParameterError;
use thiserror::Error;

use crate::params::estimator::{EstimatorKind, NoParameters};
use crate::params::law::MOST_BRANCHES;
use crate::params::validate::FieldError;

/// Reason for having no filter of a sensor's parameters.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A number that no sensor can have.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// No parameters for the requested estimator.
    #[error("{0}")]
    NoParameters(#[from] NoParameters),
    /// A parameter that the model refuses.
    #[error("parameter: {0}")]
    Model(#[from] ParameterError),
    /// Parameters whose filter refuses to start.
    #[error("{0}")]
    Start(#[source] StepError),
    /// More branches than filters are built for.
    #[error("a law with {found} branches; at most {MOST_BRANCHES} are supported")]
    Branches {
        /// Number that was found.
        found: usize,
    },
    /// An estimator of phases without their durations.
    #[error("`{}` needs `phases` in its parameters", kind.name())]
    NoPhases {
        /// Kind of estimator.
        kind: EstimatorKind,
    },
}
