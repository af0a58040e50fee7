//! Faces with texture coordinates or colors of their own.

use super::super::parsed::Parsed;
use super::body::Numbers;
use super::colors::Colors;
use super::header::{Element, Kind, Scalar};
use super::{Place, corner, each, list_length, skip, slot};
use crate::assets::AssetError;
use crate::math::DVec2;

/// Use of a property of a face.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    Corners,
    /// Texture coordinates of the corners, or of the face.
    Uvs,
    /// Colors of the corners, or of the face.
    Colors,
    /// A number of the face: texture coordinates, color, or texture.
    Value(usize),
    Unused,
}

/// Places of the numbers of a face.
const UV: [usize; 2] = [0, 1];
const COLOR: [usize; 3] = [2, 3, 4];
const TEXTURE: usize = 5;

/// The use of each property. `corners` is the list of vertices.
fn roles(element: &Element, corners: usize) -> Vec<(Kind, Role)> {
    let role = |(index, kind, name): (usize, Kind, &str)| match (kind, name) {
        _ if index == corners => Role::Corners,
        (Kind::List { .. }, "texcoord" | "texcoords" | "texture_coordinates" | "uv" | "uvs" | "st") => {
            Role::Uvs
        }
        (Kind::List { .. }, "color" | "colors") => Role::Colors,
        (Kind::One(_), "texnumber") => Role::Value(TEXTURE),
        (Kind::One(_), _) => match slot(name) {
            Some(uv @ 6..=7) => Role::Value(UV[uv - 6]),
            Some(color @ 8..=10) => Role::Value(COLOR[color - 8]),
            Some(_) | None => Role::Unused,
        },
        (Kind::List { .. }, _) => Role::Unused,
    };
    let properties = element.properties.iter().enumerate();
    properties.map(|(index, of)| (of.kind, role((index, of.kind, &of.name)))).collect()
}

/// Whether faces have more than vertices.
pub(super) fn has_own(element: &Element, corners: usize) -> bool {
    roles(element, corners).iter().any(|(_, role)| ![Role::Corners, Role::Unused].contains(role))
}

/// Reads faces with texture coordinates or colors of their own.
pub(super) fn read(
    place: &Place<'_>,
    element: &Element,
    corners: usize,
    numbers: &mut impl Numbers,
    vertices: u64,
    parsed: &mut Parsed,
) -> Result<(), AssetError> {
    let roles = roles(element, corners);
    let mut faces = Faces::new(&roles);
    each(place, element, numbers, |numbers| {
        let start = numbers.at();
        faces.read(&roles, numbers, vertices)?;
        faces.add(parsed, start);
        Ok(())
    })?;
    faces.finish(place, parsed);
    Ok(())
}

/// Numbers of the current face, and what all faces have.
struct Faces {
    has_uvs: bool,
    has_uv: bool,
    has_color: bool,
    corners: Vec<u32>,
    uvs: Vec<f64>,
    parts: Vec<f64>,
    values: [f64; 6],
    colors: Option<Colors>,
    /// First texture, and whether another one occurs.
    texture: Option<f64>,
    has_textures: bool,
    /// Number of lists of a wrong length, and the number and place of the first of their faces.
    wrong: u64,
    first_wrong: (usize, usize),
}

impl Faces {
    fn new(roles: &[(Kind, Role)]) -> Self {
        let has = |wanted: Role| roles.iter().any(|(_, role)| *role == wanted);
        let has_value = |place: &usize| has(Role::Value(*place));
        let scalar = |wanted: Role| {
            roles.iter().find(|(_, role)| *role == wanted).map(|(kind, _)| match *kind {
                Kind::One(scalar) | Kind::List { item: scalar, .. } => scalar,
            })
        };
        let has_color = COLOR.iter().all(has_value);
        let own = COLOR.map(|place| scalar(Role::Value(place)).unwrap_or(Scalar::U8));
        let colors = match scalar(Role::Colors) {
            Some(scalar) => Some(Colors::new([scalar; 3])),
            None => has_color.then(|| Colors::new(own)),
        };
        let has_uv = UV.iter().all(has_value);
        Self {
            has_uvs: has_uv || has(Role::Uvs),
            has_uv,
            has_color: has_color && !has(Role::Colors),
            corners: Vec::new(),
            uvs: Vec::new(),
            parts: Vec::new(),
            values: [0.0; 6],
            colors,
            texture: None,
            has_textures: false,
            wrong: 0,
            first_wrong: (0, 0),
        }
    }

