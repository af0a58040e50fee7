//! A reader that reports its progress and can be canceled.

use std::io::{self, Read, Seek, SeekFrom};

use super::decode_thread::ProgressReporter;

/// Maximum number of bytes per read. Without this limit, a decoder that reads the whole file in one call
/// would not report progress.
const MAX_READ_BYTES: usize = 1 << 16;

pub(super) struct ProgressReader<R> {
    inner: R,
    at: u64,
    /// Farthest position read so far. Decoders may seek backward.
    reached: u64,
    length: u64,
    report: ProgressReporter,
}

impl<R> ProgressReader<R> {
    pub(super) fn new(inner: R, length: u64, report: ProgressReporter) -> Self {
        Self { inner, at: 0, reached: 0, length, report }
    }
}

impl<R: Read> Read for ProgressReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = buffer.len().min(MAX_READ_BYTES);
        let got = self.inner.read(&mut buffer[..most])?;
        self.at += got as u64;
        self.reached = self.reached.max(self.at.min(self.length));
        self.report.report_bytes_read(self.reached)?;
        Ok(got)
    }
}

impl<R: Seek> Seek for ProgressReader<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.inner.seek(to)?;
        Ok(self.at)
    }
}
