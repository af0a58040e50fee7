//! How textures continue beyond [0, 1].

use crate::choice;
use crate::math::lanes::{F32x16, PACKET_SIZE};

choice! {
    /// How a texture continues beyond [0, 1].
    pub enum Wrap {
        /// Periodic.
        Repeat = "repeat",
        /// Border texels are repeated outside the image.
        Clamp = "clamp",
        /// Periodic. Every other tile is mirrored.
        Mirror = "mirror",
    }
}

impl Wrap {
    /// Multiplies coordinates by `repeat` and folds them into [0, 1].
    #[inline(always)]
    pub(super) fn scale_and_fold_packet(self, x: &[f64; PACKET_SIZE], repeat: f64) -> F32x16 {
        let mut folded = [0.0; PACKET_SIZE];
        macro_rules! by {
            ($wrap:expr) => {
                for i in 0..PACKET_SIZE {
                    folded[i] = $wrap.fold(finite_or_zero(x[i] * repeat)) as f32;
                }
            };
        }
        match self {
            Self::Repeat => by!(Self::Repeat),
            Self::Clamp => by!(Self::Clamp),
            Self::Mirror => by!(Self::Mirror),
        }
        folded
    }

    /// Wraps `numbers` + `more` with [`Wrap::wrap_index`].
    #[inline(always)]
    pub(super) fn wrap_index_packet(
        self,
        numbers: &[i32; PACKET_SIZE],
        more: i32,
        size: i32,
    ) -> [i32; PACKET_SIZE] {
        let mut indices = [0; PACKET_SIZE];
        macro_rules! by {
            ($wrap:expr) => {
                for i in 0..PACKET_SIZE {
                    indices[i] = $wrap.wrap_index(numbers[i] + more, size);
                }
            };
        }
        match self {
            Self::Repeat => by!(Self::Repeat),
            Self::Clamp => by!(Self::Clamp),
            Self::Mirror => by!(Self::Mirror),
        }
        indices
    }

    /// Folds a coordinate into [0, 1].
    #[inline(always)]
    pub(super) fn fold(self, x: f64) -> f64 {
        match self {
            Self::Repeat => x - x.floor(),
            Self::Clamp => x.clamp(0.0, 1.0),
            Self::Mirror => {
                let period = x - 2.0 * (x * 0.5).floor();
                if period > 1.0 { 2.0 - period } else { period }
            }
        }
    }

    /// The wrapped index and its wrapped successor.
    #[inline(always)]
    pub(super) fn neighbor_indices(self, first: i32, size: i32) -> [i32; 2] {
        [self.wrap_index(first, size), self.wrap_index(first + 1, size)]
    }

    /// Wraps an index in the range −1 to `size`.
    #[inline(always)]
    pub(super) fn wrap_index(self, i: i32, size: i32) -> i32 {
        match self {
            Self::Repeat => i + if i < 0 { size } else { 0 } - if i >= size { size } else { 0 },
            // Mirroring also repeats the texel at the border.
            Self::Clamp | Self::Mirror => i.max(0).min(size - 1),
        }
    }
}

/// −1 in tiles that [`Wrap::Mirror`] mirrors, 1 in all other tiles.
pub(super) fn mirror_sign(x: f64) -> f64 {
    let x = finite_or_zero(x);
    if x - 2.0 * (x * 0.5).floor() > 1.0 { -1.0 } else { 1.0 }
}

/// Replaces non-finite coordinates with 0.
#[inline(always)]
pub(super) fn finite_or_zero(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}
