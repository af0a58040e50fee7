//! PLY (Turk, *The PLY Polygon File Format*, 1994). Supports text and both binary byte orders, all scalar
//! types, and unknown properties and elements.

mod body;
mod colors;
mod faces;
mod header;
pub mod tables;
pub mod write;

use super::assemble::assemble_text_mesh;
use super::parsed::ParsedMesh;
use super::text::TextCursor;
use super::{AssetError, LoadedMesh, MeshFileBytes, vertex_out_of_range_message};
use crate::math::{DVec2, DVec3};
use body::{AsciiReader, BinaryReader, LineEndMode, NumberReader};
use colors::PlyColorCollector;
use header::{Element, Encoding, PlyHeader, PropertyType, ScalarType};

/// Number of items between polls of the cancel token.
const BATCH: u64 = 1 << 14;

pub(super) fn parse(source: &MeshFileBytes<'_>) -> Result<LoadedMesh, AssetError> {
    source.report_progress(0)?;
    let header = header::parse(source)?;
    let (bytes, at) = (source.bytes, header.body);
    match header.encoding {
        Encoding::Ascii => read_ascii_body(source, &header),
        Encoding::LittleEndian => read_body(source, &header, &mut BinaryReader::<false> { bytes, at }),
        Encoding::BigEndian => read_body(source, &header, &mut BinaryReader::<true> { bytes, at }),
    }
}

/// Reads a text file, ignoring line ends. If this fails or leaves words unread, some lines may contain
/// undeclared values, so the file is read again with one item per line.
fn read_ascii_body(source: &MeshFileBytes<'_>, header: &PlyHeader) -> Result<LoadedMesh, AssetError> {
    let cursor = TextCursor::new(source.bytes, header.body);
    let mut words = AsciiReader(cursor, LineEndMode::Blank);
    let by_words = read_body(source, header, &mut words);
    source.monitor.token.check_pause_and_cancel()?;
    if by_words.is_ok() && !words.0.skip_to_word_across_lines() {
        return by_words;
    }
    let mut lines = AsciiReader(cursor, LineEndMode::EndItems(0, None));
    let by_lines = read_body(source, header, &mut lines);
    match (by_lines, lines.1) {
        (Ok(mut loaded), LineEndMode::EndItems(count, Some(first))) => {
            let line = source.line_number(first);
            loaded.warnings.push(extra_line_values_warning(line, count));
            Ok(loaded)
        }
        // Return the error from the second pass, because the first pass misreads files with undeclared
        // values.
        (Err(error), LineEndMode::EndItems(_, Some(_))) => Err(error),
        (Ok(_) | Err(_), LineEndMode::EndItems(_, None) | LineEndMode::Blank) => by_words,
    }
}

/// Adds file positions to errors.
struct ErrorContext<'a> {
    source: &'a MeshFileBytes<'a>,
    encoding: Encoding,
}

impl ErrorContext<'_> {
    /// Creates an error about an item, with the line number for text files.
    fn malformed_item_error(&self, at: usize, element: &Element, index: u64, reason: &str) -> AssetError {
        let reason = item_error_message(&element.name, index + 1, reason);
        match self.encoding {
            Encoding::Ascii => self.source.malformed_error_with_line(at, reason),
            Encoding::LittleEndian | Encoding::BigEndian => self.source.malformed_error_without_line(reason),
        }
    }

    /// Line number prefix for a message, empty for binary files.
    fn line_prefix(&self, at: usize) -> String {
        match self.encoding {
            Encoding::Ascii => format!("line {}: ", self.source.line_number(at)),
            Encoding::LittleEndian | Encoding::BigEndian => String::new(),
        }
    }

    /// Adds line numbers to warnings that have a byte offset.
    fn add_line_numbers_to_warnings(&self, warnings: Vec<(usize, String)>) -> impl Iterator<Item = String> {
        warnings.into_iter().map(|(at, words)| format!("{}{words}", self.line_prefix(at)))
    }

    /// Label of a face in warnings, with the line number in text files.
    fn face_label(&self, at: usize, index: usize) -> String {
        format!("{}face {}", self.line_prefix(at), index + 1)
    }
}

