//! Reads the numbers after a PLY header, as text or as binary data in either byte order.

use super::super::text::{TextCursor, expected_message};
use super::header::ScalarType;

/// Reads numbers in file order. Errors do not include the position in the file.
pub(super) trait NumberReader: Clone {
    fn read_float(&mut self, scalar: ScalarType) -> Result<f64, String>;
    fn read_integer(&mut self, scalar: ScalarType) -> Result<i64, String>;
    fn skip_scalars(&mut self, scalar: ScalarType, count: usize) -> Result<(), String>;

    /// Ends an item, such as a vertex or a face.
    fn end_item(&mut self) {}

    /// Byte offset in the file.
    fn offset(&self) -> usize;

    /// Byte offset of the next number.
    fn next_number_offset(&self) -> usize {
        self.offset()
    }

    /// Whether the rest of the file is long enough for `count` numbers.
    fn has_bytes_for(&self, scalar: ScalarType, count: u64) -> bool;
}

/// Error message for a truncated body.
pub(super) const END_OF_FILE: &str = "unexpected end of file";

/// Numbers separated by whitespace.
#[derive(Clone)]
pub(super) struct AsciiReader<'a>(pub(super) TextCursor<'a>, pub(super) LineEndMode);

/// How line ends in text files are interpreted.
#[derive(Clone, Copy)]
pub(super) enum LineEndMode {
    /// As whitespace.
    Blank,
    /// Each line end ends an item, and extra values on a line are skipped. Contains the number of lines with
    /// extra values, and the byte offset of the first such line.
    EndItems(u64, Option<usize>),
}

impl AsciiReader<'_> {
    fn seek_word_across_lines(&mut self) -> Result<(), String> {
        if self.0.skip_to_word_across_lines() { Ok(()) } else { Err(END_OF_FILE.to_owned()) }
    }
}

impl NumberReader for AsciiReader<'_> {
    fn read_float(&mut self, _: ScalarType) -> Result<f64, String> {
        self.seek_word_across_lines()?;
        self.0.take_float().ok_or_else(|| expected_message("a number", self.0.take_word()))
    }

    fn read_integer(&mut self, _: ScalarType) -> Result<i64, String> {
        self.seek_word_across_lines()?;
        self.0.take_integer().ok_or_else(|| expected_message("an integer", self.0.take_word()))
    }

    fn skip_scalars(&mut self, _: ScalarType, count: usize) -> Result<(), String> {
        for _ in 0..count {
            self.seek_word_across_lines()?;
            self.0.take_word();
        }
        Ok(())
    }

    fn end_item(&mut self) {
        match &mut self.1 {
            LineEndMode::EndItems(count, first) if self.0.skip_to_word_in_line() => {
                *count += 1;
                first.get_or_insert(self.0.offset());
                self.0.move_to_next_line();
            }
            LineEndMode::EndItems(..) | LineEndMode::Blank => {}
        }
    }

    fn offset(&self) -> usize {
        self.0.offset()
    }

    fn next_number_offset(&self) -> usize {
        let mut ahead = self.0;
        ahead.skip_to_word_across_lines();
        ahead.offset()
    }

    fn has_bytes_for(&self, _: ScalarType, count: u64) -> bool {
        count.saturating_mul(2) <= self.0.remaining_byte_count() as u64 + 1
    }
}

/// Binary numbers, big-endian or little-endian.
#[derive(Clone)]
pub(super) struct BinaryReader<'a, const BIG_ENDIAN: bool> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<const BIG_ENDIAN: bool> BinaryReader<'_, BIG_ENDIAN> {
    #[inline]
    fn take_as_little_endian<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let found = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>());
        let mut found = *found.ok_or_else(|| END_OF_FILE.to_owned())?;
        self.at += N;
        if BIG_ENDIAN {
            found.reverse();
        }
        Ok(found)
    }
}

impl<const BIG_ENDIAN: bool> NumberReader for BinaryReader<'_, BIG_ENDIAN> {
    #[inline]
    fn read_float(&mut self, scalar: ScalarType) -> Result<f64, String> {
        match scalar {
            ScalarType::F32 => Ok(f64::from(f32::from_le_bytes(self.take_as_little_endian()?))),
            ScalarType::F64 => Ok(f64::from_le_bytes(self.take_as_little_endian()?)),
            ScalarType::I8
            | ScalarType::U8
            | ScalarType::I16
            | ScalarType::U16
            | ScalarType::I32
            | ScalarType::U32 => Ok(self.read_integer(scalar)? as f64),
        }
    }

    #[inline]
    fn read_integer(&mut self, scalar: ScalarType) -> Result<i64, String> {
        Ok(match scalar {
            ScalarType::I8 => i64::from(i8::from_le_bytes(self.take_as_little_endian()?)),
            ScalarType::U8 => i64::from(u8::from_le_bytes(self.take_as_little_endian()?)),
            ScalarType::I16 => i64::from(i16::from_le_bytes(self.take_as_little_endian()?)),
            ScalarType::U16 => i64::from(u16::from_le_bytes(self.take_as_little_endian()?)),
            ScalarType::I32 => i64::from(i32::from_le_bytes(self.take_as_little_endian()?)),
            ScalarType::U32 => i64::from(u32::from_le_bytes(self.take_as_little_endian()?)),
            ScalarType::F32 | ScalarType::F64 => self.read_float(scalar)? as i64,
        })
    }

    fn skip_scalars(&mut self, scalar: ScalarType, count: usize) -> Result<(), String> {
        if !self.has_bytes_for(scalar, count as u64) {
            return Err(END_OF_FILE.to_owned());
        }
        self.at += count * scalar.size();
        Ok(())
    }

    fn offset(&self) -> usize {
        self.at
    }

    fn has_bytes_for(&self, scalar: ScalarType, count: u64) -> bool {
        count.saturating_mul(scalar.size() as u64) <= (self.bytes.len() - self.at) as u64
    }
}
