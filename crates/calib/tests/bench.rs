use ohmstrain_calib::Samples;

/// A recording with known strain.
#[derive(Clone, Default)]
pub struct Bench {
    pub time_s: Vec<f64>,
    pub reading: Vec<f64>,
    pub strain: Vec<f64>,
}

impl Bench {
    pub fn samples(&self) -> Samples<'_> {
        Samples::new(&self.time_s, &self.reading, &self.strain).unwrap()
    }
}
