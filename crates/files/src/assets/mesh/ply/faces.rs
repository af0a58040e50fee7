//! Reads faces with per-face or per-corner texture coordinates or colors.

use super::super::parsed::{FACE_COLORS_IGNORED, ParsedMesh};
use super::body::NumberReader;
use super::colors::PlyColorCollector;
use super::header::{Element, PropertyType, ScalarType};
use super::{
    ErrorContext, checked_vertex_index, for_each_item, read_list_length, skip_property, vertex_property_slot,
};
use crate::assets::AssetError;
use crate::math::DVec2;

/// Meaning of a face property.
#[derive(Clone, Copy, PartialEq)]
enum PropertyRole {
    Corners,
    /// List of texture coordinates, either per corner or for the entire face.
    Uvs,
    /// List of colors, either per corner or for the entire face.
    Colors,
    /// Scalar value of the face: a texture coordinate, color component or texture number. Contains its index
    /// in `FaceReader::values`.
    Value(usize),
    Unused,
}

/// Indices into `FaceReader::values`.
const UV: [usize; 2] = [0, 1];
const COLOR: [usize; 3] = [2, 3, 4];
const TEXTURE: usize = 5;
const ALPHA: usize = 6;

/// Returns the type and role of each property. `corners` is the index of the vertex list.
fn property_roles(element: &Element, corners: usize) -> Vec<(PropertyType, PropertyRole)> {
    let role = |(index, kind, name): (usize, PropertyType, &str)| match (kind, name) {
        _ if index == corners => PropertyRole::Corners,
        (
            PropertyType::List { .. },
            "texcoord" | "texcoords" | "texture_coordinates" | "uv" | "uvs" | "st",
        ) => PropertyRole::Uvs,
        (PropertyType::List { .. }, "color" | "colors") => PropertyRole::Colors,
        (PropertyType::Scalar(_), "texnumber") => PropertyRole::Value(TEXTURE),
        (PropertyType::Scalar(_), _) => match vertex_property_slot(name) {
            Some(uv @ 6..=7) => PropertyRole::Value(UV[uv - 6]),
            Some(color @ 8..=10) => PropertyRole::Value(COLOR[color - 8]),
            Some(super::ALPHA) => PropertyRole::Value(ALPHA),
            Some(_) | None => PropertyRole::Unused,
        },
        (PropertyType::List { .. }, _) => PropertyRole::Unused,
    };
    let properties = element.properties.iter().enumerate();
    properties
        .map(|(index, property)| (property.kind, role((index, property.kind, &property.name))))
        .collect()
}

/// Whether faces have texture coordinates, colors or texture numbers.
pub(super) fn has_attributes(element: &Element, corners: usize) -> bool {
    property_roles(element, corners)
        .iter()
        .any(|(_, role)| ![PropertyRole::Corners, PropertyRole::Unused].contains(role))
}

/// Reads faces with texture coordinates or colors.
pub(super) fn read_with_attributes(
    context: &ErrorContext<'_>,
    element: &Element,
    corners: usize,
    numbers: &mut impl NumberReader,
    vertices: u64,
    parsed: &mut ParsedMesh,
) -> Result<(), AssetError> {
    let roles = property_roles(element, corners);
    let mut faces = FaceReader::new(&roles);
    for_each_item(context, element, numbers, |numbers| {
        let start = numbers.offset();
        faces.read_face(&roles, numbers, vertices)?;
        faces.append_face_to_mesh(parsed, start, numbers.offset());
        Ok(())
    })?;
    faces.add_colors_and_warnings(context, parsed);
    Ok(())
}

/// Values of the current face and the results accumulated so far.
struct FaceReader {
    has_uvs: bool,
    has_uv: bool,
    has_color: bool,
    corners: Vec<u32>,
    uvs: Vec<f64>,
    parts: Vec<f64>,
    values: [f64; 7],
    /// Type of the face's alpha.
    alpha: Option<ScalarType>,
    /// Type of the colors in lists.
    list_scalar: Option<ScalarType>,
    colors: Option<PlyColorCollector>,
    /// Texture number of the first face.
    texture: Option<f64>,
    has_several_textures: bool,
    /// Number of faces with a list of the wrong length.
    wrong: u64,
    /// Index and byte offset of the first face with a list of the wrong length.
    first_wrong: (usize, usize),
}

impl FaceReader {
    fn new(roles: &[(PropertyType, PropertyRole)]) -> Self {
        let has = |wanted: PropertyRole| roles.iter().any(|(_, role)| *role == wanted);
        let has_value = |index: &usize| has(PropertyRole::Value(*index));
        let scalar = |wanted: PropertyRole| {
            roles.iter().find(|(_, role)| *role == wanted).map(|(kind, _)| match *kind {
                PropertyType::Scalar(scalar) | PropertyType::List { item: scalar, .. } => scalar,
            })
        };
        let has_color = COLOR.iter().all(has_value);
        let scalars = COLOR.map(|index| scalar(PropertyRole::Value(index)).unwrap_or(ScalarType::U8));
        let list_scalar = scalar(PropertyRole::Colors);
        let colors = match list_scalar {
            Some(scalar) => Some(PlyColorCollector::new([scalar; 3])),
            None => has_color.then(|| PlyColorCollector::new(scalars)),
        };
        let has_uv = UV.iter().all(has_value);
        Self {
            has_uvs: has_uv || has(PropertyRole::Uvs),
            has_uv,
            has_color: has_color && !has(PropertyRole::Colors),
            corners: Vec::new(),
            uvs: Vec::new(),
            parts: Vec::new(),
            values: [0.0; 7],
            alpha: scalar(PropertyRole::Value(ALPHA)),
            list_scalar,
            colors,
            texture: None,
            has_several_textures: false,
            wrong: 0,
            first_wrong: (0, 0),
        }
    }

