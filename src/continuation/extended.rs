//! Numbers that may be infinite, for formats that know none (JSON), and errors as their messages.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
enum Extended {
    Number(f64),
    PlusInfinity,
    MinusInfinity,
    NotANumber,
}

impl From<f64> for Extended {
    fn from(v: f64) -> Self {
        match v {
            v if v.is_finite() => Self::Number(v),
            v if v.is_nan() => Self::NotANumber,
            v if v > 0.0 => Self::PlusInfinity,
            _ => Self::MinusInfinity,
        }
    }
}

impl From<Extended> for f64 {
    fn from(v: Extended) -> Self {
        match v {
            Extended::Number(v) => v,
            Extended::PlusInfinity => Self::INFINITY,
            Extended::MinusInfinity => Self::NEG_INFINITY,
            Extended::NotANumber => Self::NAN,
        }
    }
}

pub(super) fn serialize<S: Serializer>(v: &f64, s: S) -> Result<S::Ok, S::Error> {
    Extended::from(*v).serialize(s)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    Extended::deserialize(d).map(f64::from)
}

/// The same for an interval.
pub(in crate::continuation) mod pair {
    use super::{Deserialize, Deserializer, Extended, Serialize, Serializer};

    pub(in crate::continuation) fn serialize<S: Serializer>(v: &(f64, f64), s: S) -> Result<S::Ok, S::Error> {
        (Extended::from(v.0), Extended::from(v.1)).serialize(s)
    }

    pub(in crate::continuation) fn deserialize<'de, D: Deserializer<'de>>(
        d: D,
    ) -> Result<(f64, f64), D::Error> {
        <(Extended, Extended)>::deserialize(d).map(|(a, b)| (a.into(), b.into()))
    }
}

/// An error comes back as its message.
pub(in crate::continuation) mod error {
    use serde::{Deserialize, Deserializer, Serializer};

    use crate::continuation::ContinuationError;

    pub(in crate::continuation) fn serialize<S: Serializer>(
        e: &ContinuationError,
        s: S,
    ) -> Result<S::Ok, S::Error> {
        s.collect_str(e)
    }

    pub(in crate::continuation) fn deserialize<'de, D: Deserializer<'de>>(
        d: D,
    ) -> Result<ContinuationError, D::Error> {
        String::deserialize(d).map(|message| ContinuationError::Recorded { message })
    }
}
