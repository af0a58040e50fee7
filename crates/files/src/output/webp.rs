//! Lossless WebP: 8-bit sRGB, with the settings in an XMP packet (ISO 16684-1).

use image_webp::{ColorType, WebPEncoder};

use super::cancelable::{self, CancelableBuffer};
use super::{EncodeOptions, Format, OutputError, SOFTWARE, one_line};
use crate::control::CancelToken;
use crate::film::RadianceImage;

pub(super) fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let pixels = cancelable::tone_map_all(image, options, Format::WebP, token)?;
    let mut bytes = CancelableBuffer::new(token);
    let mut encoder = WebPEncoder::new(&mut bytes);
    encoder.set_xmp_metadata(xmp_packet(options).into_bytes());
    encoder
        .encode(&pixels, image.width, image.height, ColorType::Rgb8)
        .map_err(|error| OutputError::encoder(Format::WebP, &error))?;
    Ok(bytes.into_bytes())
}

/// Creates an XMP packet with the metadata as the description, one line per item.
fn xmp_packet(options: &EncodeOptions) -> String {
    let lines = options.metadata.iter();
    let lines = lines.map(|(name, value)| escape_xml(&format!("{}: {}\n", one_line(name), one_line(value))));
    format!(
        "<?xpacket begin=\"\u{feff}\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\
         <x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\
         <rdf:Description rdf:about=\"\" xmlns:xmp=\"http://ns.adobe.com/xap/1.0/\" xmlns:dc=\"http://purl.org/dc/elements/1.1/\" \
         xmp:CreatorTool=\"{}\"><dc:description><rdf:Alt><rdf:li xml:lang=\"x-default\">{}</rdf:li></rdf:Alt></dc:description>\
         </rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end=\"r\"?>",
        escape_xml(SOFTWARE),
        lines.collect::<String>()
    )
}

/// Escapes text for XML.
fn escape_xml(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
