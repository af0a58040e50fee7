//! Original files for mutation: existing scenes and assets, and a small file in every format.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ExtendedColorType, ImageFormat, save_buffer};

/// Size limit for assets in bytes. Larger assets are slow and find nothing new.
const MAX_BYTES: u64 = 150_000;

/// A scene file, or a file that a scene refers to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Seed {
    /// Name in the case's folder.
    pub(super) file: String,
    pub(super) bytes: Vec<u8>,
}

pub(super) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Files that have one of the extensions, sorted by name.
fn files(folder: &str, endings: &[&str]) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).expect("a folder");
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    files.retain(|file| {
        let ending = file.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        endings.contains(&ending) && fs::metadata(file).is_ok_and(|found| found.len() <= MAX_BYTES)
    });
    files.sort();
    files
}

/// All scenes, valid and invalid.
pub(super) fn scenes() -> Vec<Seed> {
    let files = [files("scenes", &["toml"]), files("tests/broken", &["toml"])].concat();
    // The generated model takes seconds to read, so use a model from the repository instead.
    let bytes = |file: &PathBuf| match String::from_utf8(fs::read(file).expect("a scene")) {
        Ok(text) => text.replace("million.ply", "coral.ply").into_bytes(),
        Err(other) => other.into_bytes(),
    };
    let seed = |bytes| Seed { file: "case.toml".to_owned(), bytes };
    let starter = glimt::scene::starter_scene().as_bytes().to_vec();
    let groups = crate::instances::nested_scene("../assets/knot.obj", "small.png").into_bytes();
    files.iter().map(bytes).chain([starter, groups.clone(), groups]).map(seed).collect()
}

/// Meshes, images, materials and cameras.
pub(super) fn assets() -> Vec<Seed> {
    let made = [meshes(), images(), exrs()].concat();
    let endings = ["obj", "off", "ply", "mtl", "txt", "png", "ppm"];
    let found = [files("assets", &endings), files("assets/textures", &endings)].concat();
    let seed = |path: &PathBuf| {
        let ending = path.extension().expect("an ending").to_string_lossy();
        Seed { file: format!("case.{ending}"), bytes: fs::read(path).expect("an asset") }
    };
    // Pick small files more often.
    [made.clone(), made, found.iter().map(seed).collect()].concat()
}

