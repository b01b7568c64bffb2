use crate::marks::MarksError;
use crate::samples::SamplesError;
use ohmstrain_ekf::StepError;
use ohmstrain_model::ParameterError;
use ohmstrain_sensor::SensorError;
use thiserror::Error;

/// Reason why a calibration failed.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// No recording to calibrate on.
    #[error("no recording with a known strain was given")]
    NoRecording,
    /// Channels that cannot be fused.
    #[error(
        "channels of one strain: expected two or more with the same times, and in each quarter of a recording rows with readings of \
         all of them and a known strain"
    )]
    NoCommonRows,
    /// A recording is too short.
    #[error(
        "recording {} has {complete} rows with reading and reference, at least {needed} are needed",
        recording + 1
    )]
    TooFewRows {
        /// Index of the recording.
        recording: usize,
        /// Rows with both reading and reference.
        complete: usize,
        /// Rows needed.
        needed: usize,
    },
    /// Slices that do not form a recording.
    #[error(transparent)]
    Samples(#[from] SamplesError),
    /// Marks that do not give a reference.
    #[error("{}{source}", source.mark().map_or(String::new(), |mark| format!("mark {}: ", mark + 1)))]
    Marks {
        /// Index of the recording.
        recording: usize,
        /// Fault of the marks.
        source: MarksError,
    },
    /// The readings never change.
    #[error("the reading is constant: nothing can be learned from it")]
    ConstantReading,
    /// The reference never moves.
    #[error("the reference is constant: nothing can be learned from it")]
    ConstantStrain,
    /// Readings that the reference does not explain.
    #[error(
        "the readings have nothing to do with the reference: on parts that the law has not seen, it leaves {:.0} % of \
         their variance; are both of the same sensor, on the same clock and in the right columns?",
        100.0 * unexplained
    )]
    NothingExplained {
        /// Squared error of the law over that of a constant, on held-out blocks.
        unexplained: f64,
    },
    /// The least-squares problem has no unique solution.
    #[error("the law cannot be fitted: its equations are singular")]
    Singular,
    /// The fitted resistance at zero strain is not positive.
    #[error("the reading at zero strain comes out as {value:.4} of the median reading; record nearer to zero strain")]
    RestResistance {
        /// Rest resistance over the median reading.
        value: f64,
    },
    /// A fitted parameter is out of range.
    #[error("fitted parameter: {0}")]
    Parameter(#[from] ParameterError),
    /// The filter failed on the recording.
    #[error("the filter fails on the recording at {time_s} s: {source}")]
    Filter {
        /// Time of the failing row, s.
        time_s: f64,
        /// Error of the filter.
        source: StepError,
    },
    /// The optimiser failed.
    #[error("optimiser: {0}")]
    Optimiser(String),
    /// No filter can be made of the parameters.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// A request that this version does not support.
    #[error("{0}")]
    Unsupported(String),
}
