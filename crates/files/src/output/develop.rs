//! Encodes a film as an image file. Used for both single renders and merged parts.

use super::{BitDepth, EncodeOptions, Format, LayerImage, OutputError, encode_with_layers};
use crate::control::CancelToken;
use crate::film::tone::ToneMapping;
use crate::film::{Film, FilmQuantity, RadianceImage, SampleCountStats};

/// Settings for encoding a film as an image file.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmEncodingSettings {
    /// Film quantity that the image shows.
    pub quantity: FilmQuantity,
    /// Tone mapping, before its range is adapted to the image.
    pub tone: ToneMapping,
    /// Bits per channel in PNG and PPM files.
    pub bit_depth: BitDepth,
    /// Metadata names and values, except for those derived from the film.
    pub metadata: Vec<(String, String)>,
    /// Whether the values are radiance. If so, EXR files include the standard error of the mean.
    pub is_light: bool,
}

impl FilmEncodingSettings {
    /// Extracts the image from a film.
    pub fn extract_quantity(&self, film: &Film) -> RadianceImage {
        film.image(self.quantity)
    }

    /// Returns the metadata, with the number of samples inserted after the scene entry.
    pub fn metadata_with_samples(
        &self,
        SampleCountStats { min, mean, max }: SampleCountStats,
    ) -> Vec<(String, String)> {
        let mut metadata = self.metadata.clone();
        let samples =
            if min == max { min.to_string() } else { format!("{min} to {max}, {mean:.2} on average") };
        metadata.insert(metadata.len().min(1), ("glimt:samples".to_owned(), samples));
        metadata
    }

    /// Encodes `image`, the film's image, as an image file. Layers are written only to EXR files.
    ///
    /// # Errors
    /// Same as [`encode`](super::encode).
    pub fn encode_with_film_metadata(
        &self,
        film: &Film,
        image: &RadianceImage,
        layers: &[LayerImage],
        format: Format,
        token: &CancelToken,
    ) -> Result<Vec<u8>, OutputError> {
        let tone = self.tone.with_image_range(image);
        // Add the metadata derived from the film: the number of samples and, at the end, the range.
        let mut metadata = self.metadata_with_samples(film.sample_count_stats());
        let range = tone.range_map.range();
        let range = range.map(|range| format!("{} to {}", range.min, range.max));
        metadata.extend(range.map(|range| ("glimt:range".to_owned(), range)));
        let mean_luminance_error = if self.is_light { film.mean_luminance_standard_error() } else { None };
        let options = EncodeOptions { tone, bit_depth: self.bit_depth, metadata, mean_luminance_error };
        encode_with_layers(image, layers, &options, format, token)
    }
}
