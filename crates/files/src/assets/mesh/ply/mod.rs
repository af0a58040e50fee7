//! PLY (Turk, *The PLY Polygon File Format*, 1994): text and binary in both byte orders, any types, any further
//! properties and elements.

mod body;
mod colors;
mod faces;
mod header;
pub mod write;

use super::assemble::assemble_text;
use super::parsed::Parsed;
use super::text::Cursor;
use super::{AssetError, LoadedMesh, Source};
use crate::math::{DVec2, DVec3};
use body::{Ascii, Binary, Lines, Numbers};
use colors::Colors;
use header::{Element, Encoding, Header, Kind, Scalar};

/// Elements between two polls of the token.
const BATCH: u64 = 1 << 14;

pub(super) fn parse(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    source.tick(0)?;
    let header = header::parse(source)?;
    let (bytes, at) = (source.bytes, header.body);
    match header.encoding {
        Encoding::Ascii => read_text(source, &header),
        Encoding::LittleEndian => read(source, &header, &mut Binary::<false> { bytes, at }),
        Encoding::BigEndian => read(source, &header, &mut Binary::<true> { bytes, at }),
    }
}

/// Reads a text word by word, whatever its lines. If that fails or does not reach its end, lines may have values that the header does
/// not name: then an item a line.
fn read_text(source: &Source<'_>, header: &Header) -> Result<LoadedMesh, AssetError> {
    let cursor = Cursor::new(source.bytes, header.body);
    let mut words = Ascii(cursor, Lines::Blank);
    let by_words = read(source, header, &mut words);
    source.watch.token.check()?;
    if by_words.is_ok() && !words.0.skip_blank() {
        return by_words;
    }
    let mut lines = Ascii(cursor, Lines::EndItems(0, None));
    let by_lines = read(source, header, &mut lines);
    match (by_lines, lines.1) {
        (Ok(mut loaded), Lines::EndItems(count, Some(first))) => {
            let line = source.line(first);
            let lines = match count {
                1 => format!("line {line} has"),
                _ => format!("line {line} and {} more have", count - 1),
            };
            let warning = format!("{lines} more values than the header names: those are left out");
            loaded.warnings.push(warning);
            Ok(loaded)
        }
        // A file with such lines that is wrong in another way too: its words would be taken for others.
        (Err(error), Lines::EndItems(_, Some(_))) => Err(error),
        (Ok(_) | Err(_), Lines::EndItems(_, None) | Lines::Blank) => by_words,
    }
}

/// Place of a fault in the file.
struct Place<'a> {
    source: &'a Source<'a>,
    encoding: Encoding,
}

impl Place<'_> {
    /// An error at a place: text has lines, binary files have numbered elements.
    fn wrong(&self, at: usize, element: &Element, index: u64, reason: &str) -> AssetError {
        let reason = format!("{} {}: {reason}", element.name, index + 1);
        match self.encoding {
            Encoding::Ascii => self.source.wrong_at(at, reason),
            _ => self.source.wrong(reason),
        }
    }

    /// The line of a byte as the start of a message; nothing in binary files.
    fn line(&self, at: usize) -> String {
        match self.encoding {
            Encoding::Ascii => format!("line {}: ", self.source.line(at)),
            Encoding::LittleEndian | Encoding::BigEndian => String::new(),
        }
    }

    /// A face in words, with its line in a text.
    fn of_face(&self, at: usize, index: usize) -> String {
        format!("{}face {}", self.line(at), index + 1)
    }
}

fn read(source: &Source<'_>, header: &Header, numbers: &mut impl Numbers) -> Result<LoadedMesh, AssetError> {
    let place = Place { source, encoding: header.encoding };
    let count_of =
        |name: &str| header.elements.iter().filter(|e| e.name == name).map(|e| e.count).sum::<u64>();
    let vertices = count_of("vertex");
    if vertices > u64::from(u32::MAX) || header.elements.iter().filter(|e| e.name == "vertex").count() > 1 {
        return Err(source.wrong(format!("{vertices} vertices are too many, or in more than one element")));
    }
    // Strips repeat what faces say, if there are faces.
    let has_faces = count_of("face") > 0;
    let mut parsed = Parsed { warnings: header.warning.iter().cloned().collect(), ..Parsed::default() };
    let mut before_faces = None;
    for element in &header.elements {
        plausible(source, element, header.encoding, numbers.at())?;
        match element.name.as_str() {
            "vertex" => read_vertices(&place, element, numbers, &mut parsed)?,
            "face" => {
                before_faces.get_or_insert((element, numbers.clone()));
                read_faces(&place, element, numbers, vertices, &mut parsed)?;
            }
            "tristrips" if !has_faces => read_strips(&place, element, numbers, vertices, &mut parsed)?,
            _ if element.properties.is_empty() => {}
            _ => each(&place, element, numbers, |numbers| {
                element.properties.iter().try_for_each(|property| skip(numbers, property.kind))
            })?,
        }
    }
    let start_of = |face: usize| {
        let (element, mut numbers) = before_faces.clone().filter(|_| header.encoding == Encoding::Ascii)?;
        let earlier = Element { count: face as u64, ..element.clone() };
        read_faces(&place, &earlier, &mut numbers, vertices, &mut Parsed::default()).ok()?;
        Some(numbers.start())
    };
    assemble_text(source, parsed, start_of)
}

