//! Arrays with an entry for each axis, for serde, which has none of generic length.

use serde::de::{Deserialize, Deserializer, Error};
use serde::ser::{Serialize, Serializer};

pub fn serialize<S: Serializer, T: Serialize, const D: usize>(
    entries: &[T; D],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    entries.as_slice().serialize(serializer)
}

pub fn deserialize<'de, R: Deserializer<'de>, T: Deserialize<'de>, const D: usize>(
    deserializer: R,
) -> Result<[T; D], R::Error> {
    let list = Vec::deserialize(deserializer)?;
    let wrong = |list: Vec<T>| Error::invalid_length(list.len(), &"an entry for each axis");
    list.try_into().map_err(wrong)
}
