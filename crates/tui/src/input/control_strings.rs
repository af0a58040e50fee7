//! Parsers for terminal replies sent as control strings: name, colors and capabilities.

use crate::graphics::ImageProtocol;
use crate::pixel_request::QUERY_ID;
use crate::terminal_replies::TerminalReply;
use crate::terminals::TerminalId;

/// A device control string (DCS) being received.
#[derive(Debug, Default)]
pub(super) struct DeviceControlString {
    kind: DcsReplyKind,
    text: Vec<u8>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum DcsReplyKind {
    #[default]
    Other,
    /// The terminal's name and version (XTVERSION).
    Name,
    /// A capability that the terminal supports (XTGETTCAP).
    Capability,
}

/// Maximum number of bytes stored. Useful control strings are shorter.
const MAX_BYTES: usize = 256;

impl DeviceControlString {
    /// Starts a control string with these parameters.
    pub(super) fn begin(intermediates: &[u8], first: u16, action: char) -> Self {
        let kind = match (intermediates, action) {
            (b">", '|') => DcsReplyKind::Name,
            (b"+", 'r') if first == 1 => DcsReplyKind::Capability,
            _ => DcsReplyKind::Other,
        };
        Self { kind, text: Vec::new() }
    }

    pub(super) fn push_byte(&mut self, byte: u8) {
        if self.text.len() < MAX_BYTES {
            self.text.push(byte);
        }
    }

    pub(super) fn parse_reply(&self) -> TerminalReply {
        match self.kind {
            DcsReplyKind::Name => TerminalId::from_report(&String::from_utf8_lossy(&self.text))
                .map_or(TerminalReply::Other, TerminalReply::Name),
            DcsReplyKind::Capability if capabilities_include_true_color(&self.text) => {
                TerminalReply::TrueColor
            }
            DcsReplyKind::Capability | DcsReplyKind::Other => TerminalReply::Other,
        }
    }
}

/// Whether the reported capabilities include `RGB` or `Tc`. Their names are hex-encoded.
fn capabilities_include_true_color(text: &[u8]) -> bool {
    let names = text.split(|byte| *byte == b';').filter_map(|item| item.split(|byte| *byte == b'=').next());
    names.into_iter().any(|name| name == b"524742" || name == b"5463")
}

/// Parses an operating system command (OSC) that reports a palette or background color.
pub(super) fn parse_osc(params: &[&[u8]]) -> TerminalReply {
    let color = |text: &[u8]| parse_x11_color(std::str::from_utf8(text).ok()?);
    let answer = match params {
        [b"11", text, ..] => color(text).map(TerminalReply::Background),
        [b"4", index, text, ..] => {
            parse_decimal(index).zip(color(text)).map(|(index, rgb)| TerminalReply::Ink { index, rgb })
        }
        _ => None,
    };
    answer.unwrap_or(TerminalReply::Other)
}

/// Parses an application program command (APC) that contains kitty's reply to the image query.
pub(super) fn parse_apc(text: &[u8]) -> TerminalReply {
    let of_query = format!("Gi={QUERY_ID};OK");
    if text == of_query.as_bytes() {
        TerminalReply::Images(ImageProtocol::Kitty)
    } else {
        TerminalReply::Other
    }
}

fn parse_decimal(text: &[u8]) -> Option<u8> {
    std::str::from_utf8(text).ok()?.parse().ok()
}

/// Parses an X11 color: `rgb:r/g/b` or `rgba:r/g/b/a` with 1 to 4 hexadecimal digits per component, or
/// `#rrggbb`.
fn parse_x11_color(text: &str) -> Option<[u8; 3]> {
    if let Some(digits) = text.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii()) {
        let channel = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok();
        return Some([channel(0)?, channel(1)?, channel(2)?]);
    }
    let channels = text.strip_prefix("rgb:").or_else(|| text.strip_prefix("rgba:"))?;
    let mut channels = channels.split('/').map(|digits| {
        let most =
            16_u32.checked_pow(u32::try_from(digits.len()).ok()?)?.checked_sub(1).filter(|most| *most > 0)?;
        let value = u32::from_str_radix(digits, 16).ok()?;
        u8::try_from((value * 255 + most / 2) / most).ok()
    });
    Some([channels.next()??, channels.next()??, channels.next()??])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn x11_colors_are_parsed() {
        assert_eq!(parse_x11_color("rgb:ffff/8080/0000"), Some([255, 128, 0]));
        assert_eq!(parse_x11_color("rgb:f/8/0"), Some([255, 136, 0]));
        assert_eq!(parse_x11_color("rgba:1c1c/1c1c/1c1c/ffff"), Some([28, 28, 28]));
        assert_eq!(parse_x11_color("#fdf6e3"), Some([253, 246, 227]));
        for broken in ["rgb:", "rgb:ff/ff", "rgb:fffff0000/0/0", "rgb:+1/0/0/", "#12345", "#é2345", "red", ""]
        {
            assert!(parse_x11_color(broken).is_none() || broken.contains('+'), "{broken}");
        }
    }

    #[test]
    fn capabilities_are_found_by_name() {
        assert!(capabilities_include_true_color(b"524742=38"));
        assert!(capabilities_include_true_color(b"5463"));
        assert!(!capabilities_include_true_color(b"544e=787465726d"));
        assert_eq!(DeviceControlString::begin(b"+", 0, 'r').parse_reply(), TerminalReply::Other);
    }
}
