//! The last step of a picture: from a film to the bytes of a file, the same for one render and for merged parts.

use super::{BitDepth, EncodeOptions, Format, LayerImage, OutputError, encode_with};
use crate::control::CancelToken;
use crate::film::tone::ToneMapping;
use crate::film::{Film, Quantity, RadianceImage, SampleStats};

/// Settings that turn a film into a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Finish {
    /// Quantity of the film that the picture shows.
    pub quantity: Quantity,
    /// Tone mapping, before it knows the range of the picture.
    pub tone: ToneMapping,
    /// Bits per channel of PNG and PPM.
    pub bit_depth: BitDepth,
    /// Names and values for the file, without those that the film tells.
    pub metadata: Vec<(String, String)>,
    /// Whether the numbers are light, so that EXR files hold the error of its mean.
    pub is_light: bool,
}

impl Finish {
    /// The picture of a film.
    pub fn image(&self, film: &Film) -> RadianceImage {
        film.image(self.quantity)
    }

    /// The names and values for a file, with its samples behind the scene.
    pub fn metadata_with(&self, SampleStats { min, mean, max }: SampleStats) -> Vec<(String, String)> {
        let mut metadata = self.metadata.clone();
        let samples =
            if min == max { min.to_string() } else { format!("{min} to {max}, {mean:.2} on average") };
        metadata.insert(metadata.len().min(1), ("glimt:samples".to_owned(), samples));
        metadata
    }

    /// The bytes of a file. `image` is the picture of the film; the layers beside it are for EXR files.
    ///
    /// # Errors
    /// As [`encode`](super::encode).
    pub fn encode(
        &self,
        film: &Film,
        (image, layers): (&RadianceImage, &[LayerImage]),
        format: Format,
        token: &CancelToken,
    ) -> Result<Vec<u8>, OutputError> {
        let tone = self.tone.resolved_for(image);
        // Add what the film tells: the samples, the range at the end.
        let mut metadata = self.metadata_with(film.samples());
        let range = tone.range_map.range();
        let range = range.map(|range| format!("{} to {}", range.least, range.greatest));
        metadata.extend(range.map(|range| ("glimt:range".to_owned(), range)));
        let mean_luminance_error = if self.is_light { film.mean_luminance_error() } else { None };
        let options = EncodeOptions { tone, bit_depth: self.bit_depth, metadata, mean_luminance_error };
        encode_with((image, layers), &options, format, token)
    }
}
