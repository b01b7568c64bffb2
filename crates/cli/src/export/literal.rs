use serde::{Serialize, Serializer};

/// A number as source code: the shortest decimal that reads back as the same `f32`, always with a point or an exponent.
/// Templates add C's suffix `f`; hexadecimal floats would be exact too, but C++ has them since 2017 only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Literal(pub f32);

impl Literal {
    /// The number as text, without a suffix.
    pub fn text(self) -> String {
        format!("{:?}", self.0)
    }
}

impl Serialize for Literal {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{:?}", self.0))
    }
}

/// Several of them.
pub fn literals<'a>(values: impl IntoIterator<Item = &'a f32>) -> Vec<Literal> {
    values.into_iter().copied().map(Literal).collect()
}
