//! Links in the text (OSC 8).

use ratatui::layout::Rect;

/// Bytes that end a link.
pub const LINK_OFF: &[u8] = b"\x1b]8;;\x1b\\";
/// Most links of a screen.
const MOST: usize = 1000;

/// Cells in a row, and the address that they lead to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hyperlink {
    /// The cells.
    pub cells: Rect,
    /// An address in ASCII without control characters.
    pub address: String,
}

/// Addresses by number, from 1. An address keeps its number as long as the screen is known.
#[derive(Debug, Default)]
pub(super) struct Hyperlinks {
    addresses: Vec<String>,
}

impl Hyperlinks {
    /// The number of an address. 0 if it cannot be one, or if there are too many.
    pub(super) fn number(&mut self, address: &str) -> u16 {
        if !address.bytes().all(|byte| byte.is_ascii_graphic()) {
            return 0;
        }
        let known = self.addresses.iter().position(|known| known == address);
        let index = known.unwrap_or_else(|| {
            if self.addresses.len() < MOST {
                self.addresses.push(address.to_owned());
            }
            self.addresses.len() - 1
        });
        let is_there = self.addresses.get(index).is_some_and(|there| there == address);
        if is_there { u16::try_from(index + 1).unwrap_or(0) } else { 0 }
    }

    /// Appends what begins the link of a number, and ends the one before.
    pub(super) fn open(&self, number: u16, out: &mut Vec<u8>) {
        let address = usize::from(number).checked_sub(1).and_then(|index| self.addresses.get(index));
        match address {
            Some(address) => out.extend_from_slice(format!("\x1b]8;;{address}\x1b\\").as_bytes()),
            None => out.extend_from_slice(LINK_OFF),
        }
    }

    /// Whether there was any.
    pub(super) fn is_empty(&self) -> bool {
        self.addresses.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_keeps_its_number_and_a_bad_one_has_none() {
        let mut links = Hyperlinks::default();
        assert_eq!(
            [links.number("file:///a"), links.number("file:///b"), links.number("file:///a")],
            [1, 2, 1]
        );
        assert_eq!([links.number("a b"), links.number("\x1b]"), links.number("ä")], [0; 3]);
        let mut out = Vec::new();
        links.open(2, &mut out);
        links.open(0, &mut out);
        assert_eq!(out, b"\x1b]8;;file:///b\x1b\\\x1b]8;;\x1b\\");
    }
}