fn read_body(
    source: &MeshFileBytes<'_>,
    header: &PlyHeader,
    numbers: &mut impl NumberReader,
) -> Result<LoadedMesh, AssetError> {
    let context = ErrorContext { source, encoding: header.encoding };
    let count_of =
        |name: &str| header.elements.iter().filter(|e| e.name == name).map(|e| e.count).sum::<u64>();
    let vertices = count_of("vertex");
    if vertices > u64::from(u32::MAX) || header.elements.iter().filter(|e| e.name == "vertex").count() > 1 {
        return Err(source.malformed_error_without_line(format!(
            "too many vertices ({vertices}), or more than one vertex element"
        )));
    }
    // Ignore strips if there are faces, because both describe the same triangles.
    let has_faces = count_of("face") > 0;
    let mut parsed = ParsedMesh {
        warnings: header.warning.iter().cloned().collect(),
        material_warnings: header.texture_warning.iter().cloned().collect(),
        ..ParsedMesh::default()
    };
    let mut before_faces = None;
    for element in &header.elements {
        check_plausible_count(source, element, header.encoding, numbers.offset())?;
        match element.name.as_str() {
            "vertex" => read_vertices(&context, element, numbers, &mut parsed)?,
            "face" => {
                before_faces.get_or_insert((element, numbers.clone()));
                read_faces(&context, element, numbers, vertices, &mut parsed)?;
            }
            "tristrips" if !has_faces => read_strips(&context, element, numbers, vertices, &mut parsed)?,
            _ if element.properties.is_empty() => {}
            _ => for_each_item(&context, element, numbers, |numbers| {
                element.properties.iter().try_for_each(|property| skip_property(numbers, property.kind))
            })?,
        }
    }
    let start_of = |face: usize| {
        let (element, mut numbers) = before_faces.clone().filter(|_| header.encoding == Encoding::Ascii)?;
        let earlier = Element { count: face as u64, ..element.clone() };
        read_faces(&context, &earlier, &mut numbers, vertices, &mut ParsedMesh::default()).ok()?;
        Some(numbers.next_number_offset())
    };
    assemble_text_mesh(source, parsed, start_of)
}

/// Rejects element counts that are too large for the file size, before any memory is allocated.
fn check_plausible_count(
    source: &MeshFileBytes<'_>,
    element: &Element,
    encoding: Encoding,
    at: usize,
) -> Result<(), AssetError> {
    let needed = element.count.saturating_mul(element.min_item_bytes(encoding));
    let remaining = (source.bytes.len() - at) as u64;
    if needed > remaining + 1 {
        return Err(source.malformed_error_without_line(implausible_count_message(
            &element.name,
            element.count,
            remaining,
        )));
    }
    Ok(())
}

fn item_error_message(element: &str, number: u64, reason: &str) -> String {
    format!("{element} {number}: {reason}")
}

fn implausible_count_message(element: &str, count: u64, remaining: u64) -> String {
    format!("the header claims {count} `{element}` elements, but only {remaining} bytes follow")
}

/// Warning about `count` lines with more values than properties.
fn extra_line_values_warning(first: usize, count: u64) -> String {
    let lines = match count {
        1 => format!("line {first}"),
        _ => format!("line {first} and {} more", count - 1),
    };
    format!("{lines}: ignored values not declared in the header")
}

fn list_too_long_message(length: i64) -> String {
    format!("a list claims {length} items, more than the file can hold")
}

fn negative_length_message(length: i64) -> String {
    format!("negative list length {length}")
}

const NO_POSITIONS: &str = "the vertices need properties x, y and z";

fn missing_vertex_indices_message(element: &str) -> String {
    format!("the element `{element}` needs an integer list `vertex_indices`")
}

/// Reads all items of an element.
fn for_each_item<N: NumberReader>(
    context: &ErrorContext<'_>,
    element: &Element,
    numbers: &mut N,
    mut read_item: impl FnMut(&mut N) -> Result<(), String>,
) -> Result<(), AssetError> {
    for index in 0..element.count {
        if index % BATCH == 0 {
            context.source.report_progress(numbers.offset())?;
        }
        read_item(numbers)
            .map_err(|reason| context.malformed_item_error(numbers.offset(), element, index, &reason))?;
        numbers.end_item();
    }
    Ok(())
}

fn skip_property(numbers: &mut impl NumberReader, kind: PropertyType) -> Result<(), String> {
    match kind {
        PropertyType::Scalar(scalar) => numbers.skip_scalars(scalar, 1),
        PropertyType::List { count, item } => {
            let length = read_list_length(numbers, count, item)?;
            numbers.skip_scalars(item, length)
        }
    }
}

