//! A pair of images to compare.

use std::path::{Path, PathBuf};

use crate::assets::AssetError;
use crate::assets::image::{ColorEncoding, ImageLimits, load};
use crate::control::{CancelToken, ignore_progress};
use crate::film::RadianceImage;
use crate::math::Vec3;

/// Reason why two files cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A file could not be read or is not an image.
    #[error(transparent)]
    File(#[from] AssetError),
    /// Some values are not finite.
    #[error(
        "{}: {nan} NaN and {infinite} infinite values, the first at pixel ({}, {}) (column and row from the top left) in \
         {channel}; errors cannot be measured",
        path.display(), at[0], at[1]
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Number of NaN values.
        nan: u64,
        /// Number of infinite values, of either sign.
        infinite: u64,
        /// Column and row of the first nonfinite value.
        at: [u32; 2],
        /// Channel of the first nonfinite value.
        channel: &'static str,
    },
    /// The images have different sizes.
    #[error(
        "{} has {}×{} pixels but {} has {}×{}; images must have the same size (--width, --height)",
        paths[0].display(), sizes[0][0], sizes[0][1], paths[1].display(), sizes[1][0], sizes[1][1]
    )]
    Sizes {
        /// The files.
        paths: [PathBuf; 2],
        /// Widths and heights of the images.
        sizes: [[u32; 2]; 2],
    },
}

/// Two nonempty images of the same size with only finite values.
#[derive(Clone, Debug)]
pub struct ImagePair {
    a: RadianceImage,
    b: RadianceImage,
    warnings: Vec<String>,
}

impl ImagePair {
    /// Checks an image and its reference, and creates a pair. The names are used in messages.
    ///
    /// # Errors
    /// All errors found in the two images.
    pub fn new(names: [&Path; 2], a: RadianceImage, b: RadianceImage) -> Result<Self, Vec<CompareError>> {
        let errors = [
            nonfinite_values_error(names[0], &a),
            nonfinite_values_error(names[1], &b),
            different_sizes_error(names, &a, &b),
        ];
        let errors: Vec<_> = errors.into_iter().flatten().collect();
        if errors.is_empty() { Ok(Self { a, b, warnings: Vec::new() }) } else { Err(errors) }
    }

    /// Reads two image files in any supported texture format. Integers are sRGB, floats are linear, and alpha
    /// is ignored.
    ///
    /// # Errors
    /// All errors found in the two images.
    pub fn load(a: &Path, b: &Path) -> Result<Self, Vec<CompareError>> {
        match (read_radiance_image(a), read_radiance_image(b)) {
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

    /// The image to measure.
    pub fn measured_image(&self) -> &RadianceImage {
        &self.a
    }

    /// The reference.
    pub fn reference(&self) -> &RadianceImage {
        &self.b
    }

    /// Warnings about ignored parts of the files.
    pub fn file_warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Width of both images.
    pub fn width(&self) -> usize {
        self.a.width as usize
    }

    /// Height of both images.
    pub fn height(&self) -> usize {
        self.a.height as usize
    }

    /// Returns the pixel at a position in each image.
    pub(super) fn pixel_pair(&self, x: usize, y: usize) -> [Vec3; 2] {
        let index = y * self.width() + x;
        [self.a.pixels[index], self.b.pixels[index]]
    }
}

/// Reads an image and returns it with the warnings about its file.
fn read_radiance_image(path: &Path) -> Result<(RadianceImage, Vec<String>), AssetError> {
    let image =
        load(path, ColorEncoding::Raw, ImageLimits::default(), &ignore_progress, &CancelToken::new())?;
    let texels = image.texels;
    let (width, height) = (texels.width, texels.height);
    Ok((RadianceImage { width, height, pixels: texels.into_linear_colors() }, image.warnings))
}

fn nonfinite_values_error(path: &Path, image: &RadianceImage) -> Option<CompareError> {
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

fn different_sizes_error(names: [&Path; 2], a: &RadianceImage, b: &RadianceImage) -> Option<CompareError> {
    let sizes = [a, b].map(|image| [image.width, image.height]);
    (sizes[0] != sizes[1]).then(|| CompareError::Sizes { paths: names.map(Path::to_owned), sizes })
}
