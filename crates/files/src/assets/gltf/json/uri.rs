//! URIs of buffers and images.

use std::fmt;

use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine};
use serde::de::{Deserialize, Deserializer, Error, Visitor};

/// URI of a buffer or image.
#[derive(Debug)]
pub(crate) enum Uri {
    /// Decoded bytes of a data URI.
    Data(Vec<u8>),
    /// URI of a file, as written in the JSON.
    File(String),
}

impl<'de> Deserialize<'de> for Uri {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct UriVisitor;
        impl Visitor<'_> for UriVisitor {
            type Value = Uri;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a URI")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Uri, E> {
                let Some(data) = text.strip_prefix("data:") else { return Ok(Uri::File(text.to_owned())) };
                let (kind, coded) =
                    data.split_once(',').ok_or_else(|| E::custom("a data URI without a comma"))?;
                if !kind.ends_with(";base64") {
                    return Err(E::custom("a data URI that is not base64"));
                }
                decode_base64(coded).map(Uri::Data).map_err(E::custom)
            }
        }
        deserializer.deserialize_str(UriVisitor)
    }
}

/// Base64 decoder for data URIs (RFC 4648, section 4). Padding is optional.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

fn decode_base64(coded: &str) -> Result<Vec<u8>, String> {
    BASE64.decode(coded).map_err(|error| match error {
        DecodeError::InvalidByte(at, byte) => invalid_base64_message(byte, at),
        DecodeError::InvalidLength(digits) => format!("invalid base64 length: {digits} digits"),
        DecodeError::InvalidLastSymbol { .. } | DecodeError::InvalidPadding => "truncated base64".to_owned(),
    })
}

pub(crate) fn invalid_base64_message(byte: u8, at: usize) -> String {
    format!("invalid base64 byte {byte:#04x} at {at}")
}
