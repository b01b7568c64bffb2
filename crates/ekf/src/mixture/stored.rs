//! A [`Mixture`] as plain data: its hypotheses, without empty places.

use core::fmt;
use core::marker::PhantomData;

use ohmstrain_model::{Phase, Scalar};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeSeq, Serializer};

use crate::mixture::pause::Pause;
use crate::mixture::{Mixture, Share};
use crate::{Belief, Real};

/// A hypothesis.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(bound(serialize = "T: Scalar + Serialize", deserialize = "T: Scalar + Deserialize<'de>"))]
struct Stored<T, const N: usize, const L: usize> {
    phase: Phase,
    weight: T,
    belief: Belief<T, N, L>,
    per_inside: T,
}

/// The hypotheses of a mixture, one after another.
struct Following<T, const N: usize, const L: usize, const K: usize>(Mixture<T, N, L, K>);

#[derive(serde::Serialize, serde::Deserialize)]
#[serde(rename = "Mixture")]
#[serde(bound(serialize = "T: Real + Serialize", deserialize = "T: Real + Deserialize<'de>"))]
struct Whole<T, const N: usize, const L: usize, const K: usize> {
    room: usize,
    pause: Pause<T>,
    followed: Following<T, N, L, K>,
}

impl<T: Real + Serialize, const N: usize, const L: usize, const K: usize> Serialize for Mixture<T, N, L, K> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Whole { room: self.room(), pause: *self.pause(), followed: Following(*self) }.serialize(serializer)
    }
}

impl<'de, T: Real + Deserialize<'de>, const N: usize, const L: usize, const K: usize> Deserialize<'de>
    for Mixture<T, N, L, K>
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Whole { room, pause, followed: Following(mut mixture) } = Whole::deserialize(deserializer)?;
        if !(1..=K).contains(&room) {
            return Err(D::Error::custom(format_args!("expected room for 1 to {K} hypotheses, found {room}")));
        }
        mixture.restore(room, pause);
        Ok(mixture)
    }
}

impl<T: Real + Serialize, const N: usize, const L: usize, const K: usize> Serialize for Following<T, N, L, K> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(mixture) = self;
        let mut places = serializer.serialize_seq(Some(mixture.shares().len()))?;
        for (share, phase) in mixture.shares().iter().zip(mixture.phases()) {
            let Share { weight, belief, per_inside } = *share;
            places.serialize_element(&Stored { phase: *phase, weight, belief, per_inside })?;
        }
        places.end()
    }
}

impl<'de, T: Real + Deserialize<'de>, const N: usize, const L: usize, const K: usize> Deserialize<'de>
    for Following<T, N, L, K>
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Places(PhantomData))
    }
}

struct Places<T, const N: usize, const L: usize, const K: usize>(PhantomData<T>);

impl<'de, T: Real + Deserialize<'de>, const N: usize, const L: usize, const K: usize> Visitor<'de>
    for Places<T, N, L, K>
{
    type Value = Following<T, N, L, K>;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "1 to {K} hypotheses")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut places: A) -> Result<Self::Value, A::Error> {
        let mut mixture = Mixture::empty();
        let mut followed = 0;
        while let Some(Stored { phase, weight, belief, per_inside }) = places.next_element::<Stored<T, N, L>>()? {
            followed += 1;
            let Some((to, of)) = mixture.one_more() else { return Err(A::Error::invalid_length(followed, &self)) };
            (*to, *of) = (Share { weight, belief, per_inside }, phase);
        }
        if followed == 0 { Err(A::Error::invalid_length(0, &self)) } else { Ok(Following(mixture)) }
    }
}
