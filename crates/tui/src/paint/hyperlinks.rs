//! Hyperlinks in text (OSC 8).

use ratatui::layout::Rect;

/// Escape sequence that ends a hyperlink.
pub const LINK_OFF: &[u8] = b"\x1b]8;;\x1b\\";
/// Maximum number of hyperlinks per screen.
const MAX_HYPERLINKS: usize = 1000;

/// Adjacent cells in a row, and the URL that they link to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hyperlink {
    /// The linked cells.
    pub cells: Rect,
    /// An ASCII URL without control characters.
    pub address: String,
}

/// URLs linked on the screen, numbered from 1. Numbers never change.
#[derive(Debug, Default)]
pub(super) struct UrlTable {
    addresses: Vec<String>,
}

impl UrlTable {
    /// Returns a URL's number, assigning one if the URL is new. Returns 0 if the URL is invalid or there are
    /// too many URLs.
    pub(super) fn assign_url_number(&mut self, address: &str) -> u16 {
        if !address.bytes().all(|byte| byte.is_ascii_graphic()) {
            return 0;
        }
        let known = self.addresses.iter().position(|known| known == address);
        let index = known.unwrap_or_else(|| {
            if self.addresses.len() < MAX_HYPERLINKS {
                self.addresses.push(address.to_owned());
            }
            self.addresses.len() - 1
        });
        let is_known = self.addresses.get(index).is_some_and(|there| there == address);
        if is_known { u16::try_from(index + 1).unwrap_or(0) } else { 0 }
    }

    /// Appends the bytes that open a hyperlink, closing the previous one. Number 0 only closes it.
    pub(super) fn push_link_start(&self, number: u16, out: &mut Vec<u8>) {
        let address = usize::from(number).checked_sub(1).and_then(|index| self.addresses.get(index));
        match address {
            Some(address) => out.extend_from_slice(format!("\x1b]8;;{address}\x1b\\").as_bytes()),
            None => out.extend_from_slice(LINK_OFF),
        }
    }

    /// Whether there are no hyperlinks.
    pub(super) fn is_empty(&self) -> bool {
        self.addresses.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hyperlinks_keep_their_numbers() {
        let mut links = UrlTable::default();
        assert_eq!(
            [
                links.assign_url_number("file:///a"),
                links.assign_url_number("file:///b"),
                links.assign_url_number("file:///a")
            ],
            [1, 2, 1]
        );
        assert_eq!(
            [links.assign_url_number("a b"), links.assign_url_number("\x1b]"), links.assign_url_number("ä")],
            [0; 3]
        );
        let mut out = Vec::new();
        links.push_link_start(2, &mut out);
        links.push_link_start(0, &mut out);
        assert_eq!(out, b"\x1b]8;;file:///b\x1b\\\x1b]8;;\x1b\\");
    }
}
