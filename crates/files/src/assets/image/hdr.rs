//! Radiance HDR (Ward, *Real Pixels*, Graphics Gems II, 1991). `image` reads one of its eight orientations and none of the lines
//! that scale its values.

use std::io::{self, BufRead, Read};

use ::image::error::{DecodingError, ImageFormatHint};
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};

use super::facts::{Facts, Ignored};
use super::primaries::Primaries;
use super::space::ColorSpace;

/// Most bytes of a header with the line of the size; the same limit as for PLY.
const HEADER_BYTES: u64 = 1 << 20;
/// Lumens per watt of white light, by which the values of XYZE files are larger (`WHTEFFICACY` of Radiance).
const WHITE_EFFICACY: f64 = 179.0;
/// First bytes of a file; the name of a program follows.
pub(super) const MAGIC: &[u8] = b"#?";

/// Decoder of an HDR file.
pub(super) struct HdrDecoder<R> {
    file: R,
    header: Header,
}

impl<R: BufRead> HdrDecoder<R> {
    pub(super) fn new(mut file: R) -> ImageResult<Self> {
        let mut limited = (&mut file).take(HEADER_BYTES);
        let header = Header::read(&mut limited);
        if limited.limit() == 0 {
            return Err(error(format!("its header does not end within {} MiB", HEADER_BYTES >> 20)));
        }
        Ok(Self { header: header?, file })
    }

    /// The facts that the samples do not contain.
    pub(super) fn facts(&mut self) -> Facts {
        let space = std::mem::take(&mut self.header.space);
        Facts { space, ignored: std::mem::take(&mut self.header.ignored), ..Facts::default() }
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
        let Self { mut file, header: Header { scan, scales, .. } } = self;
        let mut pixels = Vec::new();
        for line in 0..scan.slow.count {
            read_line(&mut file, scan.fast.count as usize, &mut pixels)?;
            for (along, pixel) in pixels.iter().enumerate() {
                let start = PIXEL_BYTES * scan.index(line as usize, along);
                let values = radiance(*pixel, scales).map(f32::to_ne_bytes);
                samples[start..start + PIXEL_BYTES].copy_from_slice(values.as_flattened());
            }
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

struct Header {
    scan: Scan,
    /// Factors on red, green and blue.
    scales: [f64; 3],
    space: ColorSpace,
    ignored: Vec<Ignored>,
}

impl Header {
    fn read(file: &mut impl BufRead) -> ImageResult<Self> {
        let mut lines = Lines { file, number: 0, line: Vec::new() };
        let first = lines.next()?;
        if !first.as_bytes().starts_with(MAGIC) {
            return Err(error("it does not begin with #?".to_owned()));
        }
        let mut statements = Statements::default();
        let scan = loop {
            let number = lines.number + 1;
            let line = lines.next()?;
            // The size follows an empty line, which some programs leave out.
            if let Some(scan) = Scan::parse(&line) {
                break scan;
            }
            if !line.trim().is_empty() {
                statements.add(&line, number).map_err(error)?;
            }
        };
        Ok(statements.header(scan))
    }
}

/// Lines of a header, with any line end.
struct Lines<'a, R> {
    file: &'a mut R,
    number: usize,
    line: Vec<u8>,
}

impl<R: BufRead> Lines<'_, R> {
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

/// Lines of the header that change values.
#[derive(Default)]
struct Statements {
    /// Product of all `EXPOSURE` lines, and of all `COLORCORR` lines.
    exposure: Option<f64>,
    correction: Option<[f64; 3]>,
    primaries: Option<Primaries>,
    is_xyz: bool,
    ignored: Vec<Ignored>,
}

impl Statements {
    /// Adds a line. Indented ones are quoted from other headers.
    fn add(&mut self, line: &str, number: usize) -> Result<(), String> {
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
                    return Err(format!(
                        "its format {other:?} is neither 32-bit_rle_rgbe nor 32-bit_rle_xyze"
                    ));
                }
            },
            "EXPOSURE" => numbers(value).filter(positive).is_some_and(|[by]: [f64; 1]| {
                self.exposure = Some(self.exposure.unwrap_or(1.0) * by);
                true
            }),
            "COLORCORR" => numbers(value).filter(positive).is_some_and(|by: [f64; 3]| {
                let before = self.correction.unwrap_or([1.0; 3]);
                self.correction = Some(std::array::from_fn(|i| before[i] * by[i]));
                true
            }),
            "PRIMARIES" => {
                let primaries = numbers(value).map(Primaries::from_numbers);
                self.primaries = primaries.filter(|primaries| primaries.to_rec_709().is_some());
                self.primaries.is_some()
            }
            "GAMMA" => numbers(value) == Some([1.0]),
            _ => true,
        };
        if !is_known {
            let line: String = line.chars().take(60).collect();
            let words = format!("`{line}` is ignored");
            self.ignored.push(Ignored { line: Some(number), words });
        }
        Ok(())
    }

    fn header(self, scan: Scan) -> Header {
        let correction = self.correction.unwrap_or([1.0; 3]);
        let unit = if self.is_xyz { WHITE_EFFICACY } else { 1.0 };
        let exposure = self.exposure.unwrap_or(1.0) * unit;
        let primaries = if self.is_xyz { Some(Primaries::XYZ) } else { self.primaries };
        let matrix = primaries.and_then(Primaries::to_rec_709);
        Header {
            scan,
            scales: correction.map(|correction| 1.0 / (exposure * correction)),
            space: matrix.map_or_else(ColorSpace::default, ColorSpace::of_matrix),
            ignored: self.ignored,
        }
    }
}

