//! Endings of the files that keys name, without dots and in small letters.

/// Images that can be written.
pub const IMAGES: &[&str] = &["png", "exr", "ppm", "hdr", "jpg", "jpeg", "webp"];

/// Images that can be read, and then the files that hold numbered images.
const READ: [&str; 14] =
    ["png", "jpg", "jpeg", "ppm", "pgm", "pbm", "pnm", "tga", "bmp", "hdr", "exr", "webp", "glb", "gltf"];

/// Images that can be read, and files that hold numbered ones.
pub const TEXTURES: &[&str] = &READ;

/// Images that can be read, [`GLTF`] and [`MAPS`] are the two parts of [`TEXTURES`].
pub const MAPS: &[&str] = READ.split_at(12).0;

/// Files that hold numbered images and parts.
pub const GLTF: &[&str] = READ.split_at(12).1;

/// Meshes.
pub const MESHES: &[&str] = &["obj", "off", "ply", "stl", "glb", "gltf"];
