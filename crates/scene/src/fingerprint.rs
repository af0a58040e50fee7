//! Fingerprints of the values that a stage read: equal fingerprints mean equal inputs.

use super::description::Texture;
use crate::choice::Choice;
use crate::math::{DVec3, Vec3};

/// Something that pictures depend on. An implementation takes it apart by the names of its fields, without `..`: a new field
/// does not compile until it is added, or left out by name.
pub trait Fingerprinted {
    /// Add all that later stages read of it.
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>);
}

/// Things that descriptions refer to by index.
#[derive(Clone, Copy, Debug, Default)]
pub struct Referents<'a> {
    /// The scene's textures.
    pub textures: &'a [Texture],
    /// The contents of the scene's mesh files.
    pub meshes: &'a [Key],
    /// Text of the camera's orbiter file.
    pub orbiter: Option<&'a str>,
}

impl<T: Fingerprinted> Fingerprinted for Option<T> {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        key.flag(self.is_some());
        if let Some(some) = self {
            some.add_to(key, of);
        }
    }
}

/// A fingerprint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key([u8; 32]);

impl std::fmt::Display for Key {
    /// Small hexadecimal digits.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Takes inputs one after another; numbers count by their bits.
#[derive(Debug)]
pub struct Fingerprint(blake3::Hasher);

impl Fingerprint {
    /// An empty one; `domain` keeps different stages apart.
    pub fn new(domain: &str) -> Self {
        let mut new = Self(blake3::Hasher::new());
        new.text(domain);
        new
    }

    /// Bytes, and how many.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.u64(bytes.len() as u64);
        self.0.update(bytes);
        self
    }

    /// A text.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes())
    }

    /// A path, by its bytes.
    pub fn path(&mut self, path: &std::path::Path) -> &mut Self {
        self.bytes(path.as_os_str().as_encoded_bytes())
    }

    /// Another fingerprint.
    pub fn key(&mut self, key: &Key) -> &mut Self {
        self.0.update(&key.0);
        self
    }

    /// Something with all that it refers to.
    pub fn add(&mut self, part: &impl Fingerprinted, of: &Referents<'_>) -> &mut Self {
        part.add_to(self, of);
        self
    }

    /// A choice, by its name.
    pub fn choice(&mut self, choice: impl Choice) -> &mut Self {
        self.text(choice.name())
    }

    /// Yes or no.
    pub fn flag(&mut self, flag: bool) -> &mut Self {
        self.u64(flag.into())
    }

    /// A whole number.
    pub fn u64(&mut self, value: u64) -> &mut Self {
        self.0.update(&value.to_le_bytes());
        self
    }

    /// An index, a count or the number of an enum's variant.
    pub fn index(&mut self, value: usize) -> &mut Self {
        self.u64(value as u64)
    }

    /// A number, by its bits.
    pub fn f32(&mut self, value: f32) -> &mut Self {
        self.u64(u64::from(value.to_bits()))
    }

    /// A number, by its bits.
    pub fn f64(&mut self, value: f64) -> &mut Self {
        self.u64(value.to_bits())
    }

    /// Three numbers.
    pub fn vec3(&mut self, value: Vec3) -> &mut Self {
        self.f32(value.x).f32(value.y).f32(value.z)
    }

    /// Three numbers.
    pub fn dvec3(&mut self, value: DVec3) -> &mut Self {
        self.f64(value.x).f64(value.y).f64(value.z)
    }

    /// The fingerprint of all so far.
    pub fn finish(&self) -> Key {
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
