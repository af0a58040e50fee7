//! iTerm2's inline images (iterm2.com/documentation-images.html): PNG in base64.

use ratatui::layout::Rect;

use super::base64::encode_base64;
use super::png::encode_png;
use crate::film::Srgb8Image;

/// The command that draws an image at the cursor, scaled to cover these cells.
pub(super) fn encode(picture: &Srgb8Image, cells: Rect) -> Vec<u8> {
    let png = encode_png(picture);
    let keys = format!(
        "\x1b]1337;File=inline=1;size={};width={};height={};preserveAspectRatio=0;doNotMoveCursor=1:",
        png.len(),
        cells.width,
        cells.height
    );
    [keys.as_bytes(), &encode_base64(&png), b"\x07"].concat()
}
