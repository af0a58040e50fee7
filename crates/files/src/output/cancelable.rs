//! Tone maps and encodes images in small parts, polling the cancel token between parts.

use std::fs::File;
use std::io::{self, Cursor, ErrorKind, Seek, SeekFrom, Write};
use std::os::fd::AsFd;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use super::{BitDepth, EncodeOptions, Format, OutputError};
use crate::control::{CancelToken, Canceled};
use crate::film::RadianceImage;
use crate::film::tone::{tone_map_to_8_bits, tone_map_to_16_bits};

/// Number of pixels between polls of the cancel token. Processing them takes a few milliseconds and keeps
/// all threads busy.
const PIXELS_PER_POLL: usize = 1 << 18;

/// Number of bytes to compress or write between polls of the cancel token.
pub(super) const BYTES_PER_POLL: usize = 1 << 15;

/// Tone maps an image from top to bottom and passes the bytes to `take` in order, at most [`BYTES_PER_POLL`]
/// at a time. Each component is one byte, or two bytes in big-endian order as in PNG and PPM.
pub(super) fn for_each_tone_mapped_part(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
    mut take: impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<()> {
    for pixels in image.pixels.chunks(PIXELS_PER_POLL) {
        token.check_pause_and_cancel().map_err(io::Error::other)?;
        let part = RadianceImage { width: pixels.len() as u32, height: 1, pixels: pixels.to_vec() };
        let bytes = match options.bit_depth {
            BitDepth::Eight => tone_map_to_8_bits(&part, &options.tone).pixels.into_flattened(),
            BitDepth::Sixteen => {
                let components = tone_map_to_16_bits(&part, &options.tone).pixels.into_flattened();
                components.iter().flat_map(|component| component.to_be_bytes()).collect()
            }
        };
        for bytes in bytes.chunks(BYTES_PER_POLL) {
            token.check_pause_and_cancel().map_err(io::Error::other)?;
            take(bytes)?;
        }
    }
    Ok(())
}

/// Tone maps an image to three bytes per pixel.
pub(super) fn tone_map_all(
    image: &RadianceImage,
    options: &EncodeOptions,
    format: Format,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let mut picture = Vec::with_capacity(3 * image.pixels.len());
    let take = |part: &[u8]| {
        picture.extend_from_slice(part);
        Ok(())
    };
    for_each_tone_mapped_part(image, options, token, take)
        .map_err(|error| OutputError::encoder(format, &error))?;
    Ok(picture)
}

/// An in-memory writer that fails after cancellation. This also stops encoders that do not poll the cancel
/// token.
pub(super) struct CancelableBuffer<'a> {
    bytes: Cursor<Vec<u8>>,
    token: &'a CancelToken,
}

impl<'a> CancelableBuffer<'a> {
    pub(super) fn new(token: &'a CancelToken) -> Self {
        Self { bytes: Cursor::new(Vec::new()), token }
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes.into_inner()
    }
}

impl Write for CancelableBuffer<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.token.check_pause_and_cancel().map_err(io::Error::other)?;
        self.bytes.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for CancelableBuffer<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.bytes.seek(to)
    }
}

/// Writes all bytes, polling the cancel token between parts.
pub(super) fn write_all(mut to: impl Write, bytes: &[u8], token: &CancelToken) -> io::Result<()> {
    for part in bytes.chunks(1 << 20) {
        token.check_pause_and_cancel().map_err(io::Error::other)?;
        to.write_all(part)?;
    }
    Ok(())
}

