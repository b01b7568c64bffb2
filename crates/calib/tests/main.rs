//! Fits of sensors whose law is written down in the test. One test program with a module for each subject.

mod baselines;
mod bench;
mod calibration;
mod closed_form_laws;
mod closed_form_nist;
mod closed_form_recovery;
mod crps;
mod fusion;
mod identifiability;
mod lag;
mod likelihood;
mod likelihood_sensor;
mod marks;
mod parameter_coverage;
mod samples;
