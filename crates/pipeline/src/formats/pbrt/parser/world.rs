//! Statements that describe the world: shapes, lights, materials, textures and objects.

use std::ops::Range;
use std::rc::Rc;

use super::super::lexer::{Lexer, PbrtError, PbrtResult, Token, TokenKind};
use super::super::parameters::{Text, V3_HELP};
use super::super::state::{
    AttributeTarget, GraphicsState, MaterialReference, ObjectDefinition, ObjectInstance, ShapeEntity,
    TypedStatement,
};
use super::{BlockKind, Parser, quoted};

/// Maximum number of shapes and instances.
const MAX_SHAPES: usize = 4_000_000;

impl Parser<'_> {
    pub(super) fn world_entity(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        match &*directive.text {
            "Shape" => {
                let entity = self.entity(directive, lexer, AttributeTarget::Shape)?;
                self.count_shape(&entity.span())?;
                self.add_shape(entity);
            }
            "LightSource" => {
                let entity = self.entity(directive, lexer, AttributeTarget::Light)?;
                let placed = self.placed(entity);
                self.statements.lights.push(placed);
            }
            "AreaLightSource" => {
                let entity = self.entity(directive, lexer, AttributeTarget::Light)?;
                self.statements.area_lights.push(entity);
                self.state.area_light = Some(self.statements.area_lights.len() - 1);
            }
            "Material" => {
                let entity = self.entity(directive, lexer, AttributeTarget::Material)?;
                self.state.material_span = entity.span();
                self.statements.materials.push(entity);
                self.state.material = MaterialReference::Index(self.statements.materials.len() - 1);
            }
            "MakeNamedMaterial" => {
                let entity = self.entity(directive, lexer, AttributeTarget::Material)?;
                let Text { text: name, span } = entity.kind.clone();
                if self.statements.named_materials.insert(name, entity).is_some() {
                    return Err(PbrtError::new(span, "there is already a material with this name"));
                }
            }
            "NamedMaterial" => {
                let name = quoted(directive, lexer)?;
                self.state.material = MaterialReference::Named(name.text.into());
                self.state.material_span = name.span;
            }
            _ => self.texture(directive, lexer)?,
        }
        Ok(())
    }

    pub(super) fn texture(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let (name, value) = (quoted(directive, lexer)?, quoted(directive, lexer)?);
        let entity = self.entity(directive, lexer, AttributeTarget::Texture)?;
        let placed = self.placed(entity);
        let textures = match &*value.text {
            "float" => &mut self.statements.float_textures,
            "spectrum" => &mut self.statements.spectrum_textures,
            "color" => {
                let error = PbrtError::new(value.span, "\"color\" textures exist only in pbrt-v3");
                return Err(error.with_help(V3_HELP));
            }
            _ => {
                let error = PbrtError::new(value.span, "a texture must be \"float\" or \"spectrum\"");
                return Err(error);
            }
        };
        if textures.insert(name.text, placed).is_some() {
            return Err(PbrtError::new(name.span, "there is already a texture with this name"));
        }
        Ok(())
    }

    /// Counts a shape or instance. Returns an error if there are too many.
    pub(super) fn count_shape(&mut self, span: &Range<usize>) -> PbrtResult<()> {
        self.shape_count += 1;
        if self.shape_count <= MAX_SHAPES {
            return Ok(());
        }
        let error = PbrtError::new(span.clone(), format!("more than {MAX_SHAPES} shapes and instances"));
        Err(error.with_help("merge shapes into larger meshes"))
    }

    pub(super) fn add_shape(&mut self, entity: TypedStatement) {
        let GraphicsState { is_reversed, material, material_span, area_light, media, .. } =
            self.state.clone();
        let placed = self.placed(entity);
        let shape = ShapeEntity { placed, is_reversed, material, material_span, area_light, media };
        let shapes = self.object.as_mut().map(|object| &mut object.shapes);
        shapes.unwrap_or(&mut self.statements.shapes).push(shape);
    }

    pub(super) fn medium_interface(
        &mut self,
        directive: &Token<'_>,
        lexer: &mut Lexer<'_>,
    ) -> PbrtResult<()> {
        let inside: Rc<str> = quoted(directive, lexer)?.text.into();
        let second = lexer.peek()?.filter(|token| token.kind == TokenKind::Quoted);
        let outside = match second {
            Some(_) => quoted(directive, lexer)?.text.into(),
            None => Rc::clone(&inside),
        };
        self.state.media = [inside, outside];
        Ok(())
    }

    pub(super) fn begin_object(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let name = quoted(directive, lexer)?;
        if self.object.is_some() {
            return Err(PbrtError::new(directive.span.clone(), "objects cannot be nested"));
        }
        if !self.object_names.insert(name.text.clone()) {
            return Err(PbrtError::new(name.span, "there is already an object with this name"));
        }
        self.begin_block(BlockKind::Object, directive.span.clone())?;
        self.object = Some(ObjectDefinition { name, shapes: Vec::new() });
        Ok(())
    }

    pub(super) fn end_object(&mut self, span: &Range<usize>) -> PbrtResult<()> {
        self.end_block(BlockKind::Object, span)?;
        self.statements.objects.extend(self.object.take());
        Ok(())
    }

    pub(super) fn instance(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let name = quoted(directive, lexer)?;
        self.check_after_world_begin(&directive.span, "ObjectInstance")?;
        if self.object.is_some() {
            return Err(PbrtError::new(directive.span.clone(), "objects cannot contain instances"));
        }
        self.count_shape(&name.span)?;
        self.statements.instances.push(ObjectInstance { name, transform: self.state.transform });
        Ok(())
    }
}
