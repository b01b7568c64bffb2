//! Tests that need more than one crate. One test program, with a module for each subject.

mod adskalman_bridge;
mod adskalman_vectors;
mod another_day;
mod capacity;
mod consistency;
mod cramer_rao;
mod direction;
mod faults;
mod guards;
mod linear_oracles;
mod long_run;
mod mixture_smoother;
mod mixtures;
mod naive_mixtures;
mod one_kalman_filter;
mod particle_oracles;
mod particles;
mod phase_calibration;
mod properties;
mod published_numbers;
mod representative;
mod running_filter;
mod sigma_points;
mod sparse;
mod stored;

#[path = "../modules.rs"]
mod modules;