    fn read<N: Numbers>(
        &mut self,
        roles: &[(Kind, Role)],
        numbers: &mut N,
        vertices: u64,
    ) -> Result<(), String> {
        self.corners.clear();
        self.uvs.clear();
        self.parts.clear();
        for &(kind, role) in roles {
            match (kind, role) {
                (Kind::List { count, item }, Role::Corners) => {
                    for _ in 0..list_length(numbers, count, item)? {
                        self.corners.push(corner(numbers.integer(item)?, vertices)?);
                    }
                }
                (Kind::List { count, item }, Role::Uvs | Role::Colors) => {
                    let list = if role == Role::Uvs { &mut self.uvs } else { &mut self.parts };
                    for _ in 0..list_length(numbers, count, item)? {
                        list.push(numbers.float(item)?);
                    }
                }
                (Kind::One(scalar), Role::Value(place)) => self.values[place] = numbers.float(scalar)?,
                (_, Role::Corners | Role::Uvs | Role::Colors | Role::Value(_) | Role::Unused) => {
                    skip(numbers, kind)?;
                }
            }
        }
        Ok(())
    }

    /// Adds the face that has been read.
    fn add(&mut self, parsed: &mut Parsed, start: usize) {
        let arity = self.corners.len();
        let is_wrong =
            |list: &[f64], sizes| !list.is_empty() && arity > 0 && own(list, arity, 0, sizes).is_none();
        if is_wrong(&self.uvs, UV_SIZES) || is_wrong(&self.parts, COLOR_SIZES) {
            if self.wrong == 0 {
                self.first_wrong = (parsed.faces.len(), start);
            }
            self.wrong += 1;
        }
        for (index, &vertex) in self.corners.iter().enumerate() {
            parsed.faces.corner(vertex);
            if self.has_uvs {
                let of_face = if self.has_uv { UV.map(|place| self.values[place]) } else { [f64::NAN; 2] };
                let own = own(&self.uvs, arity, index, UV_SIZES).and_then(|uv| uv.first_chunk());
                parsed.corner_uvs.push(DVec2::from(*own.unwrap_or(&of_face)).as_vec2());
            }
            if let Some(colors) = &mut self.colors {
                // Faces without a color are white.
                let of_face =
                    if self.has_color { COLOR.map(|place| self.values[place]) } else { [f64::INFINITY; 3] };
                let own = own(&self.parts, arity, index, COLOR_SIZES).and_then(|color| color.first_chunk());
                colors.push(*own.unwrap_or(&of_face));
            }
        }
        parsed.faces.close(arity);
        let texture = self.values[TEXTURE];
        self.has_textures |= *self.texture.get_or_insert(texture) != texture;
    }

    fn finish(self, place: &Place<'_>, parsed: &mut Parsed) {
        if self.wrong > 0 {
            let (face, start) = self.first_wrong;
            let more = if self.wrong > 1 { format!(" and {} more", self.wrong - 1) } else { String::new() };
            parsed.warnings.push(format!(
                "{}{more}: the number of texture coordinates or colors does not fit the corners: ignored there",
                place.of_face(start, face)
            ));
        }
        if self.has_textures {
            let warning = "the faces have several textures (`texnumber`): all show those of one material";
            parsed.warnings.push(warning.to_owned());
        }
        let Some(colors) = self.colors else { return };
        if parsed.colors.is_empty() {
            (parsed.corner_colors, _) = colors.finish();
        } else {
            parsed.warnings.push("the colors of the faces are ignored: the vertices have colors".to_owned());
        }
    }
}

/// Numbers of texture coordinates or a color in a list.
const UV_SIZES: [usize; 2] = [2, 3];
const COLOR_SIZES: [usize; 2] = [3, 4];

/// The numbers of a corner in a list, which is for all corners in turn or for the whole face.
fn own(list: &[f64], arity: usize, index: usize, sizes: [usize; 2]) -> Option<&[f64]> {
    match sizes.into_iter().find(|size| list.len() == size * arity) {
        Some(size) => list.get(index * size..),
        None => sizes.contains(&list.len()).then_some(list),
    }
}
