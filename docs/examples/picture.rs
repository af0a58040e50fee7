//! Renders a scene with the library: `cargo run --release --example picture`.

use std::error::Error;

use glimt::control::CancelToken;
use glimt::output::{EncodeOptions, Format, encode};
use glimt::pipeline::{headless::HeadlessSession, settings::Overrides};

fn main() -> Result<(), Box<dyn Error>> {
    render_to_png("scenes/cornell.toml", "cornell.png")
}

/// Renders a scene with 4 samples per pixel and writes it as a PNG file.
pub(crate) fn render_to_png(scene: &str, png: &str) -> Result<(), Box<dyn Error>> {
    let token = CancelToken::new();
    let options = Overrides { samples: Some(4), ..Overrides::default() };
    let rendered = HeadlessSession::default().render_in_memory(scene.as_ref(), &options, &token)?;
    let bytes = encode(&rendered.image, &EncodeOptions::default(), Format::Png, &token)?;
    Ok(std::fs::write(png, bytes)?)
}
