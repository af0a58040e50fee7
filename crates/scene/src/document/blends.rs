//! Resolves the materials of blends, which may be defined later in the file.

use std::ops::Range;

use super::super::description::{
    CoatSource, EmissionSource, Material, MaterialKind, NumberSource, OpacitySource, ReflectingSides,
};
use super::super::sanitize::escape_and_truncate;
use super::context::{FileContext, Issue};

/// Maximum number of materials in a blend, counting those of nested blends.
const MAX_PARTS: usize = 64;

/// A material whose table has been read.
pub(super) enum ReadMaterial {
    /// Any material except a blend.
    Complete(Box<Material>),
    /// A blend.
    Blend(UnresolvedBlend),
}

/// A blend that refers to its materials by index.
pub(super) struct UnresolvedBlend {
    /// Name of the blend.
    pub(super) name: String,
    /// Weight of the second material.
    pub(super) weight: NumberSource,
    /// Indices of the materials.
    pub(super) parts: [usize; 2],
    /// The span of `materials`.
    pub(super) span: Range<usize>,
}

/// Progress of the resolution of one material.
enum ResolutionProgress {
    /// Not yet visited. Contains `None` for an invalid material.
    Pending(Option<ReadMaterial>),
    /// A blend whose parts are being resolved.
    Active,
    /// Resolved, or `None` for an invalid material.
    Done(Option<Box<Material>>),
}

/// Replaces indices by materials. Invalid materials are `None`.
pub(super) fn resolve_blends(
    context: &FileContext<'_>,
    read: Vec<Option<ReadMaterial>>,
) -> Vec<Option<Material>> {
    let count = read.len();
    let mut resolver =
        BlendResolver { context, materials: read.into_iter().map(ResolutionProgress::Pending).collect() };
    (0..count)
        .map(|index| resolver.resolve_material(index, 0).ok().flatten().map(|material| *material))
        .collect()
}

/// A blend that contains itself.
struct BlendCycle;

struct BlendResolver<'a> {
    context: &'a FileContext<'a>,
    materials: Vec<ResolutionProgress>,
}

impl BlendResolver<'_> {
    /// Resolves a material at the nesting depth `depth`.
    fn resolve_material(&mut self, index: usize, depth: usize) -> Result<Option<Box<Material>>, BlendCycle> {
        let material = match std::mem::replace(&mut self.materials[index], ResolutionProgress::Active) {
            ResolutionProgress::Active => return Err(BlendCycle),
            ResolutionProgress::Done(material) => material,
            ResolutionProgress::Pending(None) => None,
            ResolutionProgress::Pending(Some(ReadMaterial::Complete(material))) => Some(material),
            ResolutionProgress::Pending(Some(ReadMaterial::Blend(blend))) => self.resolve_blend(blend, depth),
        };
        self.materials[index] = ResolutionProgress::Done(material.clone());
        Ok(material)
    }

    /// Resolves a blend. Reports an error if its materials cannot be blended.
    fn resolve_blend(&mut self, blend: UnresolvedBlend, depth: usize) -> Option<Box<Material>> {
        let UnresolvedBlend { name, weight, parts, span } = blend;
        let shown = escape_and_truncate(&name, 40);
        let context = self.context;
        let error = |message: String, help: &str| {
            context.report(Issue::error(span.clone(), message).with_help(help));
        };
        let too_many = format!("the blend \"{shown}\" combines more than {MAX_PARTS} materials");
        let remove = "blend fewer materials";
        // The blends around a blend at this depth combine at least as many materials.
        if depth == MAX_PARTS {
            error(too_many, remove);
            return None;
        }
        let [first, second] = match parts.map(|part| self.resolve_material(part, depth + 1)) {
            [Ok(first), Ok(second)] => [first?, second?],
            [Err(BlendCycle), _] | [_, Err(BlendCycle)] => {
                error(format!("the blend \"{shown}\" contains itself"), "blend other materials");
                return None;
            }
        };
        if first.kind.is_solid_glass() || second.kind.is_solid_glass() {
            error("solid glass cannot be blended".to_owned(), "use `thin = true` for a pane");
            return None;
        }
        let kind = MaterialKind::Blend { weight, parts: Box::new([*first, *second]) };
        if leaf_count(&kind) > MAX_PARTS {
            error(too_many, remove);
            return None;
        }
        let (emission, opacity, coat) = (EmissionSource::NONE, OpacitySource::FULL, CoatSource::NONE);
        let sides = ReflectingSides::Both;
        Some(Box::new(Material { name, kind, sides, emission, normal_map: None, bump: None, opacity, coat }))
    }
}

/// Number of materials in a blend that are not blends.
fn leaf_count(kind: &MaterialKind) -> usize {
    match kind.blended_materials() {
        [] => 1,
        parts => parts.iter().map(|part| leaf_count(&part.kind)).sum(),
    }
}
