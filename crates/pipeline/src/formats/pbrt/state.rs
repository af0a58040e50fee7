//! The graphics state, and the statements collected from all files.

use std::collections::HashMap;
use std::ops::Range;
use std::rc::Rc;

use super::lexer::{PbrtError, PbrtResult};
use super::parameters::{Parameter, Parameters, Text};
use crate::formats::foreign::transform::rotation_about_raw_axis;
use crate::math::{DMat4, DVec3};

/// Transforms at the start time and the end time.
pub(super) type MotionTransform = [DMat4; 2];

/// Color space of `rgb` parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ColorSpace {
    /// The primaries of Rec. 709 and sRGB.
    #[default]
    Srgb,
    DciP3,
    Rec2020,
    Aces,
}

impl ColorSpace {
    pub(super) const NAMES: [(&'static str, Self); 4] = [
        ("srgb", Self::Srgb),
        ("dci-p3", Self::DciP3),
        ("rec2020", Self::Rec2020),
        ("aces2065-1", Self::Aces),
    ];

    /// Converts a color to linear Rec. 709.
    pub(super) fn to_rec709(self, color: DVec3) -> DVec3 {
        let rows: [[f64; 3]; 3] = match self {
            Self::Srgb => return color,
            Self::DciP3 => [
                [1.224_940_2, -0.224_940_2, 0.0],
                [-0.042_056_96, 1.042_056_96, 0.0],
                [-0.019_637_56, -0.078_636_05, 1.098_273_6],
            ],
            Self::Rec2020 => [
                [1.660_491, -0.587_641_1, -0.072_849_9],
                [-0.124_550_5, 1.132_899_9, -0.008_349_4],
                [-0.018_150_8, -0.100_578_9, 1.118_729_7],
            ],
            Self::Aces => [
                [2.521_686, -1.134_131, -0.387_555],
                [-0.276_480, 1.372_719, -0.096_239],
                [-0.015_378, -0.152_975, 1.168_353],
            ],
        };
        DVec3::from(rows.map(|row| DVec3::from(row).dot(color)))
    }
}

/// Kinds of statements for which `Attribute` can set default parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AttributeTarget {
    Shape,
    Light,
    Material,
    Medium,
    Texture,
}

impl AttributeTarget {
    pub(super) const NAMES: [(&'static str, Self); 5] = [
        ("shape", Self::Shape),
        ("light", Self::Light),
        ("material", Self::Material),
        ("medium", Self::Medium),
        ("texture", Self::Texture),
    ];
}

/// The material of a shape.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum MaterialReference {
    /// Index into [`Statements::materials`].
    Index(usize),
    /// A name, which may be defined later.
    Named(Rc<str>),
}

/// State that statements change and `AttributeEnd` restores.
#[derive(Clone, Debug)]
pub(super) struct GraphicsState {
    pub(super) transform: MotionTransform,
    /// Which of the two transforms subsequent statements change.
    pub(super) active: [bool; 2],
    pub(super) is_reversed: bool,
    pub(super) color_space: ColorSpace,
    pub(super) material: MaterialReference,
    /// Span of the statement that set the material.
    pub(super) material_span: Range<usize>,
    /// Index into [`Statements::area_lights`].
    pub(super) area_light: Option<usize>,
    /// Names of the media inside and outside shapes, or empty.
    pub(super) media: [Rc<str>; 2],
    defaults: [Vec<Rc<Parameter>>; 5],
}

impl Default for GraphicsState {
    fn default() -> Self {
        Self {
            transform: [DMat4::IDENTITY; 2],
            active: [true; 2],
            is_reversed: false,
            color_space: ColorSpace::Srgb,
            material: MaterialReference::Index(0),
            material_span: 0..0,
            area_light: None,
            media: ["".into(), "".into()],
            defaults: std::array::from_fn(|_| Vec::new()),
        }
    }
}

impl GraphicsState {
    /// Multiplies the active transforms by `matrix` on the right, so that it is applied to points first.
    pub(super) fn concat(&mut self, matrix: DMat4) {
        self.map_active_transforms(|transform| transform * matrix);
    }

    pub(super) fn map_active_transforms(&mut self, change: impl Fn(DMat4) -> DMat4) {
        for (transform, _) in self.transform.iter_mut().zip(self.active).filter(|(_, is_active)| *is_active) {
            *transform = change(*transform);
        }
    }

    pub(super) fn default_parameters(&self, target: AttributeTarget) -> &[Rc<Parameter>] {
        &self.defaults[target as usize]
    }

    /// Adds the parameters of an `Attribute` statement as defaults.
    pub(super) fn store_attribute_defaults(
        &mut self,
        target: AttributeTarget,
        parameters: Parameters,
    ) -> PbrtResult<()> {
        /// Maximum number of defaults per target.
        const MAX_DEFAULTS: usize = 1000;
        let span = parameters.span.clone();
        let defaults = &mut self.defaults[target as usize];
        defaults.extend(parameters.into_defaults());
        if defaults.len() <= MAX_DEFAULTS {
            return Ok(());
        }
        defaults.clear();
        Err(PbrtError::new(span, format!("`Attribute` sets more than {MAX_DEFAULTS} defaults")))
    }
}

