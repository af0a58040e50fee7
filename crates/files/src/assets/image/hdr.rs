//! Radiance HDR decoder (Ward, *Real Pixels*, Graphics Gems II, 1991). `image` supports only one of the eight
//! orientations and ignores header lines that scale the values.

use std::io::{self, BufRead, Read};

use ::image::error::{DecodingError, ImageFormatHint};
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};

use super::metadata::{ImageColorMetadata, ImageWarning};
use super::primaries::Primaries;
use super::space::ColorSpace;

/// Maximum size of a header, including the resolution line. PLY headers have the same limit.
const HEADER_BYTES: u64 = 1 << 20;
/// Luminous efficacy of white light in lm/W (`WHTEFFICACY` in Radiance). XYZE values include this factor.
const WHITE_EFFICACY: f64 = 179.0;
/// First bytes of an HDR file, followed by a program name.
pub(super) const MAGIC: &[u8] = b"#?";

/// Decoder for Radiance HDR files.
pub(super) struct HdrDecoder<R> {
    file: R,
    header: HdrHeader,
}

impl<R: BufRead> HdrDecoder<R> {
    pub(super) fn new(mut file: R) -> ImageResult<Self> {
        let mut limited = (&mut file).take(HEADER_BYTES);
        let header = HdrHeader::read(&mut limited);
        if limited.limit() == 0 {
            return Err(decoding_error(header_too_long_message()));
        }
        Ok(Self { header: header?, file })
    }

    /// Color space and warnings.
    pub(super) fn take_metadata(&mut self) -> ImageColorMetadata {
        let space = std::mem::take(&mut self.header.space);
        ImageColorMetadata {
            space,
            warnings: std::mem::take(&mut self.header.warnings),
            ..ImageColorMetadata::default()
        }
    }
}

impl<R: BufRead> ImageDecoder for HdrDecoder<R> {
    fn dimensions(&self) -> (u32, u32) {
        self.header.scan.size()
    }

    fn color_type(&self) -> ColorType {
        ColorType::Rgb32F
    }

    fn read_image(self, samples: &mut [u8]) -> ImageResult<()> {
        const PIXEL_BYTES: usize = 12;
        let Self { mut file, header: HdrHeader { scan, scales, .. } } = self;
        let mut pixels = Vec::new();
        for line in 0..scan.slow.count {
            read_scanline(&mut file, scan.fast.count as usize, &mut pixels)?;
            for (along, pixel) in pixels.iter().enumerate() {
                let start = PIXEL_BYTES * scan.pixel_index(line as usize, along);
                let values = decode_rgbe(*pixel, scales).map(f32::to_ne_bytes);
                samples[start..start + PIXEL_BYTES].copy_from_slice(values.as_flattened());
            }
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

struct HdrHeader {
    scan: ScanOrder,
    /// Scale factors for red, green and blue.
    scales: [f64; 3],
    space: ColorSpace,
    warnings: Vec<ImageWarning>,
}

impl HdrHeader {
    fn read(file: &mut impl BufRead) -> ImageResult<Self> {
        let mut lines = HeaderLineReader { file, number: 0, line: Vec::new() };
        let first = lines.next()?;
        if !first.as_bytes().starts_with(MAGIC) {
            return Err(decoding_error("expected #? at the start".to_owned()));
        }
        let mut variables = HeaderVariables::default();
        let scan = loop {
            let number = lines.number + 1;
            let line = lines.next()?;
            // An empty line precedes the resolution, but some programs omit it.
            if let Some(scan) = ScanOrder::parse(&line) {
                break scan;
            }
            if !line.trim().is_empty() {
                variables.parse_line(&line, number).map_err(decoding_error)?;
            }
        };
        Ok(variables.into_header(scan))
    }
}

/// Reads header lines with any line endings.
struct HeaderLineReader<'a, R> {
    file: &'a mut R,
    number: usize,
    line: Vec<u8>,
}

impl<R: BufRead> HeaderLineReader<'_, R> {
    fn next(&mut self) -> ImageResult<String> {
        self.line.clear();
        let got = self.file.read_until(b'\n', &mut self.line).map_err(ImageError::IoError)?;
        if got == 0 {
            return Err(ImageError::IoError(io::ErrorKind::UnexpectedEof.into()));
        }
        self.number += 1;
        let line = self.line.trim_ascii_end();
        Ok(String::from_utf8_lossy(line).into_owned())
    }
}

/// Header variables that affect the pixel values.
#[derive(Default)]
struct HeaderVariables {
    /// Product of all `EXPOSURE` lines.
    exposure: Option<f64>,
    /// Product of all `COLORCORR` lines.
    correction: Option<[f64; 3]>,
    primaries: Option<Primaries>,
    is_xyz: bool,
    warnings: Vec<ImageWarning>,
}

impl HeaderVariables {
    /// Parses a header line. Ignores indented lines, which are quoted from other headers.
    fn parse_line(&mut self, line: &str, number: usize) -> Result<(), String> {
        let Some((name, value)) = line.split_once('=').filter(|_| !line.starts_with(['#', ' ', '\t'])) else {
            return Ok(());
        };
        let is_known = match name.trim_end() {
            "FORMAT" => match value.trim() {
                "32-bit_rle_rgbe" => true,
                "32-bit_rle_xyze" => {
                    self.is_xyz = true;
                    true
                }
                other => {
                    return Err(unsupported_pixel_format_message(other));
                }
            },
            "EXPOSURE" => {
                parse_numbers(value).filter(are_finite_and_positive).is_some_and(|[factor]: [f64; 1]| {
                    self.exposure = Some(self.exposure.unwrap_or(1.0) * factor);
                    true
                })
            }
            "COLORCORR" => {
                parse_numbers(value).filter(are_finite_and_positive).is_some_and(|factors: [f64; 3]| {
                    let previous = self.correction.unwrap_or([1.0; 3]);
                    self.correction = Some(std::array::from_fn(|i| previous[i] * factors[i]));
                    true
                })
            }
            "PRIMARIES" => {
                let primaries = parse_numbers(value).map(Primaries::from_numbers);
                self.primaries = primaries.filter(|primaries| primaries.to_rec_709_matrix().is_some());
                self.primaries.is_some()
            }
            "GAMMA" => parse_numbers(value) == Some([1.0]),
            _ => true,
        };
        if !is_known {
            let line: String = line.chars().take(60).collect();
            self.warnings.push(ImageWarning { line: Some(number), words: line_ignored_warning(&line) });
        }
        Ok(())
    }

