//! A file that reports how far it was read, and can be stopped.

use std::io::{self, Read, Seek, SeekFrom};

use super::apart::Reporter;

/// Most bytes read at once, so that a decoder which reads a whole image at once reports and stops as well.
const CHUNK: usize = 1 << 16;

pub(super) struct Counting<R> {
    inner: R,
    at: u64,
    /// Farthest byte read, as decoders may go back.
    reached: u64,
    length: u64,
    report: Reporter,
}

impl<R> Counting<R> {
    pub(super) fn new(inner: R, length: u64, report: Reporter) -> Self {
        Self { inner, at: 0, reached: 0, length, report }
    }
}

impl<R: Read> Read for Counting<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = buffer.len().min(CHUNK);
        let got = self.inner.read(&mut buffer[..most])?;
        self.at += got as u64;
        self.reached = self.reached.max(self.at.min(self.length));
        self.report.reached(self.reached)?;
        Ok(got)
    }
}

impl<R: Seek> Seek for Counting<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.inner.seek(to)?;
        Ok(self.at)
    }
}