/// Refuses a header that claims more than the file can hold, before anything is allocated.
fn plausible(
    source: &Source<'_>,
    element: &Element,
    encoding: Encoding,
    at: usize,
) -> Result<(), AssetError> {
    let needed = element.count.saturating_mul(element.least_bytes(encoding));
    let remaining = (source.bytes.len() - at) as u64;
    if needed > remaining + 1 {
        let Element { name, count, .. } = element;
        let claim = format!("the header claims {count} times the element `{name}`");
        return Err(source.wrong(format!("{claim}, and only {remaining} bytes follow")));
    }
    Ok(())
}

/// Reads all items of an element.
fn each<N: Numbers>(
    place: &Place<'_>,
    element: &Element,
    numbers: &mut N,
    mut one: impl FnMut(&mut N) -> Result<(), String>,
) -> Result<(), AssetError> {
    for index in 0..element.count {
        if index % BATCH == 0 {
            place.source.tick(numbers.at())?;
        }
        one(numbers).map_err(|reason| place.wrong(numbers.at(), element, index, &reason))?;
        numbers.end_item();
    }
    Ok(())
}

fn skip(numbers: &mut impl Numbers, kind: Kind) -> Result<(), String> {
    match kind {
        Kind::One(scalar) => numbers.skip(scalar, 1),
        Kind::List { count, item } => {
            let length = list_length(numbers, count, item)?;
            numbers.skip(item, length)
        }
    }
}

fn list_length(numbers: &mut impl Numbers, count: Scalar, item: Scalar) -> Result<usize, String> {
    let length = numbers.integer(count)?;
    match u64::try_from(length) {
        Ok(fits) if numbers.can_hold(item, fits) => Ok(fits as usize),
        Ok(_) => Err(format!("it claims {length} corners, more than the file can hold")),
        Err(_) => Err(format!("the length of a list is {length}")),
    }
}

/// Slot of the alpha of a vertex.
const ALPHA: usize = 13;

