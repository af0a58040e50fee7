//! Reads the numbers after a PLY header, as text or as binary data in either byte order.

use super::super::text::{Cursor, expected};
use super::header::Scalar;

/// Reads numbers in file order. Errors do not include the position in the file.
pub(super) trait NumberReader: Clone {
    fn float(&mut self, scalar: Scalar) -> Result<f64, String>;
    fn integer(&mut self, scalar: Scalar) -> Result<i64, String>;
    fn skip(&mut self, scalar: Scalar, count: usize) -> Result<(), String>;

    /// Ends an item, such as a vertex or a face.
    fn end_item(&mut self) {}

    /// Byte offset in the file.
    fn at(&self) -> usize;

    /// Byte offset of the next number.
    fn start(&self) -> usize {
        self.at()
    }

    /// Whether the rest of the file is long enough for `count` numbers.
    fn can_hold(&self, scalar: Scalar, count: u64) -> bool;
}

/// Error message for a truncated body.
pub(super) const END_OF_FILE: &str = "unexpected end of file";

/// Numbers separated by whitespace.
#[derive(Clone)]
pub(super) struct Ascii<'a>(pub(super) Cursor<'a>, pub(super) LineEndMode);

/// How line ends in text files are interpreted.
#[derive(Clone, Copy)]
pub(super) enum LineEndMode {
    /// As whitespace.
    Blank,
    /// Each line end ends an item, and extra values on a line are skipped. Contains the number of lines with
    /// extra values, and the byte offset of the first such line.
    EndItems(u64, Option<usize>),
}

impl Ascii<'_> {
    fn seek_word(&mut self) -> Result<(), String> {
        if self.0.skip_to_word() { Ok(()) } else { Err(END_OF_FILE.to_owned()) }
    }
}

impl NumberReader for Ascii<'_> {
    fn float(&mut self, _: Scalar) -> Result<f64, String> {
        self.seek_word()?;
        self.0.float().ok_or_else(|| expected("a number", self.0.word()))
    }

    fn integer(&mut self, _: Scalar) -> Result<i64, String> {
        self.seek_word()?;
        self.0.integer().ok_or_else(|| expected("an integer", self.0.word()))
    }

    fn skip(&mut self, _: Scalar, count: usize) -> Result<(), String> {
        for _ in 0..count {
            self.seek_word()?;
            self.0.word();
        }
        Ok(())
    }

    fn end_item(&mut self) {
        match &mut self.1 {
            LineEndMode::EndItems(count, first) if self.0.skip_to_word_in_line() => {
                *count += 1;
                first.get_or_insert(self.0.at());
                self.0.end_line();
            }
            LineEndMode::EndItems(..) | LineEndMode::Blank => {}
        }
    }

    fn at(&self) -> usize {
        self.0.at()
    }

    fn start(&self) -> usize {
        let mut ahead = self.0;
        ahead.skip_to_word();
        ahead.at()
    }

    fn can_hold(&self, _: Scalar, count: u64) -> bool {
        count.saturating_mul(2) <= self.0.remaining() as u64 + 1
    }
}

/// Binary numbers, big-endian or little-endian.
#[derive(Clone)]
pub(super) struct Binary<'a, const BIG_ENDIAN: bool> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<const BIG_ENDIAN: bool> Binary<'_, BIG_ENDIAN> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let found = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>());
        let mut found = *found.ok_or_else(|| END_OF_FILE.to_owned())?;
        self.at += N;
        if BIG_ENDIAN {
            found.reverse();
        }
        Ok(found)
    }
}

impl<const BIG_ENDIAN: bool> NumberReader for Binary<'_, BIG_ENDIAN> {
    #[inline]
    fn float(&mut self, scalar: Scalar) -> Result<f64, String> {
        match scalar {
            Scalar::F32 => Ok(f64::from(f32::from_le_bytes(self.take()?))),
            Scalar::F64 => Ok(f64::from_le_bytes(self.take()?)),
            Scalar::I8 | Scalar::U8 | Scalar::I16 | Scalar::U16 | Scalar::I32 | Scalar::U32 => {
                Ok(self.integer(scalar)? as f64)
            }
        }
    }

    #[inline]
    fn integer(&mut self, scalar: Scalar) -> Result<i64, String> {
        Ok(match scalar {
            Scalar::I8 => i64::from(i8::from_le_bytes(self.take()?)),
            Scalar::U8 => i64::from(u8::from_le_bytes(self.take()?)),
            Scalar::I16 => i64::from(i16::from_le_bytes(self.take()?)),
            Scalar::U16 => i64::from(u16::from_le_bytes(self.take()?)),
            Scalar::I32 => i64::from(i32::from_le_bytes(self.take()?)),
            Scalar::U32 => i64::from(u32::from_le_bytes(self.take()?)),
            Scalar::F32 | Scalar::F64 => self.float(scalar)? as i64,
        })
    }

    fn skip(&mut self, scalar: Scalar, count: usize) -> Result<(), String> {
        if !self.can_hold(scalar, count as u64) {
            return Err(END_OF_FILE.to_owned());
        }
        self.at += count * scalar.size();
        Ok(())
    }

    fn at(&self) -> usize {
        self.at
    }

    fn can_hold(&self, scalar: Scalar, count: u64) -> bool {
        count.saturating_mul(scalar.size() as u64) <= (self.bytes.len() - self.at) as u64
    }
}