/// World-to-camera matrix of `LookAt`. In camera coordinates, x points right, y up and z forward.
pub(super) fn look_at(numbers: &[f64; 9], span: &Range<usize>) -> PbrtResult<DMat4> {
    let [position, target, up] =
        [0, 3, 6].map(|at| DVec3::new(numbers[at], numbers[at + 1], numbers[at + 2]));
    let axes = || {
        let forward = (target - position).try_normalize()?;
        let right = up.try_normalize()?.cross(forward);
        let right = right.try_normalize().filter(|_| right.length() > 1e-9)?;
        Some([right, forward.cross(right), forward])
    };
    let Some([right, up, forward]) = axes() else {
        let error = PbrtError::new(span.clone(), "this `LookAt` has no direction");
        return Err(error.with_help(
            "it needs two different points, and an up vector that is not parallel to the view direction",
        ));
    };
    let columns = [right.extend(0.0), up.extend(0.0), forward.extend(0.0), position.extend(1.0)];
    Ok(DMat4::from_cols(columns[0], columns[1], columns[2], columns[3]).inverse())
}

/// The matrix of `Rotate`.
pub(super) fn rotation(degrees: f64, axis: DVec3, span: &Range<usize>) -> PbrtResult<DMat4> {
    let axis = axis.try_normalize();
    let axis =
        axis.ok_or_else(|| PbrtError::new(span.clone(), "the axis of this rotation has no direction"))?;
    Ok(rotation_about_raw_axis(axis, degrees))
}

/// A statement with a type and parameters.
#[derive(Clone, Debug)]
pub(super) struct TypedStatement {
    /// The type, such as `"sphere"`.
    pub(super) kind: Text,
    pub(super) parameters: Parameters,
    pub(super) color_space: ColorSpace,
}

impl TypedStatement {
    /// Span of the directive and the type.
    pub(super) fn span(&self) -> Range<usize> {
        self.parameters.span.clone()
    }
}

/// A camera, light, texture or other entity with a transform.
#[derive(Clone, Debug)]
pub(super) struct PlacedEntity {
    pub(super) entity: TypedStatement,
    pub(super) transform: MotionTransform,
}

/// A shape.
#[derive(Debug)]
pub(super) struct ShapeEntity {
    pub(super) placed: PlacedEntity,
    pub(super) is_reversed: bool,
    pub(super) material: MaterialReference,
    pub(super) material_span: Range<usize>,
    pub(super) area_light: Option<usize>,
    pub(super) media: [Rc<str>; 2],
}

/// An `ObjectBegin` block.
#[derive(Debug)]
pub(super) struct ObjectDefinition {
    pub(super) name: Text,
    pub(super) shapes: Vec<ShapeEntity>,
}

/// An `ObjectInstance`.
#[derive(Debug)]
pub(super) struct ObjectInstance {
    pub(super) name: Text,
    pub(super) transform: MotionTransform,
}

/// The statements of all files.
#[derive(Debug, Default)]
pub(super) struct Statements {
    /// The camera, with the world-to-camera transform.
    pub(super) camera: Option<PlacedEntity>,
    pub(super) film: Option<TypedStatement>,
    pub(super) sampler: Option<TypedStatement>,
    pub(super) filter: Option<TypedStatement>,
    pub(super) integrator: Option<TypedStatement>,
    pub(super) float_textures: HashMap<String, PlacedEntity>,
    pub(super) spectrum_textures: HashMap<String, PlacedEntity>,
    /// Unnamed materials. The first one is pbrt's default material.
    pub(super) materials: Vec<TypedStatement>,
    pub(super) named_materials: HashMap<String, TypedStatement>,
    pub(super) media: HashMap<String, TypedStatement>,
    pub(super) lights: Vec<PlacedEntity>,
    pub(super) area_lights: Vec<TypedStatement>,
    pub(super) shapes: Vec<ShapeEntity>,
    pub(super) objects: Vec<ObjectDefinition>,
    pub(super) instances: Vec<ObjectInstance>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_has_x_on_the_right() {
        let matrix = look_at(&[0.0, 0.0, -5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0], &(0..0)).expect("a matrix");
        assert!(
            matrix.transform_point3(DVec3::new(1.0, 2.0, 0.0)).abs_diff_eq(DVec3::new(1.0, 2.0, 5.0), 1e-12)
        );
        assert!(look_at(&[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0], &(0..0)).is_err());
    }

    #[test]
    fn color_spaces_preserve_white() {
        for (name, space) in ColorSpace::NAMES {
            let white = space.to_rec709(DVec3::ONE);
            assert!((white - DVec3::ONE).abs().max_element() < 2e-4, "{name}: {white}");
        }
    }

    #[test]
    fn only_active_transforms_change() {
        let mut state = GraphicsState { active: [false, true], ..GraphicsState::default() };
        state.concat(DMat4::from_translation(DVec3::X));
        assert_eq!(state.transform, [DMat4::IDENTITY, DMat4::from_translation(DVec3::X)]);
    }
}
