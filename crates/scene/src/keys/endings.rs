//! File extensions accepted by keys, in lowercase and without dots.

/// Image formats that glimt writes.
pub const IMAGES: &[&str] = &["png", "exr", "ppm", "hdr", "jpg", "jpeg", "webp"];

/// Image formats that glimt reads, followed by container formats with numbered images.
const READ: [&str; 15] = [
    "png", "jpg", "jpeg", "ppm", "pgm", "pbm", "pnm", "pfm", "tga", "bmp", "hdr", "exr", "webp", "glb",
    "gltf",
];

/// Extensions of files that may be textures: images and image containers.
pub const TEXTURES: &[&str] = &READ;

/// Extensions of image files: the first part of [`TEXTURES`].
pub const MAPS: &[&str] = READ.split_at(13).0;

/// Extensions of containers with numbered images and parts: the rest of [`TEXTURES`].
pub const GLTF: &[&str] = READ.split_at(13).1;

/// Extensions of mesh formats.
pub const MESHES: &[&str] = &["obj", "off", "ply", "stl", "serialized", "glb", "gltf"];

/// Extensions of mesh formats with numbered parts.
pub const PARTS: &[&str] = MESHES.split_at(4).1;
