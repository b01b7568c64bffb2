//! JSON with its order preserved.

use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use crate::import::bytes::cell::Cell;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Json {
    /// A number, a text, true, false or null.
    Cell(Cell<'static>),
    List(Vec<Json>),
    Object(Vec<(String, Json)>),
}

/// Returns successive values, each with its line number; a line that is not JSON has no value.
pub(crate) fn values(text: &str) -> Vec<(u64, Option<Json>)> {
    let (mut out, mut start, mut line) = (Vec::new(), 0, 1_u64);
    while start < text.len() {
        let blanks = text[start..].len() - text[start..].trim_start().len();
        line += newlines(&text[start..start + blanks]);
        start += blanks;
        if start == text.len() {
            break;
        }
        let mut stream = serde_json::Deserializer::from_str(&text[start..]).into_iter::<Json>();
        let value = stream.next().and_then(Result::ok);
        let end = match value {
            Some(_) => stream.byte_offset(),
            None => text[start..].find('\n').unwrap_or(text.len() - start),
        };
        out.push((line, value));
        line += newlines(&text[start..start + end]);
        start += end;
        // Objects of a list without its brackets are separated by commas.
        start += usize::from(text[start..].starts_with(','));
    }
    out
}

fn newlines(text: &str) -> u64 {
    text.bytes().filter(|byte| *byte == b'\n').count() as u64
}

impl<'de> Deserialize<'de> for Json {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AnyValue)
    }
}

struct AnyValue;

impl<'de> Visitor<'de> for AnyValue {
    type Value = Json;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str("a JSON value")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Json, E> {
        Ok(Json::Cell(Cell::Number(f64::from(u8::from(value)))))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Json, E> {
        Ok(Json::Cell(Cell::count(value)))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Json, E> {
        Ok(Json::Cell(i64::try_from(value).map_or_else(|_| Cell::Text(value.to_string().into()), Cell::count)))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Json, E> {
        Ok(Json::Cell(Cell::Number(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<Json, E> {
        Ok(Json::Cell(Cell::Text(value.trim().to_owned().into())))
    }

    fn visit_unit<E>(self) -> Result<Json, E> {
        Ok(Json::Cell(Cell::Empty))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Json, A::Error> {
        let mut out = Vec::new();
        while let Some(value) = list.next_element()? {
            out.push(value);
        }
        Ok(Json::List(out))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Json, A::Error> {
        let mut out = Vec::new();
        while let Some(pair) = map.next_entry()? {
            out.push(pair);
        }
        Ok(Json::Object(out))
    }
}