    fn into_header(self, scan: ScanOrder) -> HdrHeader {
        let correction = self.correction.unwrap_or([1.0; 3]);
        let unit = if self.is_xyz { WHITE_EFFICACY } else { 1.0 };
        let exposure = self.exposure.unwrap_or(1.0) * unit;
        let primaries = if self.is_xyz { Some(Primaries::XYZ) } else { self.primaries };
        let matrix = primaries.and_then(Primaries::to_rec_709_matrix);
        HdrHeader {
            scan,
            scales: correction.map(|correction| 1.0 / (exposure * correction)),
            space: matrix.map_or_else(ColorSpace::default, ColorSpace::from_matrix_to_rec_709),
            warnings: self.warnings,
        }
    }
}

pub(super) fn header_too_long_message() -> String {
    format!("the header is longer than {} MiB", HEADER_BYTES >> 20)
}

pub(super) fn unsupported_pixel_format_message(found: &str) -> String {
    format!("format {found:?} is neither 32-bit_rle_rgbe nor 32-bit_rle_xyze")
}

/// Warning about an ignored header line.
pub(super) fn line_ignored_warning(line: &str) -> String {
    format!("`{line}` is ignored")
}

pub(super) const WRONG_LENGTH: &str = "a scanline's length differs from the header";
pub(super) const RUN_TOO_LONG: &str = "a run exceeds its scanline";

/// Parses exactly `N` numbers.
fn parse_numbers<const N: usize>(value: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = value.split_whitespace().map(|word| word.parse().ok()).collect();
    numbers?.try_into().ok()
}

/// Whether all numbers are finite and positive.
fn are_finite_and_positive<const N: usize>(numbers: &[f64; N]) -> bool {
    numbers.iter().all(|number| number.is_finite() && *number > 0.0)
}

/// Direction in which pixels are stored along one axis.
#[derive(Clone, Copy)]
struct ScanAxis {
    is_vertical: bool,
    /// Whether pixels are stored from left to right or, on a vertical axis, from top to bottom.
    is_forward: bool,
    count: u32,
}

impl ScanAxis {
    fn parse(name: &str, count: &str) -> Option<Self> {
        let (is_vertical, is_forward) = match name {
            "-Y" => (true, true),
            "+Y" => (true, false),
            "+X" => (false, true),
            "-X" => (false, false),
            _ => return None,
        };
        Some(Self { is_vertical, is_forward, count: count.parse().ok()? })
    }

