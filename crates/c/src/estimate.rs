use ohmstrain::Flag;

/// An estimate as C sees it, `ohmc_estimate`. Numbers that do not exist are NaN.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Time, s.
    pub time_s: f64,
    /// Strain, within the sensor's limits.
    pub strain: f64,
    /// Its standard deviation.
    pub strain_sd: f64,
    /// Strain rate, 1/s.
    pub strain_rate: f64,
    /// Its standard deviation.
    pub strain_rate_sd: f64,
    /// Sum of the relaxing branches, relative to R₀.
    pub relaxation: f64,
    /// Its standard deviation.
    pub relaxation_sd: f64,
    /// Slow drift and error of the law, relative to R₀.
    pub baseline: f64,
    /// Reading after a long hold from now on, in the sensor's unit.
    pub settled_resistance: f64,
    /// Its standard deviation.
    pub settled_resistance_sd: f64,
    /// Probability that the sensor is being stretched.
    pub p_extend: f64,
    /// Probability that it is held.
    pub p_hold: f64,
    /// Probability that it is being released.
    pub p_retract: f64,
    /// Probability that the strain lies beyond the peak of the quasi-static curve.
    pub p_beyond_border: f64,
    /// Squared innovation of the reading over its variance.
    pub nis: f64,
    /// Angle of the joint, degrees.
    pub angle_deg: f64,
    /// Its standard deviation.
    pub angle_sd: f64,
    /// Flags: bit k is the k-th of [`Flag::ALL`].
    pub flags: u32,
}

impl From<&ohmstrain::Estimate> for Estimate {
    fn from(row: &ohmstrain::Estimate) -> Self {
        let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let bits = Flag::ALL.iter().enumerate().map(|(bit, flag)| u32::from(row.flags.has(*flag)) << bit);
        Self {
            time_s: row.time_s,
            strain: row.strain,
            strain_sd: row.strain_sd,
            strain_rate: row.strain_rate,
            strain_rate_sd: row.strain_rate_sd,
            relaxation: row.relaxation,
            relaxation_sd: row.relaxation_sd,
            baseline: row.baseline,
            settled_resistance: row.settled_resistance,
            settled_resistance_sd: row.settled_resistance_sd,
            p_extend: known(row.p_extend),
            p_hold: known(row.p_hold),
            p_retract: known(row.p_retract),
            p_beyond_border: row.p_beyond_border,
            nis: known(row.nis),
            angle_deg: known(row.angle_deg),
            angle_sd: known(row.angle_sd),
            flags: bits.sum(),
        }
    }
}
