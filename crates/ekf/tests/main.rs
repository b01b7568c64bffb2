//! Estimation through the public interface. One test program; a module for each subject.

mod correction;
mod estimate;
mod hostile;
mod kalman;
mod live;
mod step;
