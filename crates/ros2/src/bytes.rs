//! A message that is encoded already.

use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

/// Encapsulation header of CDR, bytes (OMG DDSI-RTPS 2.3, 10.5).
pub(crate) const ENCAPSULATION: usize = 4;

/// The bytes of a message of [`recording::messages`], sent as they are: bytes need no alignment, so
/// that an encoder copies them one by one. Its own encapsulation header takes the place of theirs
/// (both little endian).
#[derive(Debug, Clone)]
pub(crate) struct Encoded(pub(crate) Vec<u8>);

impl Serialize for Encoded {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let body = self.0.get(ENCAPSULATION..).unwrap_or_default();
        let mut bytes = serializer.serialize_tuple(body.len())?;
        for byte in body {
            bytes.serialize_element(byte)?;
        }
        bytes.end()
    }
}
