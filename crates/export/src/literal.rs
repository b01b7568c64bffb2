use serde::ser::Error;
use serde::{Serialize, Serializer};

/// A number as source code: the shortest decimal that reads back as the same `f32`, always with a point or an exponent.
/// Templates add C's suffix `f`; hexadecimal floats would be exact too, but C++ has them since 2017 only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Literal(pub f32);

impl Literal {
    /// Returns the number as text, without a suffix.
    pub fn text(self) -> String {
        format!("{:?}", self.0)
    }
}

impl Serialize for Literal {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // A number that is not finite would not compile, or worse.
        if !self.0.is_finite() {
            return Err(S::Error::custom(format_args!("a number of the sensor is {:?} in single precision", self.0)));
        }
        serializer.collect_str(&self.text())
    }
}

/// Converts several numbers.
pub fn literals<'a>(values: impl IntoIterator<Item = &'a f32>) -> Vec<Literal> {
    values.into_iter().copied().map(Literal).collect()
}
