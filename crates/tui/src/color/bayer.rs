//! Ordered dithering.

/// Width and height of the repeating dither pattern, in pixels.
const SIDE: usize = 8;

/// Dither threshold in (0, 1) for a pixel, taken from Bayer's matrix ("An optimum method for two-level
/// rendition of continuous-tone pictures", 1973). It depends only on the position, so static content does not
/// flicker.
pub(super) fn bayer_threshold(x: usize, y: usize) -> f32 {
    let (x, y) = (x % SIDE, y % SIDE);
    let mixed = x ^ y;
    let rank = (0..3).fold(0, |rank, bit| {
        let pair = (mixed >> bit & 1) << 1 | (y >> bit & 1);
        rank | pair << (2 * (2 - bit))
    });
    (rank as f32 + 0.5) / (SIDE * SIDE) as f32
}

/// Dithers a color to six bits per channel.
pub(crate) fn dither_to_6_bits_per_channel(rgb: [u8; 3], x: usize, y: usize) -> [u8; 3] {
    const LEVELS: u16 = 63;
    let more = (bayer_threshold(x, y) * 255.0) as u16;
    rgb.map(|channel| {
        let level = (u16::from(channel) * LEVELS + more) / 255;
        ((level * 255 + LEVELS / 2) / LEVELS) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bayer_ranks_are_a_permutation() {
        let mut ranks: Vec<u32> = (0..64).map(|i| (bayer_threshold(i % 8, i / 8) * 64.0) as u32).collect();
        for corner in [(0, 0), (4, 0), (0, 4), (4, 4)] {
            let below =
                (0..16).filter(|i| bayer_threshold(corner.0 + i % 4, corner.1 + i / 4) < 0.25).count();
            assert_eq!(below, 4);
        }
        ranks.sort_unstable();
        assert!(ranks.into_iter().eq(0..64));
        assert_eq!(bayer_threshold(3, 5), bayer_threshold(11, 21));
    }

    #[test]
    fn dithered_mean_matches_input_color() {
        assert_eq!(
            (dither_to_6_bits_per_channel([0; 3], 3, 4), dither_to_6_bits_per_channel([255; 3], 3, 4)),
            ([0; 3], [255; 3])
        );
        let sum: u32 =
            (0..64).map(|i| u32::from(dither_to_6_bits_per_channel([101; 3], i % 8, i / 8)[0])).sum();
        assert!(sum.abs_diff(101 * 64) <= 64, "{sum}");
    }
}
