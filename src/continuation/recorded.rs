//! Serialisation of errors: an error is read back as its message.

use serde::{Deserialize, Deserializer, Serializer};

use super::ContinuationError;

pub(crate) fn serialize<S: Serializer>(e: &ContinuationError, s: S) -> Result<S::Ok, S::Error> {
    s.collect_str(e)
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<ContinuationError, D::Error> {
    String::deserialize(d).map(|message| ContinuationError::Recorded { message })
}
