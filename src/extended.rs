//! Numbers that may be infinite, for formats that know none (JSON).

use std::fmt;

use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A number; in formats that people read, infinities and NaN are the words "inf", "-inf" and "nan".
struct Extended(f64);

impl Serialize for Extended {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            v if v.is_finite() || !s.is_human_readable() => s.serialize_f64(v),
            v if v.is_nan() => s.serialize_str("nan"),
            v if v > 0.0 => s.serialize_str("inf"),
            _ => s.serialize_str("-inf"),
        }
    }
}

impl<'de> Deserialize<'de> for Extended {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        if d.is_human_readable() {
            d.deserialize_any(NumberOrWord)
        } else {
            f64::deserialize(d).map(Self)
        }
    }
}

struct NumberOrWord;

impl Visitor<'_> for NumberOrWord {
    type Value = Extended;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, \"inf\", \"-inf\" or \"nan\"")
    }

    fn visit_f64<E: Error>(self, v: f64) -> Result<Extended, E> {
        Ok(Extended(v))
    }

    fn visit_i64<E: Error>(self, v: i64) -> Result<Extended, E> {
        Ok(Extended(v as f64))
    }

    fn visit_u64<E: Error>(self, v: u64) -> Result<Extended, E> {
        Ok(Extended(v as f64))
    }

    fn visit_str<E: Error>(self, v: &str) -> Result<Extended, E> {
        match v {
            "inf" => Ok(Extended(f64::INFINITY)),
            "-inf" => Ok(Extended(f64::NEG_INFINITY)),
            "nan" => Ok(Extended(f64::NAN)),
            _ => Err(E::invalid_value(Unexpected::Str(v), &self)),
        }
    }
}

pub(crate) fn serialize<S: Serializer>(v: &f64, s: S) -> Result<S::Ok, S::Error> {
    Extended(*v).serialize(s)
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    Extended::deserialize(d).map(|v| v.0)
}

/// The same for an interval.
pub(crate) mod pair {
    use super::{Deserialize, Deserializer, Extended, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(v: &(f64, f64), s: S) -> Result<S::Ok, S::Error> {
        (Extended(v.0), Extended(v.1)).serialize(s)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<(f64, f64), D::Error> {
        <(Extended, Extended)>::deserialize(d).map(|(a, b)| (a.0, b.0))
    }
}

/// The same for a list.
pub(crate) mod list {
    use super::{Deserialize, Deserializer, Extended, Serializer};

    pub(crate) fn serialize<S: Serializer>(v: &impl AsRef<[f64]>, s: S) -> Result<S::Ok, S::Error> {
        s.collect_seq(v.as_ref().iter().copied().map(Extended))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>, V: From<Vec<f64>>>(d: D) -> Result<V, D::Error> {
        let read = Vec::<Extended>::deserialize(d)?;
        Ok(read.into_iter().map(|v| v.0).collect::<Vec<f64>>().into())
    }
}
