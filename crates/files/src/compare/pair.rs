//! Two pictures that can be compared.

use std::path::{Path, PathBuf};

use crate::assets::AssetError;
use crate::assets::image::{ImageEncoding, ImageLimits, load};
use crate::control::{CancelToken, ignore_progress};
use crate::film::RadianceImage;
use crate::math::Vec3;

/// Reasons for which two files cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A file could not be read, or is not a picture.
    #[error(transparent)]
    File(#[from] AssetError),
    /// Some values are not finite.
    #[error(
        "{}: {nan} of its values are NaN and {infinite} infinite, the first at pixel ({}, {}), counted from (0, 0) \
         at the top left, in {channel}: no error can be measured; find what made them, or render it again",
        path.display(), at[0], at[1]
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Number of NaN values.
        nan: u64,
        /// Number of infinite values, of either sign.
        infinite: u64,
        /// Column and row of the first such value.
        at: [u32; 2],
        /// Channel of the first such value, in words.
        channel: &'static str,
    },
    /// The pictures have two sizes.
    #[error(
        "{} has {}×{} pixels and {} {}×{}: only pictures of one size can be compared; render one of them at the size \
         of the other (--width, --height)",
        paths[0].display(), sizes[0][0], sizes[0][1], paths[1].display(), sizes[1][0], sizes[1][1]
    )]
    Sizes {
        /// Both files.
        paths: [PathBuf; 2],
        /// Their columns and rows.
        sizes: [[u32; 2]; 2],
    },
}

/// Two pictures of one size that have pixels, every value of which is finite.
#[derive(Clone, Debug)]
pub struct Pair {
    a: RadianceImage,
    b: RadianceImage,
    warnings: Vec<String>,
}

impl Pair {
    /// Checks the picture and its reference; messages call them by these names.
    ///
    /// # Errors
    /// All faults of both.
    pub fn new(names: [&Path; 2], a: RadianceImage, b: RadianceImage) -> Result<Self, Vec<CompareError>> {
        let errors = [check_finite(names[0], &a), check_finite(names[1], &b), check_sizes(names, &a, &b)];
        let errors: Vec<_> = errors.into_iter().flatten().collect();
        if errors.is_empty() { Ok(Self { a, b, warnings: Vec::new() }) } else { Err(errors) }
    }

    /// Reads two image files of any format that a texture may have: whole numbers are read as sRGB, floats as linear;
    /// alpha is left out.
    ///
    /// # Errors
    /// All faults of both.
    pub fn load(a: &Path, b: &Path) -> Result<Self, Vec<CompareError>> {
        match (read(a), read(b)) {
            (Ok((first, mut warnings)), Ok((second, more))) => {
                warnings.extend(more);
                warnings.dedup();
                Ok(Self { warnings, ..Self::new([a, b], first, second)? })
            }
            (first, second) => {
                Err([first.err(), second.err()].into_iter().flatten().map(CompareError::from).collect())
            }
        }
    }

    /// The picture under test.
    pub fn a(&self) -> &RadianceImage {
        &self.a
    }

    /// The reference.
    pub fn b(&self) -> &RadianceImage {
        &self.b
    }

    /// Warnings about parts of the files that are ignored.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Columns of both.
    pub fn width(&self) -> usize {
        self.a.width as usize
    }

    /// Rows of both.
    pub fn height(&self) -> usize {
        self.a.height as usize
    }

    /// Both pixels at a position.
    pub(super) fn at(&self, x: usize, y: usize) -> [Vec3; 2] {
        let index = y * self.width() + x;
        [self.a.pixels[index], self.b.pixels[index]]
    }
}

/// Reads an image, with the warnings about it.
fn read(path: &Path) -> Result<(RadianceImage, Vec<String>), AssetError> {
    let image =
        load(path, ImageEncoding::Raw, ImageLimits::default(), &ignore_progress, &CancelToken::new())?;
    let texels = image.texels;
    let (width, height) = (texels.width, texels.height);
    Ok((RadianceImage { width, height, pixels: texels.into_linear() }, image.warnings))
}

fn check_finite(path: &Path, image: &RadianceImage) -> Option<CompareError> {
    const CHANNELS: [&str; 3] = ["red", "green", "blue"];
    let first = image.pixels.iter().position(|pixel| !pixel.is_finite())?;
    let channel = image.pixels[first].to_array().iter().position(|value| !value.is_finite())?;
    let values = || image.pixels[first..].iter().flat_map(Vec3::to_array);
    let (column, row) = (first % image.width as usize, first / image.width as usize);
    Some(CompareError::NotFinite {
        path: path.to_owned(),
        nan: values().filter(|value| value.is_nan()).count() as u64,
        infinite: values().filter(|value| value.is_infinite()).count() as u64,
        at: [column as u32, row as u32],
        channel: CHANNELS[channel],
    })
}

fn check_sizes(names: [&Path; 2], a: &RadianceImage, b: &RadianceImage) -> Option<CompareError> {
    let sizes = [a, b].map(|image| [image.width, image.height]);
    (sizes[0] != sizes[1]).then(|| CompareError::Sizes { paths: names.map(Path::to_owned), sizes })
}