fn meshes() -> Vec<Seed> {
    let ply = |format: &str, body: &[u8]| {
        let header = format!(
            "ply\nformat {format} 1.0\ncomment small\nelement vertex 3\nproperty float x\nproperty float y\nproperty \
             float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        );
        [header.as_bytes(), body].concat()
    };
    let mut little = Vec::new();
    let mut big = Vec::new();
    for [x, y, z] in [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        [x, y, z].iter().for_each(|number| little.extend(number.to_le_bytes()));
        [x, y, z].iter().for_each(|number| big.extend(number.to_be_bytes()));
        little.push(9);
        big.push(9);
    }
    little.push(3);
    big.push(3);
    (0..3_i32).for_each(|corner| little.extend(corner.to_le_bytes()));
    (0..3_i32).for_each(|corner| big.extend(corner.to_be_bytes()));
    let obj = "# small\nmtllib case.mtl\no one\nv 0 0 0\nv 1 0 0 # b\nv 0 1 0 1 0 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
               vn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 3/3/1\ng two\nf -1 -2 \\\n -3\nl 1 2\nf 1 2 3 4 # five\n";
    let mtl = "newmtl red # one\nKa 0 0 0\nKd 1 0 0\nKs 0.5 0.5 0.5\nKe 0 0 0\nNs 10\nNi 1.5\nd 1\nillum 2\n\
               map_Kd -s 1 1 1 small.png\nnewmtl two\nKd 0 1 0\nnorm small.png\n";
    let off = "COFF\n# small\n4 2 5\n0 0 0 255 0 0 255\n1 0 0 0 0 0 0\n1 1 0 0 0 0 0\n0 1 0 0 0 0 0\n3 0 1 2 0.5\n4 0 1 2 3\n";
    let wild = "STCN4OFF 3 1 0\n0 0 0 1 0 0 1 1 1 1 1 0 0\n1 0 0 1 0 0 1 1 1 1 1 0 1\n0 1 0 1 0 0 1 1 1 1 1 1 0\n3 0 1 2\n";
    let stl = "solid small\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\nendsolid\n";
    // A model with materials and a truncated texture image.
    let model = crate::gltf::cubes(b"\x89PNG\r\n\x1a\n");
    let mut binary_stl = vec![b' '; 80];
    binary_stl.extend(1_u32.to_le_bytes());
    for number in [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        binary_stl.extend(number.to_le_bytes());
    }
    binary_stl.extend([0; 2]);
    let text = |file: &str, text: &str| Seed { file: file.to_owned(), bytes: text.as_bytes().to_vec() };
    let ply = |format: &str, body: &[u8]| Seed { file: "case.ply".to_owned(), bytes: ply(format, body) };
    vec![
        text("case.obj", obj),
        text("case.mtl", mtl),
        text("case.off", off),
        text("case.off", wild),
        ply("ascii", b"0 0 0 1\n1 0 0 2\n0 1 0 3\n3 0 1 2\n"),
        ply("binary_little_endian", &little),
        ply("binary_big_endian", &big),
        text("case.stl", stl),
        Seed { file: "case.stl".to_owned(), bytes: binary_stl },
        Seed { file: "case.glb".to_owned(), bytes: model },
        text("case.gltf", &crate::gltf::sparse()),
        text("case.txt", "c 0 1 0\np 0 0\nr 18 16\ns 2.5 3.5\nf 45 1024 640\n"),
    ]
}

/// Pseudo-random sample values.
fn samples(count: usize) -> Vec<u8> {
    (0..count).map(|index| (index * 37 % 251) as u8).collect()
}

/// A small image in each format.
fn images() -> Vec<Seed> {
    const SIDE: u32 = 24;
    let folder = tempfile::tempdir().expect("a folder");
    let pixels = (SIDE * SIDE) as usize;
    let saved = |ending: &str, kind: ExtendedColorType| {
        let path = folder.path().join(format!("a.{ending}"));
        let bytes = pixels * usize::from(kind.bits_per_pixel()) / 8;
        save_buffer(&path, &samples(bytes), SIDE, SIDE, kind).expect("written");
        Seed { file: format!("case.{ending}"), bytes: fs::read(&path).expect("read") }
    };
    let hdr = {
        let floats: Vec<f32> = samples(3 * pixels).iter().map(|&byte| f32::from(byte) / 9.0).collect();
        let image = image::Rgb32FImage::from_vec(SIDE, SIDE, floats).expect("enough");
        let mut file = Cursor::new(Vec::new());
        DynamicImage::ImageRgb32F(image).write_to(&mut file, ImageFormat::Hdr).expect("written");
        Seed { file: "case.hdr".to_owned(), bytes: file.into_inner() }
    };
    let text = |file: &str, text: &str| Seed { file: file.to_owned(), bytes: text.as_bytes().to_vec() };
    vec![
        saved("png", ExtendedColorType::Rgb8),
        saved("png", ExtendedColorType::La16),
        saved("png", ExtendedColorType::L8),
        saved("jpg", ExtendedColorType::Rgb8),
        saved("jpg", ExtendedColorType::L8),
        saved("ppm", ExtendedColorType::Rgb8),
        saved("tga", ExtendedColorType::Rgba8),
        saved("tga", ExtendedColorType::L8),
        saved("bmp", ExtendedColorType::Rgb8),
        saved("bmp", ExtendedColorType::L8),
        saved("webp", ExtendedColorType::Rgba8),
        hdr,
        text("case.ppm", "P3\n# small\n2 2\n255\n1 2 3 4 5 6 7 8 9 10 11 12\n"),
        text("case.ppm", "P1\n4 2\n1 0 1 0\n0 1 0 1\n"),
        text("case.ppm", "P7\nWIDTH 2\nHEIGHT 1\nDEPTH 3\nMAXVAL 255\nTUPLTYPE RGB\nENDHDR\n123456"),
    ]
}

fn exrs() -> Vec<Seed> {
    use exr::prelude::*;
    let size = Vec2(20, 20);
    let channel = |name: &str| {
        let floats = samples(size.area()).iter().map(|&byte| f32::from(byte)).collect();
        AnyChannel::new(name, FlatSamples::F32(floats))
    };
    let file = |encoding: Encoding, names: &[&str]| {
        let channels = AnyChannels::sort(names.iter().map(|name| channel(name)).collect());
        let layer = Layer::new(size, LayerAttributes::named("main"), encoding, channels);
        let mut file = Cursor::new(Vec::new());
        Image::from_layer(layer).write().to_buffered(&mut file).expect("written");
        Seed { file: "case.exr".to_owned(), bytes: file.into_inner() }
    };
    let tiles = Encoding { blocks: Blocks::Tiles(Vec2(8, 8)), ..Encoding::SMALL_LOSSLESS };
    vec![
        file(Encoding::UNCOMPRESSED, &["R", "G", "B", "A"]),
        file(Encoding::FAST_LOSSLESS, &["Y"]),
        file(Encoding::SMALL_FAST_LOSSLESS, &["a.R", "a.G", "a.B", "Z"]),
        file(tiles, &["R", "G", "B"]),
    ]
}
