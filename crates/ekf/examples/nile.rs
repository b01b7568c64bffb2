//! The flow of the Nile, 1871–1970, as a random walk observed with noise. Prints both variances and the log-likelihood.

use nalgebra::{matrix, vector};
use ohmstrain_ekf::kalman::{Filter, Kalman, KalmanError, NoMaximum, Normal, maximise};

/// Annual flow, 10⁸ m³: Cobb, *Biometrika* 65 (1978) 243.
#[rustfmt::skip]
pub const FLOW: [f64; 100] = [
    1120., 1160., 963., 1210., 1160., 1160., 813., 1230., 1370., 1140., 995., 935., 1110., 994., 1020., 960., 1180., 799., 958., 1140.,
    1100., 1210., 1150., 1250., 1260., 1220., 1030., 1100., 774., 840., 874., 694., 940., 833., 701., 916., 692., 1020., 1050., 969.,
    831., 726., 456., 824., 702., 1120., 1100., 832., 764., 821., 768., 845., 864., 862., 698., 845., 744., 796., 1040., 759.,
    781., 865., 845., 944., 984., 897., 822., 1010., 771., 676., 649., 846., 812., 742., 801., 1040., 860., 874., 848., 890.,
    744., 749., 838., 1050., 918., 986., 797., 923., 975., 815., 1020., 906., 901., 1170., 912., 746., 919., 718., 714., 740.,
];

/// ℓ(ln σ²_ε, ln σ²_η) of readings and level, from a diffuse start.
pub fn log_likelihood([reading, level]: &[f64; 2]) -> Result<f64, KalmanError> {
    let filter = Kalman::new(matrix![1.0], matrix![level.exp()], matrix![1.0], matrix![reading.exp()]);
    let mut step = filter.update(&Normal::independent(vector![0.0], &vector![1e7])?, &[Some(FLOW[0])])?;
    let mut sum = step.log_likelihood;
    for flow in &FLOW[1..] {
        step = filter.step(&step.posterior, &[Some(*flow)])?;
        sum += step.log_likelihood;
    }
    Ok(sum)
}

fn main() -> Result<(), NoMaximum> {
    let found = maximise([9.0, 7.0], log_likelihood)?;
    println!("{:.1?} ± {:.2?}, relative", found.parameters.map(f64::exp), found.standard_errors);
    println!("{:.4}", found.log_likelihood);
    Ok(())
}