    /// Column or row at a position in storage order.
    fn coordinate(self, at: usize) -> usize {
        if self.is_forward { at } else { self.count as usize - 1 - at }
    }
}

/// Order of the pixels in the file.
struct ScanOrder {
    slow: ScanAxis,
    fast: ScanAxis,
}

impl ScanOrder {
    fn parse(line: &str) -> Option<Self> {
        let words: Vec<_> = line.split_whitespace().collect();
        let [first, slow, second, fast] = words.as_slice() else { return None };
        let scan = Self { slow: ScanAxis::parse(first, slow)?, fast: ScanAxis::parse(second, fast)? };
        (scan.slow.is_vertical != scan.fast.is_vertical).then_some(scan)
    }

    /// Width and height.
    fn size(&self) -> (u32, u32) {
        let (slow, fast) = (self.slow.count, self.fast.count);
        if self.slow.is_vertical { (fast, slow) } else { (slow, fast) }
    }

    /// Index of a pixel in row-major order from the top left.
    fn pixel_index(&self, line: usize, along: usize) -> usize {
        let (slow, fast) = (self.slow.coordinate(line), self.fast.coordinate(along));
        let (column, row) = if self.slow.is_vertical { (fast, slow) } else { (slow, fast) };
        row * self.size().0 as usize + column
    }
}

/// Decodes red, green and blue with a shared exponent.
fn decode_rgbe([red, green, blue, exponent]: [u8; 4], scales: [f64; 3]) -> [f32; 3] {
    if exponent == 0 {
        return [0.0; 3];
    }
    // 2^(exponent − 136), constructed from its bits.
    let unit = f64::from_bits((1023 - 136 + u64::from(exponent)) << 52);
    let [r, g, b] = [red, green, blue].map(f64::from);
    [r * unit * scales[0], g * unit * scales[1], b * unit * scales[2]].map(|value| value as f32)
}

/// Reads a scanline of `count` pixels.
fn read_scanline(file: &mut impl Read, count: usize, pixels: &mut Vec<[u8; 4]>) -> ImageResult<()> {
    const RUNS: std::ops::RangeInclusive<usize> = 8..=0x7fff;
    pixels.clear();
    let first = read_pixel(file)?;
    let [2, 2, high, low] = first else { return read_old_rle_scanline(file, first, count, pixels) };
    if !RUNS.contains(&count) || high > 0x7f {
        return read_old_rle_scanline(file, first, count, pixels);
    }
    if usize::from(u16::from_be_bytes([high, low])) != count {
        return Err(decoding_error(WRONG_LENGTH.to_owned()));
    }
    pixels.resize(count, [0; 4]);
    (0..4).try_for_each(|channel| read_run_length_channel(file, channel, pixels))
}

/// Reads one run-length encoded channel in a scanline.
fn read_run_length_channel(file: &mut impl Read, channel: usize, pixels: &mut [[u8; 4]]) -> ImageResult<()> {
    let mut done = 0;
    while done < pixels.len() {
        let [code] = read_byte_array(file)?;
        let length = usize::from(if code > 128 { code - 128 } else { code });
        let run = pixels.get_mut(done..done + length).filter(|run| !run.is_empty());
        let Some(run) = run else { return Err(decoding_error(RUN_TOO_LONG.to_owned())) };
        if code > 128 {
            let [value] = read_byte_array(file)?;
            run.iter_mut().for_each(|pixel| pixel[channel] = value);
        } else {
            for pixel in run {
                [pixel[channel]] = read_byte_array(file)?;
            }
        }
        done += length;
    }
    Ok(())
}

/// Reads a scanline stored pixel by pixel. The value (1, 1, 1, n) repeats the previous pixel.
fn read_old_rle_scanline(
    file: &mut impl Read,
    first: [u8; 4],
    count: usize,
    pixels: &mut Vec<[u8; 4]>,
) -> ImageResult<()> {
    let (mut next, mut shift) = (Some(first), 0);
    while pixels.len() < count {
        let pixel = match next.take() {
            Some(pixel) => pixel,
            None => read_pixel(file)?,
        };
        let [1, 1, 1, times] = pixel else {
            pixels.push(pixel);
            shift = 0;
            continue;
        };
        let length = usize::from(times).checked_shl(shift).unwrap_or(usize::MAX);
        let previous = pixels.last().copied().filter(|_| length <= count - pixels.len());
        let Some(previous) = previous else {
            return Err(decoding_error(RUN_TOO_LONG.to_owned()));
        };
        pixels.resize(pixels.len() + length, previous);
        shift += 8;
    }
    Ok(())
}

fn read_pixel(file: &mut impl Read) -> ImageResult<[u8; 4]> {
    read_byte_array(file)
}

fn read_byte_array<const N: usize>(file: &mut impl Read) -> ImageResult<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes).map_err(ImageError::IoError)?;
    Ok(bytes)
}

fn decoding_error(reason: String) -> ImageError {
    ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Hdr), reason))
}