fn read_list_length(
    numbers: &mut impl NumberReader,
    count: ScalarType,
    item: ScalarType,
) -> Result<usize, String> {
    let length = numbers.read_integer(count)?;
    match u64::try_from(length) {
        Ok(fits) if numbers.has_bytes_for(item, fits) => Ok(fits as usize),
        Ok(_) => Err(list_too_long_message(length)),
        Err(_) => Err(negative_length_message(length)),
    }
}

/// Slot of a vertex's alpha property.
const ALPHA: usize = 13;

/// Maps a vertex property's name to its slot (position, normal, texture coordinates, color, second texture
/// coordinates or alpha), or to `None` if the property is unknown.
fn vertex_property_slot(name: &str) -> Option<usize> {
    Some(match name {
        "x" => 0,
        "y" => 1,
        "z" => 2,
        "nx" => 3,
        "ny" => 4,
        "nz" => 5,
        "u" | "s" | "texture_u" | "texture_s" => 6,
        "v" | "t" | "texture_v" | "texture_t" => 7,
        "red" | "diffuse_red" | "r" => 8,
        "green" | "diffuse_green" | "g" => 9,
        "blue" | "diffuse_blue" | "b" => 10,
        "u1" | "s1" => 11,
        "v1" | "t1" => 12,
        "alpha" | "diffuse_alpha" | "a" => ALPHA,
        _ => return None,
    })
}

fn read_vertices(
    context: &ErrorContext<'_>,
    element: &Element,
    numbers: &mut impl NumberReader,
    parsed: &mut ParsedMesh,
) -> Result<(), AssetError> {
    let target = |kind: PropertyType, name: &str| {
        if matches!(kind, PropertyType::Scalar(_)) { vertex_property_slot(name) } else { None }
    };
    let layout: Vec<(PropertyType, Option<usize>)> = element
        .properties
        .iter()
        .map(|property| (property.kind, target(property.kind, &property.name)))
        .collect();
    let has = |slots: &[usize]| slots.iter().all(|slot| layout.iter().any(|(_, to)| *to == Some(*slot)));
    if !has(&[0, 1, 2]) {
        return Err(context.source.malformed_error_without_line(NO_POSITIONS));
    }
    let (has_normals, has_uvs, has_colors) = (has(&[3, 4, 5]), has(&[6, 7]), has(&[8, 9, 10]));
    let has_second_uvs = has(&[11, 12]);
    let scalar = |slot: usize| {
        layout.iter().find_map(|(kind, to)| match *kind {
            PropertyType::Scalar(scalar) if *to == Some(slot) => Some(scalar),
            PropertyType::Scalar(_) | PropertyType::List { .. } => None,
        })
    };
    let mut colors = has_colors
        .then(|| PlyColorCollector::new([8, 9, 10].map(|slot| scalar(slot).unwrap_or(ScalarType::U8))));
    let alpha_scalar = scalar(ALPHA);
    let count = element.count as usize;
    parsed.positions.reserve(count);
    parsed.normals.reserve(if has_normals { count } else { 0 });
    parsed.uvs.reserve(if has_uvs { count } else { 0 });
    parsed.second_uvs.reserve(if has_second_uvs { count } else { 0 });
    for_each_item(context, element, numbers, |numbers| {
        let mut values = [0.0; 14];
        for &(kind, slot) in &layout {
            match (kind, slot) {
                (PropertyType::Scalar(scalar), Some(slot)) => values[slot] = numbers.read_float(scalar)?,
                (PropertyType::Scalar(_), None) | (PropertyType::List { .. }, _) => {
                    skip_property(numbers, kind)?;
                }
            }
        }
        let [x, y, z, nx, ny, nz, u, v, red, green, blue, second_u, second_v, alpha] = values;
        parsed.positions.push(DVec3::new(x, y, z));
        if has_normals {
            parsed.normals.push(DVec3::new(nx, ny, nz).as_vec3());
        }
        if has_uvs {
            parsed.uvs.push(DVec2::new(u, v).as_vec2());
        }
        if has_second_uvs {
            parsed.second_uvs.push(DVec2::new(second_u, second_v).as_vec2());
        }
        if let Some(colors) = &mut colors {
            colors.push([red, green, blue], numbers.offset());
            if let Some(scalar) = alpha_scalar {
                colors.track_lowest_alpha(alpha, scalar, numbers.offset());
            }
        }
        Ok(())
    })?;
    if let Some(colors) = colors {
        let (colors, warnings) = colors.into_bytes_and_warnings();
        parsed.colors = colors;
        parsed.warnings.extend(context.add_line_numbers_to_warnings(warnings));
    }
    Ok(())
}

