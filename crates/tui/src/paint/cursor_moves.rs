//! Moves the cursor using as few bytes as possible.

use super::terminal_color::push_number;

/// Column and row of a cell, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellPosition {
    pub(super) x: u16,
    pub(super) y: u16,
}

/// Appends the shortest escape sequence that moves the cursor to `to`. `from` is `None` if the cursor
/// position is unknown, for example after writing to the last column. The movement never scrolls, wraps or
/// depends on terminal modes.
pub(super) fn push_shortest_move(from: Option<CellPosition>, to: CellPosition, out: &mut Vec<u8>) {
    let Some(from) = from else { return push_absolute_move(to, out) };
    if from == to {
        return;
    }
    let mut best = Vec::new();
    push_absolute_move(to, &mut best);
    let mut consider = |other: Vec<u8>| {
        if other.len() < best.len() {
            best = other;
        }
    };
    if from.y == to.y {
        consider(horizontal_move(from.x, to.x));
        consider(move_sequence_with_return(&[], to.x));
    } else if from.y < to.y {
        let down = usize::from(to.y - from.y);
        // A line feed's effect depends on the tty's modes, so it always follows a carriage return.
        if down <= 8 {
            consider(move_sequence_with_return(&vec![b'\n'; down], to.x));
        }
        if from.x == to.x {
            consider(csi_with_count(to.y - from.y, b'B'));
        }
    } else if from.x == to.x {
        consider(csi_with_count(from.y - to.y, b'A'));
    }
    out.extend_from_slice(&best);
}

/// Appends an absolute cursor movement (CUP).
fn push_absolute_move(to: CellPosition, out: &mut Vec<u8>) {
    out.extend_from_slice(b"\x1b[");
    if to.y > 0 || to.x > 0 {
        push_number(to.y + 1, out);
    }
    if to.x > 0 {
        out.push(b';');
        push_number(to.x + 1, out);
    }
    out.push(b'H');
}

/// Movement within a row (CUF or CUB). CHA is not used because CUP, CUF or CUB is always at least as short.
fn horizontal_move(from: u16, to: u16) -> Vec<u8> {
    if to >= from { csi_with_count(to - from, b'C') } else { csi_with_count(from - to, b'D') }
}

/// Carriage return, line feeds, then movement to the right.
fn move_sequence_with_return(down: &[u8], column: u16) -> Vec<u8> {
    let mut bytes = vec![b'\r'];
    bytes.extend_from_slice(down);
    if column > 0 {
        bytes.extend(csi_with_count(column, b'C'));
    }
    bytes
}

/// A control sequence with a count, which is omitted if it is 1.
pub(super) fn csi_with_count(count: u16, end: u8) -> Vec<u8> {
    let mut bytes = b"\x1b[".to_vec();
    if count != 1 {
        push_number(count, &mut bytes);
    }
    bytes.push(end);
    bytes
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bytes_of_move(from: (u16, u16), to: (u16, u16)) -> String {
        let mut out = Vec::new();
        push_shortest_move(
            Some(CellPosition { x: from.0, y: from.1 }),
            CellPosition { x: to.0, y: to.1 },
            &mut out,
        );
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn cursor_moves_are_short() {
        assert_eq!(bytes_of_move((5, 5), (5, 5)), "");
        assert_eq!(bytes_of_move((5, 5), (6, 5)), "\x1b[C");
        assert_eq!(bytes_of_move((5, 5), (0, 5)), "\r");
        assert_eq!(bytes_of_move((5, 5), (0, 6)), "\r\n");
        assert_eq!(bytes_of_move((5, 15), (2, 16)), "\r\n\x1b[2C");
        assert_eq!(bytes_of_move((5, 5), (2, 6)), "\x1b[7;3H");
        assert_eq!(bytes_of_move((5, 5), (0, 0)), "\x1b[H");
        assert_eq!(bytes_of_move((5, 5), (5, 6)), "\x1b[B");
        assert_eq!(bytes_of_move((5, 5), (90, 30)), "\x1b[31;91H");
    }

    proptest! {
        #[test]
        fn every_move_reaches_its_target(from in (0_u16..120, 0_u16..40), to in (0_u16..120, 0_u16..40), known in any::<bool>()) {
            let side = |length| std::num::NonZero::new(length).expect("not zero");
            let mut parser = vt100::Parser::new(side(40), side(120), 0);
            let (mut start, mut out) = (Vec::new(), Vec::new());
            let from = CellPosition { x: from.0, y: from.1 };
            push_absolute_move(from, &mut start);
            parser.process(&start);
            push_shortest_move(known.then_some(from), CellPosition { x: to.0, y: to.1 }, &mut out);
            parser.process(&out);
            prop_assert_eq!(parser.screen().cursor_position(), (to.1, to.0));
            prop_assert!(out.len() <= "\x1b[40;120H".len());
        }
    }
}