    fn read_face<N: NumberReader>(
        &mut self,
        roles: &[(PropertyType, PropertyRole)],
        numbers: &mut N,
        vertices: u64,
    ) -> Result<(), String> {
        self.corners.clear();
        self.uvs.clear();
        self.parts.clear();
        for &(kind, role) in roles {
            match (kind, role) {
                (PropertyType::List { count, item }, PropertyRole::Corners) => {
                    for _ in 0..read_list_length(numbers, count, item)? {
                        self.corners.push(checked_vertex_index(numbers.read_integer(item)?, vertices)?);
                    }
                }
                (PropertyType::List { count, item }, PropertyRole::Uvs | PropertyRole::Colors) => {
                    let list = if role == PropertyRole::Uvs { &mut self.uvs } else { &mut self.parts };
                    for _ in 0..read_list_length(numbers, count, item)? {
                        list.push(numbers.read_float(item)?);
                    }
                }
                (PropertyType::Scalar(scalar), PropertyRole::Value(index)) => {
                    self.values[index] = numbers.read_float(scalar)?;
                }
                (
                    _,
                    PropertyRole::Corners
                    | PropertyRole::Uvs
                    | PropertyRole::Colors
                    | PropertyRole::Value(_)
                    | PropertyRole::Unused,
                ) => {
                    skip_property(numbers, kind)?;
                }
            }
        }
        Ok(())
    }

    /// Adds the current face to `parsed`. The face is stored between the byte offsets `start` and `end`.
    fn append_face_to_mesh(&mut self, parsed: &mut ParsedMesh, start: usize, end: usize) {
        let arity = self.corners.len();
        let is_wrong = |list: &[f64], sizes| {
            !list.is_empty() && arity > 0 && components_of_corner(list, arity, 0, sizes).is_none()
        };
        if is_wrong(&self.uvs, UV_SIZES) || is_wrong(&self.parts, COLOR_SIZES) {
            if self.wrong == 0 {
                self.first_wrong = (parsed.faces.len(), start);
            }
            self.wrong += 1;
        }
        for (index, &vertex) in self.corners.iter().enumerate() {
            parsed.faces.push_corner(vertex);
            if self.has_uvs {
                let of_face = if self.has_uv { UV.map(|index| self.values[index]) } else { [f64::NAN; 2] };
                let of_corner =
                    components_of_corner(&self.uvs, arity, index, UV_SIZES).and_then(|uv| uv.first_chunk());
                parsed.corner_uvs.push(DVec2::from(*of_corner.unwrap_or(&of_face)).as_vec2());
            }
            let Some(colors) = &mut self.colors else { continue };
            let of_corner = components_of_corner(&self.parts, arity, index, COLOR_SIZES);
            match of_corner.and_then(|color| color.first_chunk()) {
                Some(color) => colors.push(*color, end),
                None if self.has_color => colors.push(COLOR.map(|index| self.values[index]), end),
                // Missing colors are white.
                None => colors.push_missing_as_white(),
            }
            let list_alpha = of_corner.and_then(|color| Some((*color.get(3)?, self.list_scalar?)));
            let alpha = list_alpha.or(self.alpha.map(|scalar| (self.values[ALPHA], scalar)));
            if let Some((alpha, scalar)) = alpha {
                colors.track_lowest_alpha(alpha, scalar, end);
            }
        }
        parsed.faces.end_face(arity);
        let texture = self.values[TEXTURE];
        self.has_several_textures |= *self.texture.get_or_insert(texture) != texture;
    }

    fn add_colors_and_warnings(self, context: &ErrorContext<'_>, parsed: &mut ParsedMesh) {
        if self.wrong > 0 {
            let (face, start) = self.first_wrong;
            let face = context.face_label(start, face);
            parsed.warnings.push(attribute_list_length_warning(&face, self.wrong));
        }
        if self.has_several_textures {
            parsed.warnings.push(SEVERAL_TEXTURES.to_owned());
        }
        let Some(colors) = self.colors else { return };
        if parsed.colors.is_empty() {
            let (colors, warnings) = colors.into_bytes_and_warnings();
            parsed.corner_colors = colors;
            parsed.warnings.extend(context.add_line_numbers_to_warnings(warnings));
        } else {
            parsed.warnings.push(FACE_COLORS_IGNORED.to_owned());
        }
    }
}

/// Warning about faces with different texture numbers.
pub(super) const SEVERAL_TEXTURES: &str = "`texnumber` is ignored: all faces have the same material";

/// Warning about `count` faces whose texture coordinate or color lists do not match the number of corners.
pub(super) fn attribute_list_length_warning(first: &str, count: u64) -> String {
    let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
    format!("{first}{more}: ignored texture coordinates or colors that do not match the number of corners")
}

/// Allowed numbers of components per texture coordinate and per color in a list.
const UV_SIZES: [usize; 2] = [2, 3];
const COLOR_SIZES: [usize; 2] = [3, 4];

/// Returns a corner's components. The list contains either one value per corner or a single value for the
/// face.
fn components_of_corner(list: &[f64], arity: usize, index: usize, sizes: [usize; 2]) -> Option<&[f64]> {
    match sizes.into_iter().find(|size| list.len() == size * arity) {
        Some(size) => list.get(index * size..(index + 1) * size),
        None => sizes.contains(&list.len()).then_some(list),
    }
}