/// Like [`write_all`], but for pipes and sockets, whose readers may block indefinitely.
pub(super) fn write_to_pipe(mut to: &File, bytes: &[u8], token: &CancelToken) -> io::Result<()> {
    /// Number of bytes per write. A pipe that is ready for writing has at least this much space, so the write
    /// does not block.
    const PIPE_BYTES: usize = 4096;
    let mut rest = bytes;
    while !rest.is_empty() {
        wait_until_writable(to, token)?;
        match to.write(&rest[..rest.len().min(PIPE_BYTES)]) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(taken) => rest = &rest[taken..],
            // Another process wrote to the pipe first.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn wait_until_writable(to: &File, token: &CancelToken) -> io::Result<()> {
    /// Milliseconds between polls of the cancel token.
    const POLL_MS: u8 = 50;
    loop {
        token.check_pause_and_cancel().map_err(io::Error::other)?;
        let mut ends = [PollFd::new(to.as_fd(), PollFlags::POLLOUT)];
        match poll(&mut ends, PollTimeout::from(POLL_MS)) {
            Ok(0) | Err(Errno::EINTR) => {}
            Ok(_) => return Ok(()),
            Err(error) => return Err(error.into()),
        }
    }
}

/// Distinguishes canceled writes from I/O errors. Checks the error instead of the token, because the token
/// may have been canceled after the write.
pub(super) fn map_write_error<T>(
    result: io::Result<T>,
    error: impl FnOnce(io::Error) -> OutputError,
) -> Result<T, OutputError> {
    result.map_err(|failed| {
        let stopped = failed.get_ref().is_some_and(|cause| cause.is::<Canceled>());
        if stopped { OutputError::Canceled(Canceled) } else { error(failed) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_form_the_image_and_can_be_canceled() {
        let count = PIXELS_PER_POLL + 70_000;
        let pixels = (0..count).map(|i| crate::math::Vec3::splat((i % 256) as f32 / 255.0)).collect();
        let image = RadianceImage { width: count as u32, height: 1, pixels };
        let options = EncodeOptions { bit_depth: BitDepth::Sixteen, ..Default::default() };
        let token = CancelToken::new();
        let mut all = Vec::new();
        let take = |bytes: &[u8]| {
            assert!(bytes.len() <= BYTES_PER_POLL);
            all.extend_from_slice(bytes);
            Ok(())
        };
        for_each_tone_mapped_part(&image, &options, &token, take).expect("not canceled");
        let expected = tone_map_to_16_bits(&image, &options.tone).pixels.into_flattened();
        assert!(all.as_chunks().0.iter().map(|two| u16::from_be_bytes(*two)).eq(expected));
        let mut parts = 0;
        let stop = |_: &[u8]| {
            parts += 1;
            token.cancel();
            Ok(())
        };
        assert!(for_each_tone_mapped_part(&image, &options, &token, stop).is_err());
        assert_eq!(parts, 1);
    }

    #[test]
    fn only_stopped_writes_count_as_canceled() {
        let token = CancelToken::new();
        token.cancel();
        let classify =
            |result| map_write_error(result, |error| OutputError::from_io("a.png".as_ref(), error));
        let stopped = write_all(Vec::new(), b"abc", &token);
        assert!(matches!(classify(stopped), Err(OutputError::Canceled(_))));
        let full = io::Error::from(io::ErrorKind::StorageFull);
        assert!(matches!(classify(Err(full)), Err(OutputError::File { .. })));
        assert!(classify(Ok(())).is_ok());
    }

    #[test]
    fn blocked_readers_do_not_delay_cancellation() {
        let (mut reader, writer) = io::pipe().expect("a pipe");
        let (to, token) = (File::from(std::os::fd::OwnedFd::from(writer)), CancelToken::new());
        nix::fcntl::fcntl(&to, nix::fcntl::FcntlArg::F_SETFL(nix::fcntl::OFlag::O_NONBLOCK)).expect("set");
        let bytes: Vec<u8> = (0..1_000_003_u32).map(|i| (i % 251) as u8).collect();
        std::thread::scope(|scope| {
            let writing = scope.spawn(|| write_to_pipe(&to, &bytes, &token));
            let mut taken = vec![0; 500_000];
            io::Read::read_exact(&mut reader, &mut taken).expect("it writes");
            assert_eq!(taken, bytes[..taken.len()]);
            token.cancel();
            let stopped = writing.join().expect("no panic");
            assert!(stopped.is_err_and(|error| error.get_ref().is_some_and(|cause| cause.is::<Canceled>())));
        });
    }

    #[test]
    fn a_canceled_memory_writer_fails() {
        let token = CancelToken::new();
        let mut bytes = CancelableBuffer::new(&token);
        bytes.write_all(b"abc").expect("not canceled yet");
        token.cancel();
        assert!(bytes.write_all(b"def").is_err());
        assert_eq!(bytes.into_bytes(), b"abc");
    }
}