/// Slot of a vertex value: position, normal, texture coordinates, color, second set of coordinates, alpha. `None` for other properties.
fn slot(name: &str) -> Option<usize> {
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
    place: &Place<'_>,
    element: &Element,
    numbers: &mut impl Numbers,
    parsed: &mut Parsed,
) -> Result<(), AssetError> {
    let target = |kind: Kind, name: &str| if matches!(kind, Kind::One(_)) { slot(name) } else { None };
    let layout: Vec<(Kind, Option<usize>)> = element
        .properties
        .iter()
        .map(|property| (property.kind, target(property.kind, &property.name)))
        .collect();
    let has = |slots: &[usize]| slots.iter().all(|slot| layout.iter().any(|(_, to)| *to == Some(*slot)));
    if !has(&[0, 1, 2]) {
        return Err(place.source.wrong("the vertices have no x, y and z"));
    }
    let (has_normals, has_uvs, has_colors) = (has(&[3, 4, 5]), has(&[6, 7]), has(&[8, 9, 10]));
    let has_second_uvs = has(&[11, 12]);
    let scalar = |slot: usize| {
        layout.iter().find_map(|(kind, to)| match *kind {
            Kind::One(scalar) if *to == Some(slot) => Some(scalar),
            Kind::One(_) | Kind::List { .. } => None,
        })
    };
    let mut colors =
        has_colors.then(|| Colors::new([8, 9, 10].map(|slot| scalar(slot).unwrap_or(Scalar::U8))));
    let alpha_scalar = scalar(ALPHA);
    let count = element.count as usize;
    parsed.positions.reserve(count);
    parsed.normals.reserve(if has_normals { count } else { 0 });
    parsed.uvs.reserve(if has_uvs { count } else { 0 });
    parsed.second_uvs.reserve(if has_second_uvs { count } else { 0 });
    each(place, element, numbers, |numbers| {
        let mut values = [0.0; 14];
        for &(kind, slot) in &layout {
            match (kind, slot) {
                (Kind::One(scalar), Some(slot)) => values[slot] = numbers.float(scalar)?,
                _ => skip(numbers, kind)?,
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
            colors.push([red, green, blue]);
            if let Some(scalar) = alpha_scalar {
                colors.alpha(alpha, scalar, numbers.at());
            }
        }
        Ok(())
    })?;
    if let Some(colors) = colors {
        let (colors, translucent) = colors.finish();
        parsed.colors = colors;
        parsed
            .warnings
            .extend(translucent.map(|at| format!("{}the alpha of the colors is ignored", place.line(at))));
    }
    Ok(())
}

fn read_faces(
    place: &Place<'_>,
    element: &Element,
    numbers: &mut impl Numbers,
    vertices: u64,
    parsed: &mut Parsed,
) -> Result<(), AssetError> {
    let Some(corners) = corners_of(element) else {
        return Err(place.source.wrong("the faces have no list of whole numbers `vertex_indices`"));
    };
    if faces::has_own(element, corners) {
        return faces::read(place, element, corners, numbers, vertices, parsed);
    }
    let faces = &mut parsed.faces;
    faces.reserve(element.count as usize);
    each_list(place, element, corners, numbers, |numbers, item, length| {
        for _ in 0..length {
            faces.corner(corner(numbers.integer(item)?, vertices)?);
        }
        faces.close(length);
        Ok(())
    })
}

/// Reads triangle strips: each vertex makes a triangle with the two before it, every second one turned around. −1 ends a strip
/// within a list; a vertex that is repeated joins strips and makes no triangle.
fn read_strips(
    place: &Place<'_>,
    element: &Element,
    numbers: &mut impl Numbers,
    vertices: u64,
    parsed: &mut Parsed,
) -> Result<(), AssetError> {
    let Some(corners) = corners_of(element) else {
        return Err(place.source.wrong("the strips have no list of whole numbers `vertex_indices`"));
    };
    let faces = &mut parsed.faces;
    each_list(place, element, corners, numbers, |numbers, item, length| {
        let (mut before, mut count) = ([0; 2], 0_usize);
        for _ in 0..length {
            let vertex = numbers.integer(item)?;
            if vertex == -1 {
                count = 0;
                continue;
            }
            let next = corner(vertex, vertices)?;
            let [first, second] = before;
            if count >= 2 && first != second && second != next && next != first {
                let triangle = if count % 2 == 0 { [first, second, next] } else { [second, first, next] };
                triangle.into_iter().for_each(|vertex| faces.corner(vertex));
                faces.close(3);
            }
            (before, count) = ([second, next], count + 1);
        }
        Ok(())
    })
}

/// The property that lists the vertices of a face or a strip.
fn corners_of(element: &Element) -> Option<usize> {
    let is_named = |name: &str| ["vertex_indices", "vertex_index"].contains(&name);
    let corners = element.properties.iter().position(|property| is_named(&property.name));
    corners
        .filter(|&place| matches!(element.properties[place].kind, Kind::List { item, .. } if item.is_whole()))
}

/// The vertex of this number.
fn corner(vertex: i64, vertices: u64) -> Result<u32, String> {
    match u32::try_from(vertex) {
        Ok(fits) if u64::from(fits) < vertices => Ok(fits),
        Ok(_) | Err(_) => Err(format!("vertex {vertex} is out of range: there are {vertices}, from 0")),
    }
}

/// Reads all items of an element; `read` takes their lists at `corners`, by the type and number of their items.
fn each_list<N: Numbers>(
    place: &Place<'_>,
    element: &Element,
    corners: usize,
    numbers: &mut N,
    mut read: impl FnMut(&mut N, Scalar, usize) -> Result<(), String>,
) -> Result<(), AssetError> {
    each(place, element, numbers, |numbers| {
        for (index, property) in element.properties.iter().enumerate() {
            let Kind::List { count, item } = property.kind else {
                skip(numbers, property.kind)?;
                continue;
            };
            let length = list_length(numbers, count, item)?;
            if index != corners {
                numbers.skip(item, length)?;
                continue;
            }
            read(numbers, item, length)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests;
