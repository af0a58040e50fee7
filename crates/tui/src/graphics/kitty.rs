//! kitty's graphics protocol (sw.kovidgoyal.net/kitty/graphics-protocol): PNG in base64 chunks.

use ratatui::layout::Rect;

use super::base64::encode_base64;
use super::png::encode_png;
use crate::film::Srgb8Image;

/// IDs of the two alternating images, chosen to be unlikely to clash with other programs.
const IMAGE_IDS: [u32; 2] = [0x67_6c_69, 0x6d_74_01];
/// Maximum length of a chunk of base64 data.
const MAX_CHUNK_LENGTH: usize = 4096;

/// Returns the commands that draw an image at the cursor, scaled to cover these cells, and then delete the
/// previous image.
pub(super) fn encode(picture: &Srgb8Image, cells: Rect, turn: bool) -> Vec<Vec<u8>> {
    let [id, other] = if turn { IMAGE_IDS } else { [IMAGE_IDS[1], IMAGE_IDS[0]] };
    let data = encode_base64(&encode_png(picture));
    let count = data.len().div_ceil(MAX_CHUNK_LENGTH);
    let mut commands = Vec::with_capacity(count);
    for (i, chunk) in data.chunks(MAX_CHUNK_LENGTH).enumerate() {
        let more = u8::from(i + 1 < count);
        // Do not move the cursor or request a reply.
        let keys = if i == 0 {
            format!("a=T,f=100,i={id},p=1,c={},r={},C=1,q=2,m={more}", cells.width, cells.height)
        } else {
            format!("m={more}")
        };
        commands.push([b"\x1b_G", keys.as_bytes(), b";", chunk, b"\x1b\\"].concat());
    }
    if let Some(last) = commands.last_mut() {
        last.extend(delete_command(other));
    }
    commands
}

/// The command that deletes an image and its data.
fn delete_command(id: u32) -> Vec<u8> {
    format!("\x1b_Ga=d,d=I,i={id},q=2\x1b\\").into_bytes()
}

/// The commands that delete both images.
pub(crate) fn delete_all_commands() -> Vec<u8> {
    IMAGE_IDS.map(delete_command).concat()
}
