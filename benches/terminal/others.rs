//! Other programs that draw the same cells.

use std::cell::Cell;
use std::error::Error;
use std::io::{self, Write};
use std::process::{Command, Stdio};
use std::rc::Rc;

use glimt::film::Srgb8Image;
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

/// A writer that counts bytes.
struct ByteCounter(Rc<Cell<usize>>);

impl Write for ByteCounter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.set(self.0.get() + bytes.len());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Plain ratatui on crossterm.
pub(crate) struct PlainRatatui {
    backend: CrosstermBackend<ByteCounter>,
    sent: Rc<Cell<usize>>,
    shown: Buffer,
}

impl PlainRatatui {
    pub(crate) fn new(area: Rect) -> Self {
        crossterm::style::force_color_output(true);
        let sent = Rc::new(Cell::new(0));
        let backend = CrosstermBackend::new(ByteCounter(Rc::clone(&sent)));
        Self { backend, sent, shown: Buffer::empty(area) }
    }

    /// Bytes required to update the screen to this image.
    pub(crate) fn draw(&mut self, wanted: &Buffer) -> usize {
        let before = self.sent.get();
        let difference = self.shown.diff(wanted);
        // Writing to the counter cannot fail.
        let _ = self.backend.draw(difference.into_iter());
        self.shown = wanted.clone();
        self.sent.get() - before
    }
}

/// Bytes that chafa writes for the image in 24-bit half blocks. `None` if chafa is not installed.
pub(crate) fn chafa(picture: &Srgb8Image) -> Result<Option<usize>, Box<dyn Error>> {
    let file = tempfile::Builder::new().suffix(".png").tempfile()?;
    let pixels = picture.pixels.as_flattened();
    image::save_buffer(file.path(), pixels, picture.width, picture.height, image::ColorType::Rgb8)?;
    let size = format!("{}x{}", picture.width, picture.height.div_ceil(2));
    let output = Command::new("chafa")
        .args(["--format", "symbols", "--symbols", "vhalf", "--colors", "full", "--stretch", "--size", &size])
        .arg(file.path())
        .stderr(Stdio::null())
        .output();
    Ok(output.ok().filter(|output| output.status.success()).map(|output| output.stdout.len()))
}
