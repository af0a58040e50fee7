//! Fingerprints of stage inputs. Equal fingerprints mean equal inputs.

use super::description::Texture;
use crate::choice::Choice;
use crate::math::{DVec3, Vec3};

/// Values that affect the image. Implementations destructure all fields without `..`, so a new field causes a
/// compile error until it is added to the fingerprint or explicitly ignored.
pub trait Fingerprinted {
    /// Adds all values that later stages read to the fingerprint.
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>);
}

/// The data that scene items refer to: textures and meshes (by index), and the orbiter file.
#[derive(Clone, Copy, Debug, Default)]
pub struct FingerprintContext<'a> {
    /// The scene's textures.
    pub textures: &'a [Texture],
    /// Content hashes of the scene's mesh files.
    pub meshes: &'a [Fingerprint],
    /// The text of the camera's orbiter file.
    pub orbiter: Option<&'a str>,
}

impl<T: Fingerprinted> Fingerprinted for Option<T> {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        key.add_bool(self.is_some());
        if let Some(some) = self {
            some.add_to_fingerprint(key, of);
        }
    }
}

/// A finished fingerprint: a BLAKE3 hash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fingerprint([u8; 32]);

impl std::fmt::Display for Fingerprint {
    /// Writes the fingerprint as lowercase hexadecimal digits.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Builds a fingerprint by hashing its inputs in order. Numbers are hashed by their bits.
#[derive(Debug)]
pub struct FingerprintHasher(blake3::Hasher);

impl FingerprintHasher {
    /// Starts a fingerprint. The `domain` string makes the fingerprints of different stages differ.
    pub fn new(domain: &str) -> Self {
        let mut new = Self(blake3::Hasher::new());
        new.add_str(domain);
        new
    }

    /// Adds bytes, preceded by their length.
    pub fn add_bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.add_u64(bytes.len() as u64);
        self.0.update(bytes);
        self
    }

    /// Adds a string.
    pub fn add_str(&mut self, text: &str) -> &mut Self {
        self.add_bytes(text.as_bytes())
    }

    /// Adds the bytes of a path.
    pub fn add_path_bytes(&mut self, path: &std::path::Path) -> &mut Self {
        self.add_bytes(path.as_os_str().as_encoded_bytes())
    }

    /// Adds another fingerprint.
    pub fn add_fingerprint(&mut self, key: &Fingerprint) -> &mut Self {
        self.0.update(&key.0);
        self
    }

    /// Adds a value and everything it refers to.
    pub fn add_with_references(
        &mut self,
        part: &impl Fingerprinted,
        of: &FingerprintContext<'_>,
    ) -> &mut Self {
        part.add_to_fingerprint(self, of);
        self
    }

    /// Adds the name of a choice.
    pub fn add_choice_name(&mut self, choice: impl Choice) -> &mut Self {
        self.add_str(choice.name())
    }

    /// Adds a Boolean.
    pub fn add_bool(&mut self, flag: bool) -> &mut Self {
        self.add_u64(flag.into())
    }

    /// Adds an integer.
    pub fn add_u64(&mut self, value: u64) -> &mut Self {
        self.0.update(&value.to_le_bytes());
        self
    }

    /// Adds an index, a count or an enum discriminant.
    pub fn add_usize(&mut self, value: usize) -> &mut Self {
        self.add_u64(value as u64)
    }

    /// Adds the bits of an `f32`.
    pub fn add_f32(&mut self, value: f32) -> &mut Self {
        self.add_u64(u64::from(value.to_bits()))
    }

    /// Adds the bits of an `f64`.
    pub fn add_f64(&mut self, value: f64) -> &mut Self {
        self.add_u64(value.to_bits())
    }

    /// Adds the components of a vector.
    pub fn add_vec3(&mut self, value: Vec3) -> &mut Self {
        self.add_f32(value.x).add_f32(value.y).add_f32(value.z)
    }

    /// Adds the components of a vector.
    pub fn add_dvec3(&mut self, value: DVec3) -> &mut Self {
        self.add_f64(value.x).add_f64(value.y).add_f64(value.z)
    }

    /// Returns the fingerprint of all inputs so far.
    pub fn finish(&self) -> Fingerprint {
        Fingerprint(*self.0.finalize().as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adjacent_strings_do_not_merge() {
        let one = FingerprintHasher::new("x").add_str("ab").add_str("c").finish();
        let other = FingerprintHasher::new("x").add_str("a").add_str("bc").finish();
        assert_ne!(one, other);
        assert_ne!(FingerprintHasher::new("x").finish(), FingerprintHasher::new("y").finish());
    }

    #[test]
    fn numbers_are_hashed_by_bits() {
        let of = |value: f32| FingerprintHasher::new("x").add_f32(value).finish();
        assert_ne!(of(0.0), of(-0.0));
        assert_eq!(of(f32::NAN), of(f32::NAN));
        assert_ne!(of(1.0), of(f32::from_bits(1.0_f32.to_bits() + 1)));
    }
}
