//! Base64 (RFC 4648, section 4), as data URIs have it.

/// Decodes; the padding may be missing.
///
/// # Errors
/// A byte that is no digit, or a length that no bytes have, in words.
pub(super) fn decode(coded: &[u8]) -> Result<Vec<u8>, String> {
    let padding = coded.iter().rev().take(2).take_while(|byte| **byte == b'=').count();
    let digits = &coded[..coded.len() - padding];
    if digits.len() % 4 == 1 {
        return Err(format!("base64 of {} digits", digits.len()));
    }
    let mut bytes = Vec::new();
    let length = digits.len() / 4 * 3 + 2;
    bytes.try_reserve_exact(length).map_err(|_| format!("no memory for {length} bytes of base64"))?;
    for group in digits.chunks(4) {
        let mut number = 0_u32;
        for &byte in group {
            number = number << 6
                | u32::from(value(byte).ok_or_else(|| format!("byte {byte:#04x} is no digit of base64"))?);
        }
        let missing = 4 - group.len();
        let [_, whole @ ..] = (number << (6 * missing)).to_be_bytes();
        bytes.extend_from_slice(&whole[..3 - missing]);
    }
    Ok(bytes)
}

/// The value of a digit.
fn value(digit: u8) -> Option<u8> {
    match digit {
        b'A'..=b'Z' => Some(digit - b'A'),
        b'a'..=b'z' => Some(digit - b'a' + 26),
        b'0'..=b'9' => Some(digit - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::decode;

    /// The test vectors of RFC 4648, section 10.
    #[test]
    fn the_vectors_of_the_rfc() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(decode(coded.as_bytes()), Ok(plain.as_bytes().to_vec()));
            assert_eq!(decode(coded.trim_end_matches('=').as_bytes()), Ok(plain.as_bytes().to_vec()));
        }
        assert_eq!(decode(b"+/8="), Ok(vec![0xfb, 0xff]));
        assert!(decode(b"Zm9vY").is_err() && decode(b"Zm9?").is_err() && decode(b"Z===").is_err());
    }
}
