//! Redraws the `merge --watch` image in place.

/// A block of lines at the bottom of the terminal that is replaced on every update.
#[derive(Debug, Default)]
pub(super) struct InPlaceTerminalBlock {
    rows: usize,
    /// Terminal width in columns when the lines were printed.
    columns: usize,
}

impl InPlaceTerminalBlock {
    /// Returns the terminal output that replaces the block with `lines`. If the terminal's width has changed,
    /// keeps the old lines, because the terminal may have rewrapped them.
    pub(super) fn redraw_to_string(&mut self, lines: &str, columns: usize) -> String {
        let up = if self.rows > 0 && self.columns == columns {
            format!("\x1b[{}A\r\x1b[J", self.rows)
        } else {
            String::new()
        };
        (self.rows, self.columns) = (lines.lines().count(), columns);
        up + lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_redrawn_in_place() {
        let mut block = InPlaceTerminalBlock::default();
        assert_eq!(block.redraw_to_string("1 of 3 parts\na\nb\n", 80), "1 of 3 parts\na\nb\n");
        assert_eq!(block.redraw_to_string("2 of 3 parts\n", 80), "\x1b[3A\r\x1b[J2 of 3 parts\n");
        assert_eq!(block.redraw_to_string("3 of 3 parts\na\n", 60), "3 of 3 parts\na\n", "another width");
        assert_eq!(block.redraw_to_string("", 60), "\x1b[2A\r\x1b[J");
        assert_eq!(block.redraw_to_string("x\n", 60), "x\n", "nothing to replace");
    }
}
