//! The LSP base protocol on stdin and stdout: a header with a length, followed by JSON.
//!
//! `lsp_server`'s reader stops at invalid messages and allocates as many bytes as the header claims. This
//! reader responds to invalid messages with an error and limits the length.

use std::io::{self, BufRead, Read, Write};
use std::sync::{Arc, Mutex, PoisonError};

use lsp_server::{ErrorCode, Message};
use serde_json::{Value, json};

/// Maximum message size: enough for the largest scene with every byte escaped.
const MAX_MESSAGE_BYTES: u64 = 6 << 27;
/// Maximum header size.
const MAX_HEADER_BYTES: u64 = 1 << 14;

/// A frame from the client.
#[derive(Debug)]
pub(super) enum ReceivedFrame {
    /// A valid message.
    Message(Message),
    /// The response to an invalid message.
    Invalid(Value),
}

/// Reads the next frame, or returns `None` at the end of the stream.
///
/// # Errors
/// Returns an error if the stream cannot be read, or if the frame is malformed or too long.
pub(super) fn read_frame(from: &mut impl BufRead) -> Result<Option<ReceivedFrame>, String> {
    let Some(length) = read_content_length(from)? else { return Ok(None) };
    if length > MAX_MESSAGE_BYTES {
        return Err(format!("a message of {length} bytes is too long; the limit is {MAX_MESSAGE_BYTES}"));
    }
    // Allocate as bytes arrive.
    let mut bytes = Vec::new();
    from.by_ref().take(length).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if (bytes.len() as u64) < length {
        return Err(format!("stdin ended within a message: {} of {length} bytes", bytes.len()));
    }
    Ok(Some(parse_message(bytes)))
}

/// Reads a header and returns the content length, or `None` if the stream ends before the header.
fn read_content_length(from: &mut impl BufRead) -> Result<Option<u64>, String> {
    let mut header = from.by_ref().take(MAX_HEADER_BYTES);
    let mut length = None;
    let mut is_first = true;
    loop {
        let mut line = Vec::new();
        header.read_until(b'\n', &mut line).map_err(|error| error.to_string())?;
        let text = String::from_utf8_lossy(&line);
        if line.is_empty() && is_first {
            return Ok(None);
        }
        if !text.ends_with('\n') {
            return Err("stdin ended within a header, or the header is too long".to_owned());
        }
        is_first = false;
        let text = text.trim_end();
        if text.is_empty() {
            return length.map(Some).ok_or_else(|| "a header has no Content-Length".to_owned());
        }
        let Some((name, value)) = text.split_once(':') else {
            return Err(format!("invalid header: {:?}", text.chars().take(60).collect::<String>()));
        };
        if name.trim().eq_ignore_ascii_case("Content-Length") {
            let number = value.trim().parse();
            length = Some(number.map_err(|_| format!("invalid Content-Length: {:?}", value.trim()))?);
        }
    }
}

/// Parses the contents of a frame.
fn parse_message(bytes: Vec<u8>) -> ReceivedFrame {
    let text = String::from_utf8(bytes).map_err(|_| "the message is not UTF-8".to_owned());
    let json = text.and_then(|text| {
        serde_json::from_str::<Value>(&text)
            .or_else(|_| serde_json::from_str(&replace_unpaired_surrogates(&text)))
            .map_err(|error| format!("the message is not JSON: {error}"))
    });
    let json = match json {
        Ok(json) => json,
        Err(why) => return ReceivedFrame::Invalid(error_response(&Value::Null, ErrorCode::ParseError, &why)),
    };
    let id = json.get("id").filter(|id| id.is_string() || id.is_number()).cloned().unwrap_or_default();
    match serde_json::from_value(json) {
        Ok(message) => ReceivedFrame::Message(message),
        Err(_) => ReceivedFrame::Invalid(error_response(
            &id,
            ErrorCode::InvalidRequest,
            "neither a request nor a notification",
        )),
    }
}

/// Creates an error response. `id` is null if the request's ID is unknown.
fn error_response(id: &Value, code: ErrorCode, why: &str) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code as i32, "message": why } })
}

/// Replaces unpaired escaped surrogates with U+FFFD. Editors send unpaired surrogates while a character is
/// being typed.
fn replace_unpaired_surrogates(text: &str) -> String {
    let surrogate = |at: usize| {
        let digits = text.get(at..)?.strip_prefix("\\u")?.get(..4)?;
        u32::from_str_radix(digits, 16).ok().filter(|unit| (0xd800..0xe000).contains(unit))
    };
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    while let Some(found) = text.get(at..).and_then(|rest| rest.find('\\')).map(|more| at + more) {
        out.push_str(&text[at..found]);
        let (first, second) = (surrogate(found), surrogate(found + 6));
        let (taken, length) = match (first, second) {
            (Some(0xd800..0xdc00), Some(0xdc00..)) => (text.get(found..found + 12), 12),
            (Some(_), _) => (Some("\\ufffd"), 6),
            // Copy a backslash and the character it escapes.
            (None, _) => {
                let next = text[found + 1..].chars().next().map_or(0, char::len_utf8);
                (text.get(found..found + 1 + next), 1 + next)
            }
        };
        out.push_str(taken.unwrap_or_default());
        at = found + length;
    }
    out.push_str(text.get(at..).unwrap_or_default());
    out
}

/// The connection to the client, shared between threads.
#[derive(Clone)]
pub(super) struct ClientWriter(Arc<Mutex<Box<dyn Write + Send>>>);

impl ClientWriter {
    pub(super) fn new(to: impl Write + Send + 'static) -> Self {
        Self(Arc::new(Mutex::new(Box::new(to))))
    }

    /// Sends a message. Ignores a closed connection.
    pub(super) fn send(&self, message: &Message) {
        let _ = message.write(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Sends an error response.
    pub(super) fn send_error(&self, answer: &Value) {
        let mut to = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let text = answer.to_string();
        let written: io::Result<()> =
            write!(to, "Content-Length: {}\r\n\r\n{text}", text.len()).and_then(|()| to.flush());
        // Ignore a closed connection.
        drop(written);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unpaired_surrogates_are_replaced() {
        for (text, wanted) in [
            (r#""a\ud83db""#, "a\u{fffd}b"),
            (r#""\ud83d\ude00""#, "😀"),
            (r#""\ude00\ud83d""#, "\u{fffd}\u{fffd}"),
            (r#""\\ud83d""#, "\\ud83d"),
            (r#""\ud83d\ud83d\ude00é\n""#, "\u{fffd}😀é\n"),
        ] {
            assert_eq!(
                serde_json::from_str::<String>(&replace_unpaired_surrogates(text)).expect(text),
                wanted
            );
        }
        assert_eq!(replace_unpaired_surrogates("\\"), "\\");
        assert_eq!(replace_unpaired_surrogates("\\u12"), "\\u12");
    }

    #[test]
    fn oversized_messages_are_rejected() {
        let mut far = &b"Content-Length: 1000000000000\r\n\r\n{}"[..];
        assert!(read_frame(&mut far).expect_err("too long").contains("1000000000000 bytes"));
        let mut cut = &b"Content-Length: 500000000\r\n\r\n{}"[..];
        assert!(read_frame(&mut cut).expect_err("truncated").contains("2 of 500000000 bytes"));
        assert!(read_frame(&mut &b""[..]).expect("the end").is_none());
    }
}