/// The numbers of a line, `N` of them.
fn numbers<const N: usize>(value: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = value.split_whitespace().map(|word| word.parse().ok()).collect();
    numbers?.try_into().ok()
}

/// Whether all numbers are finite and above 0.
fn positive<const N: usize>(numbers: &[f64; N]) -> bool {
    numbers.iter().all(|number| number.is_finite() && *number > 0.0)
}

/// An axis of the image, in the order of the file.
#[derive(Clone, Copy)]
struct Axis {
    is_vertical: bool,
    /// Whether pixels run to the right, or down.
    is_forward: bool,
    count: u32,
}

impl Axis {
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

    /// Column or row of a position along the axis.
    fn place(self, at: usize) -> usize {
        if self.is_forward { at } else { self.count as usize - 1 - at }
    }
}

/// Order of the pixels in the file.
struct Scan {
    slow: Axis,
    fast: Axis,
}

impl Scan {
    fn parse(line: &str) -> Option<Self> {
        let words: Vec<_> = line.split_whitespace().collect();
        let [first, slow, second, fast] = words.as_slice() else { return None };
        let scan = Self { slow: Axis::parse(first, slow)?, fast: Axis::parse(second, fast)? };
        (scan.slow.is_vertical != scan.fast.is_vertical).then_some(scan)
    }

    /// Columns and rows.
    fn size(&self) -> (u32, u32) {
        let (slow, fast) = (self.slow.count, self.fast.count);
        if self.slow.is_vertical { (fast, slow) } else { (slow, fast) }
    }

    /// Index of a pixel in rows from the top.
    fn index(&self, line: usize, along: usize) -> usize {
        let (slow, fast) = (self.slow.place(line), self.fast.place(along));
        let (column, row) = if self.slow.is_vertical { (fast, slow) } else { (slow, fast) };
        row * self.size().0 as usize + column
    }
}

/// Linear values of red, green, blue and a shared exponent.
fn radiance([red, green, blue, exponent]: [u8; 4], scales: [f64; 3]) -> [f32; 3] {
    if exponent == 0 {
        return [0.0; 3];
    }
    // 2^(exponent − 136), by its bits.
    let unit = f64::from_bits((1023 - 136 + u64::from(exponent)) << 52);
    let [r, g, b] = [red, green, blue].map(f64::from);
    [r * unit * scales[0], g * unit * scales[1], b * unit * scales[2]].map(|value| value as f32)
}

/// Reads a line of `count` pixels.
fn read_line(file: &mut impl Read, count: usize, pixels: &mut Vec<[u8; 4]>) -> ImageResult<()> {
    const RUNS: std::ops::RangeInclusive<usize> = 8..=0x7fff;
    pixels.clear();
    let first = read_pixel(file)?;
    let [2, 2, high, low] = first else { return read_flat(file, first, count, pixels) };
    if !RUNS.contains(&count) || high > 0x7f {
        return read_flat(file, first, count, pixels);
    }
    if usize::from(u16::from_be_bytes([high, low])) != count {
        return Err(error("a line of it has another length than the header says".to_owned()));
    }
    pixels.resize(count, [0; 4]);
    (0..4).try_for_each(|channel| read_runs(file, channel, pixels))
}

/// Reads one channel of a line, in runs.
fn read_runs(file: &mut impl Read, channel: usize, pixels: &mut [[u8; 4]]) -> ImageResult<()> {
    let mut done = 0;
    while done < pixels.len() {
        let [code] = read_bytes(file)?;
        let length = usize::from(if code > 128 { code - 128 } else { code });
        let run = pixels.get_mut(done..done + length).filter(|run| !run.is_empty());
        let Some(run) = run else { return Err(error("a run of it does not fit into its line".to_owned())) };
        if code > 128 {
            let [value] = read_bytes(file)?;
            run.iter_mut().for_each(|pixel| pixel[channel] = value);
        } else {
            for pixel in run {
                [pixel[channel]] = read_bytes(file)?;
            }
        }
        done += length;
    }
    Ok(())
}

/// Reads a line of whole pixels, of which (1, 1, 1, n) repeats the previous one.
fn read_flat(
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
            return Err(error("a run of it does not fit into its line".to_owned()));
        };
        pixels.resize(pixels.len() + length, previous);
        shift += 8;
    }
    Ok(())
}

fn read_pixel(file: &mut impl Read) -> ImageResult<[u8; 4]> {
    read_bytes(file)
}

fn read_bytes<const N: usize>(file: &mut impl Read) -> ImageResult<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes).map_err(ImageError::IoError)?;
    Ok(bytes)
}

fn error(reason: String) -> ImageError {
    ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Hdr), reason))
}