fn read_faces(
    context: &ErrorContext<'_>,
    element: &Element,
    numbers: &mut impl NumberReader,
    vertices: u64,
    parsed: &mut ParsedMesh,
) -> Result<(), AssetError> {
    let Some(corners) = vertex_list_index(element) else {
        return Err(context
            .source
            .malformed_error_without_line(missing_vertex_indices_message(&element.name)));
    };
    if faces::has_attributes(element, corners) {
        return faces::read_with_attributes(context, element, corners, numbers, vertices, parsed);
    }
    let faces = &mut parsed.faces;
    faces.reserve(element.count as usize);
    read_list_of_each_item(context, element, corners, numbers, |numbers, item, length| {
        for _ in 0..length {
            faces.push_corner(checked_vertex_index(numbers.read_integer(item)?, vertices)?);
        }
        faces.end_face(length);
        Ok(())
    })
}

/// Reads triangle strips. Each vertex forms a triangle with the previous two, with alternating orientation.
/// An index of −1 starts a new strip within a list. Repeated vertices join strips without adding triangles.
fn read_strips(
    context: &ErrorContext<'_>,
    element: &Element,
    numbers: &mut impl NumberReader,
    vertices: u64,
    parsed: &mut ParsedMesh,
) -> Result<(), AssetError> {
    let Some(corners) = vertex_list_index(element) else {
        return Err(context
            .source
            .malformed_error_without_line(missing_vertex_indices_message(&element.name)));
    };
    let faces = &mut parsed.faces;
    read_list_of_each_item(context, element, corners, numbers, |numbers, item, length| {
        let (mut before, mut count) = ([0; 2], 0_usize);
        for _ in 0..length {
            let vertex = numbers.read_integer(item)?;
            if vertex == -1 {
                count = 0;
                continue;
            }
            let next = checked_vertex_index(vertex, vertices)?;
            let [first, second] = before;
            if count >= 2 && first != second && second != next && next != first {
                let triangle = if count % 2 == 0 { [first, second, next] } else { [second, first, next] };
                triangle.into_iter().for_each(|vertex| faces.push_corner(vertex));
                faces.end_face(3);
            }
            (before, count) = ([second, next], count + 1);
        }
        Ok(())
    })
}

/// Returns the index of the property that lists the vertices of a face or strip.
fn vertex_list_index(element: &Element) -> Option<usize> {
    let is_named = |name: &str| ["vertex_indices", "vertex_index"].contains(&name);
    let corners = element.properties.iter().position(|property| is_named(&property.name));
    corners
        .filter(|&index| matches!(element.properties[index].kind, PropertyType::List { item, .. } if item.is_integer()))
}

/// Converts a vertex index to `u32` and checks its range.
fn checked_vertex_index(vertex: i64, vertices: u64) -> Result<u32, String> {
    match u32::try_from(vertex) {
        Ok(fits) if u64::from(fits) < vertices => Ok(fits),
        Ok(_) | Err(_) => Err(vertex_out_of_range_message(vertex, vertices)),
    }
}

/// Reads all items of an element. Calls `read` for the property with index `corners`, with the item type and
/// length of its list, and skips the other properties.
fn read_list_of_each_item<N: NumberReader>(
    context: &ErrorContext<'_>,
    element: &Element,
    corners: usize,
    numbers: &mut N,
    mut read: impl FnMut(&mut N, ScalarType, usize) -> Result<(), String>,
) -> Result<(), AssetError> {
    for_each_item(context, element, numbers, |numbers| {
        for (index, property) in element.properties.iter().enumerate() {
            let PropertyType::List { count, item } = property.kind else {
                skip_property(numbers, property.kind)?;
                continue;
            };
            let length = read_list_length(numbers, count, item)?;
            if index != corners {
                numbers.skip_scalars(item, length)?;
                continue;
            }
            read(numbers, item, length)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests;
