//! What a stage read, as a number: equal fingerprints mean equal inputs.

use super::watch::content::Content;
use crate::math::{DVec3, Vec3};

/// A fingerprint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Key([u8; 32]);

/// Takes inputs one after another; numbers count by their bits.
pub(super) struct Fingerprint(blake3::Hasher);

impl Fingerprint {
    /// An empty one; `domain` keeps different stages apart.
    pub(super) fn new(domain: &str) -> Self {
        let mut new = Self(blake3::Hasher::new());
        new.text(domain);
        new
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.u64(bytes.len() as u64);
        self.0.update(bytes);
        self
    }

    pub(super) fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes())
    }

    pub(super) fn path(&mut self, path: &std::path::Path) -> &mut Self {
        self.bytes(path.as_os_str().as_encoded_bytes())
    }

    pub(super) fn key(&mut self, key: &Key) -> &mut Self {
        self.0.update(&key.0);
        self
    }

    pub(super) fn content(&mut self, content: Content) -> &mut Self {
        match content {
            Content::Missing => self.u64(0),
            Content::Unusable => self.u64(1),
            Content::Hash(hash) => self.u64(2).bytes(&hash),
        }
    }

    pub(super) fn u64(&mut self, value: u64) -> &mut Self {
        self.0.update(&value.to_le_bytes());
        self
    }

    /// An index, a count or the number of an enum's variant.
    pub(super) fn index(&mut self, value: usize) -> &mut Self {
        self.u64(value as u64)
    }

    pub(super) fn f32(&mut self, value: f32) -> &mut Self {
        self.u64(u64::from(value.to_bits()))
    }

    pub(super) fn f64(&mut self, value: f64) -> &mut Self {
        self.u64(value.to_bits())
    }

    pub(super) fn vec3(&mut self, value: Vec3) -> &mut Self {
        self.f32(value.x).f32(value.y).f32(value.z)
    }

    pub(super) fn dvec3(&mut self, value: DVec3) -> &mut Self {
        self.f64(value.x).f64(value.y).f64(value.z)
    }

    pub(super) fn finish(&self) -> Key {
        Key(*self.0.finalize().as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_keep_neighbours_apart() {
        let one = Fingerprint::new("x").text("ab").text("c").finish();
        let other = Fingerprint::new("x").text("a").text("bc").finish();
        assert_ne!(one, other);
        assert_ne!(Fingerprint::new("x").finish(), Fingerprint::new("y").finish());
    }

    #[test]
    fn numbers_count_by_their_bits() {
        let of = |value: f32| Fingerprint::new("x").f32(value).finish();
        assert_ne!(of(0.0), of(-0.0));
        assert_eq!(of(f32::NAN), of(f32::NAN));
        assert_ne!(of(1.0), of(f32::from_bits(1.0_f32.to_bits() + 1)));
    }
}
