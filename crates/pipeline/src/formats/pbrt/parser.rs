//! Parses the statements of a pbrt file and the files that it includes.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use super::lexer::{Lexer, PbrtError, PbrtResult, Token, TokenKind};
use super::parameters::{Parameters, Text, V3_HELP, parse_number};
use super::state::{
    AttributeTarget, ColorSpace, Entity, GraphicsState, MaterialReference, MotionTransform,
    ObjectDefinition, ObjectInstance, PlacedEntity, ShapeEntity, Statements, look_at, rotation,
};
use crate::assets::AssetError;
use crate::control::CancelToken;
use crate::formats::foreign::sources::SourceReader;
use crate::math::{DMat4, DVec3};
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

/// Maximum number of errors to report.
const MAX_ERRORS: usize = 50;
/// Maximum number of files that include each other.
const MAX_INCLUDE_DEPTH: usize = 64;
/// Maximum number of nested `AttributeBegin` and `ObjectBegin`.
const MAX_ATTRIBUTE_DEPTH: usize = 4096;

/// The directives of pbrt-v4.
const DIRECTIVES: [&str; 43] = [
    "Accelerator", "ActiveTransform", "AreaLightSource", "Attribute", "AttributeBegin", "AttributeEnd",
    "Camera", "ColorSpace", "ConcatTransform", "CoordSysTransform", "CoordinateSystem", "Film", "Identity",
    "Import", "Include", "Integrator", "LightSource", "LookAt", "MakeNamedMaterial", "MakeNamedMedium",
    "Material", "MediumInterface", "NamedMaterial", "ObjectBegin", "ObjectEnd", "ObjectInstance", "Option",
    "PixelFilter", "ReverseOrientation", "Rotate", "Sampler", "Scale", "Shape", "Texture", "Transform",
    "TransformBegin", "TransformEnd", "TransformTimes", "Translate", "WorldBegin", "All", "StartTime",
    "EndTime",
];

/// The directives that only pbrt-v3 has.
const OLD_DIRECTIVES: [&str; 5] =
    ["WorldEnd", "Renderer", "SurfaceIntegrator", "VolumeIntegrator", "Volume"];

/// What an attribute stack entry ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BlockKind {
    Attribute,
    Object,
}

/// Reads the statements of a file.
pub(super) struct Parser<'a> {
    pub(super) sources: &'a mut SourceReader,
    pub(super) errors: Vec<PbrtError>,
    pub(super) statements: Statements,
    token: &'a CancelToken,
    /// Folder of the first file, to which all paths are relative.
    folder: PathBuf,
    state: GraphicsState,
    stack: Vec<(GraphicsState, BlockKind, Range<usize>)>,
    coordinate_systems: HashMap<String, MotionTransform>,
    is_world: bool,
    /// The object that is being defined.
    object: Option<ObjectDefinition>,
    /// The files being read, from the first to the innermost.
    open_files: Vec<PathBuf>,
}

/// Reads a file and the files that it includes.
///
/// # Errors
/// Returns an error if the first file cannot be read. Other errors are in [`Parser::errors`].
pub(super) fn parse<'a>(
    path: &Path,
    sources: &'a mut SourceReader,
    token: &'a CancelToken,
) -> Result<Parser<'a>, AssetError> {
    let (text, base) = sources.read(path, token)?;
    let mut parser = Parser {
        sources,
        errors: Vec::new(),
        statements: Statements::default(),
        token,
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        state: GraphicsState::default(),
        stack: Vec::new(),
        coordinate_systems: HashMap::new(),
        is_world: false,
        object: None,
        open_files: vec![canonical(path)],
    };
    parser.statements.materials.push(default_material());
    let end = parser.parse_text(&text, base)?;
    parser.finish(end);
    Ok(parser)
}

fn default_material() -> Entity {
    let kind = Text { text: "diffuse".to_owned(), span: 0..0 };
    Entity { kind, parameters: Parameters::default(), color_space: ColorSpace::Srgb }
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

impl Parser<'_> {
    fn report(&mut self, error: Box<PbrtError>) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(*error);
        }
    }

    /// Parses the text of a file. Continues after errors. Returns the place of its end.
    fn parse_text(&mut self, text: &Arc<str>, base: usize) -> Result<Range<usize>, AssetError> {
        let mut lexer = Lexer::new(text, base);
        while self.errors.len() < MAX_ERRORS {
            self.token.check_pause_and_cancel()?;
            let directive = match lexer.next() {
                Ok(Some(token)) => token,
                Ok(None) => break,
                Err(error) => {
                    self.report(error);
                    break;
                }
            };
            let done = match (directive.kind, &*directive.text) {
                (TokenKind::Word, "Include") => self.include(&directive, &mut lexer, false)?,
                (TokenKind::Word, "Import") => self.include(&directive, &mut lexer, true)?,
                _ => self.statement(&directive, &mut lexer),
            };
            if let Err(error) = done {
                self.report(error);
                if !skip_to_directive(&mut lexer) {
                    break;
                }
            }
        }
        Ok(lexer.end())
    }

    /// Checks that nothing is open at the end.
    fn finish(&mut self, end: Range<usize>) {
        if !self.errors.is_empty() {
            return;
        }
        if let Some((_, kind, span)) = self.stack.pop() {
            let name = match kind {
                BlockKind::Attribute => "AttributeEnd",
                BlockKind::Object => "ObjectEnd",
            };
            self.report(PbrtError::new(span, format!("this block has no `{name}`")));
        } else if !self.is_world {
            let error = PbrtError::new(end, "the scene has no `WorldBegin`");
            self.report(error.with_help("the camera and the film precede it, shapes and lights follow"));
        }
    }

    /// Reads the file that a statement names. `is_import` keeps changes of the graphics state inside of it.
    fn include(
        &mut self,
        directive: &Token<'_>,
        lexer: &mut Lexer<'_>,
        is_import: bool,
    ) -> Result<PbrtResult<()>, AssetError> {
        let name = match quoted(directive, lexer) {
            Ok(name) => name,
            Err(error) => return Ok(Err(error)),
        };
        let path = self.folder.join(&name.text);
        let identity = canonical(&path);
        let error = |message: String| Ok(Err(PbrtError::new(name.span.clone(), message)));
        if self.open_files.contains(&identity) {
            return error(format!("{} includes itself", escape_and_truncate(&name.text, 60)));
        }
        if self.open_files.len() >= MAX_INCLUDE_DEPTH {
            return error(format!("more than {MAX_INCLUDE_DEPTH} files include each other"));
        }
        let (text, base) = match self.sources.read(&path, self.token) {
            Ok(read) => read,
            Err(canceled @ AssetError::Canceled(_)) => return Err(canceled),
            Err(unreadable) => {
                let help = "paths are relative to the folder of the first file, also in included files";
                return Ok(Err(PbrtError::new(name.span.clone(), unreadable.to_string()).with_help(help)));
            }
        };
        let before = is_import.then(|| (self.state.clone(), self.stack.len()));
        self.open_files.push(identity);
        let parsed = self.parse_text(&text, base);
        self.open_files.pop();
        if let Some((state, depth)) = before {
            self.stack.truncate(depth);
            self.state = state;
        }
        parsed.map(|_| Ok(()))
    }

    /// Parses a statement other than `Include` and `Import`.
    fn statement(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let span = directive.span.clone();
        if directive.kind != TokenKind::Word {
            let found = escape_and_truncate(&directive.text, 32);
            return Err(PbrtError::new(span, format!("expected a directive, found {found}")));
        }
        match &*directive.text {
            "AttributeBegin" | "TransformBegin" => self.begin_block(BlockKind::Attribute, span),
            "AttributeEnd" | "TransformEnd" => self.end_block(BlockKind::Attribute, &span),
            "Attribute" => self.attribute(directive, lexer),
            "ActiveTransform" | "ConcatTransform" | "CoordSysTransform" | "CoordinateSystem" | "Identity"
            | "LookAt" | "Rotate" | "Scale" | "Transform" | "TransformTimes" | "Translate" => {
                self.transform_statement(directive, lexer)
            }
            "Camera" | "Film" | "Integrator" | "PixelFilter" | "Sampler" | "Accelerator" => {
                self.option_entity(directive, lexer)
            }
            "Option" => {
                quoted(directive, lexer)?;
                any(directive, lexer).map(|_| ())
            }
            "WorldBegin" => self.begin_world(&span),
            "ColorSpace" => self.color_space(directive, lexer),
            "ReverseOrientation" => {
                self.check_world(&span, "ReverseOrientation")?;
                self.state.is_reversed = !self.state.is_reversed;
                Ok(())
            }
            "MakeNamedMedium" => {
                let entity = self.entity(directive, lexer, AttributeTarget::Medium)?;
                self.statements.media.insert(entity.kind.text.clone(), entity);
                Ok(())
            }
            "MediumInterface" => self.medium_interface(directive, lexer),
            "ObjectBegin" => self.begin_object(directive, lexer),
            "ObjectEnd" => self.end_object(&span),
            "ObjectInstance" => self.instance(directive, lexer),
            "Shape" | "LightSource" | "AreaLightSource" | "Material" | "MakeNamedMaterial"
            | "NamedMaterial" | "Texture" => {
                self.check_world(&span, &directive.text)?;
                self.world_entity(directive, lexer)
            }
            other => Err(unknown_directive(other, span)),
        }
    }

    /// Reports statements before `WorldBegin` that must follow it.
    fn check_world(&self, span: &Range<usize>, name: &str) -> PbrtResult<()> {
        if self.is_world {
            return Ok(());
        }
        Err(PbrtError::new(span.clone(), format!("`{name}` must follow `WorldBegin`")))
    }

    /// Parses a quoted type and parameters.
    fn entity(
        &self,
        directive: &Token<'_>,
        lexer: &mut Lexer<'_>,
        target: AttributeTarget,
    ) -> PbrtResult<Entity> {
        let mut entity = self.entity_without_defaults(directive, lexer)?;
        entity.parameters.add_defaults(self.state.defaults(target));
        Ok(entity)
    }

    fn entity_without_defaults(&self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<Entity> {
        let kind = quoted(directive, lexer)?;
        let span = directive.span.start..kind.span.end;
        let parameters = Parameters::parse(lexer, span)?;
        Ok(Entity { kind, parameters, color_space: self.state.color_space })
    }

    fn placed(&self, entity: Entity) -> PlacedEntity {
        PlacedEntity { entity, transform: self.state.transform }
    }

    fn option_entity(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let name = &*directive.text;
        if self.is_world {
            let error = PbrtError::new(directive.span.clone(), format!("`{name}` must precede `WorldBegin`"));
            return Err(error);
        }
        let entity = self.entity_without_defaults(directive, lexer)?;
        match name {
            "Camera" => {
                let inverse = self.state.transform.map(|transform| transform.inverse());
                self.coordinate_systems.insert("camera".to_owned(), inverse);
                self.statements.camera = Some(self.placed(entity));
            }
            "Film" if entity.kind.text == "image" => {
                let error = PbrtError::new(entity.kind.span, "\"image\" is a film of pbrt-v3");
                return Err(error.with_help(V3_HELP));
            }
            "Film" => self.statements.film = Some(entity),
            "Integrator" => self.statements.integrator = Some(entity),
            "PixelFilter" => self.statements.filter = Some(entity),
            "Sampler" => self.statements.sampler = Some(entity),
            _ => {}
        }
        Ok(())
    }

    fn begin_world(&mut self, span: &Range<usize>) -> PbrtResult<()> {
        if self.is_world {
            return Err(PbrtError::new(span.clone(), "there is already a `WorldBegin`"));
        }
        self.is_world = true;
        self.state.transform = [DMat4::IDENTITY; 2];
        self.state.active = [true; 2];
        self.coordinate_systems.insert("world".to_owned(), self.state.transform);
        Ok(())
    }

    fn world_entity(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        match &*directive.text {
            "Shape" => {
                let entity = self.entity(directive, lexer, AttributeTarget::Shape)?;
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
                    return Err(PbrtError::new(span, "there is already a material of this name"));
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

    fn texture(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let (name, value) = (quoted(directive, lexer)?, quoted(directive, lexer)?);
        let entity = self.entity(directive, lexer, AttributeTarget::Texture)?;
        let placed = self.placed(entity);
        let textures = match &*value.text {
            "float" => &mut self.statements.float_textures,
            "spectrum" => &mut self.statements.spectrum_textures,
            "color" => {
                let error = PbrtError::new(value.span, "\"color\" textures are of pbrt-v3");
                return Err(error.with_help(V3_HELP));
            }
            _ => {
                let error = PbrtError::new(value.span, "a texture must be \"float\" or \"spectrum\"");
                return Err(error);
            }
        };
        if textures.insert(name.text, placed).is_some() {
            return Err(PbrtError::new(name.span, "there is already a texture of this name"));
        }
        Ok(())
    }

    fn add_shape(&mut self, entity: Entity) {
        let GraphicsState { is_reversed, material, material_span, area_light, media, .. } =
            self.state.clone();
        let placed = self.placed(entity);
        let shape = ShapeEntity { placed, is_reversed, material, material_span, area_light, media };
        let shapes = self.object.as_mut().map(|object| &mut object.shapes);
        shapes.unwrap_or(&mut self.statements.shapes).push(shape);
    }

    fn attribute(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let Entity { kind, parameters, .. } = self.entity_without_defaults(directive, lexer)?;
        let found = AttributeTarget::NAMES.iter().find(|(name, _)| *name == kind.text);
        let Some((_, target)) = found else {
            let near = nearest_name(&kind.text, AttributeTarget::NAMES.iter().map(|(name, _)| *name));
            return Err(PbrtError::new(kind.span, "unknown attribute target").with_suggestion(near));
        };
        self.state.add_defaults(*target, parameters);
        Ok(())
    }

    fn color_space(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let name = quoted(directive, lexer)?;
        let found = ColorSpace::NAMES.iter().find(|(known, _)| name.text.eq_ignore_ascii_case(known));
        let Some((_, space)) = found else {
            let near = nearest_name(&name.text, ColorSpace::NAMES.iter().map(|(known, _)| *known));
            return Err(PbrtError::new(name.span, "unknown color space").with_suggestion(near));
        };
        self.state.color_space = *space;
        Ok(())
    }

    fn medium_interface(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let inside: Rc<str> = quoted(directive, lexer)?.text.into();
        let second = lexer.peek()?.filter(|token| token.kind == TokenKind::Quoted);
        let outside = match second {
            Some(_) => quoted(directive, lexer)?.text.into(),
            None => Rc::clone(&inside),
        };
        self.state.media = [inside, outside];
        Ok(())
    }

    fn begin_block(&mut self, kind: BlockKind, span: Range<usize>) -> PbrtResult<()> {
        let name = match kind {
            BlockKind::Attribute => "AttributeBegin",
            BlockKind::Object => "ObjectBegin",
        };
        self.check_world(&span, name)?;
        if self.stack.len() >= MAX_ATTRIBUTE_DEPTH {
            let message = format!("more than {MAX_ATTRIBUTE_DEPTH} blocks are nested");
            return Err(PbrtError::new(span, message));
        }
        self.stack.push((self.state.clone(), kind, span));
        Ok(())
    }

    fn end_block(&mut self, kind: BlockKind, span: &Range<usize>) -> PbrtResult<()> {
        let (begin, end) = match kind {
            BlockKind::Attribute => ("AttributeBegin", "AttributeEnd"),
            BlockKind::Object => ("ObjectBegin", "ObjectEnd"),
        };
        match self.stack.pop() {
            Some((state, open, _)) if open == kind => self.state = state,
            Some(other) => {
                self.stack.push(other);
                let message = format!("`{end}` does not end the innermost block");
                return Err(PbrtError::new(span.clone(), message));
            }
            None => {
                let message = format!("`{end}` has no matching `{begin}`");
                return Err(PbrtError::new(span.clone(), message));
            }
        }
        Ok(())
    }

    fn begin_object(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let name = quoted(directive, lexer)?;
        if self.object.is_some() {
            return Err(PbrtError::new(directive.span.clone(), "objects cannot be nested"));
        }
        if self.statements.objects.iter().any(|known| known.name.text == name.text) {
            return Err(PbrtError::new(name.span, "there is already an object of this name"));
        }
        self.begin_block(BlockKind::Object, directive.span.clone())?;
        self.object = Some(ObjectDefinition { name, shapes: Vec::new() });
        Ok(())
    }

    fn end_object(&mut self, span: &Range<usize>) -> PbrtResult<()> {
        self.end_block(BlockKind::Object, span)?;
        self.statements.objects.extend(self.object.take());
        Ok(())
    }

    fn instance(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let name = quoted(directive, lexer)?;
        self.check_world(&directive.span, "ObjectInstance")?;
        if self.object.is_some() {
            return Err(PbrtError::new(directive.span.clone(), "objects cannot contain instances"));
        }
        self.statements.instances.push(ObjectInstance { name, transform: self.state.transform });
        Ok(())
    }

    fn transform_statement(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let span = &directive.span;
        match &*directive.text {
            "Identity" => self.state.change(|_| DMat4::IDENTITY),
            "Translate" => {
                let offset = DVec3::from(numbers(directive, lexer)?);
                self.state.concat(DMat4::from_translation(offset));
            }
            "Scale" => {
                let factors = DVec3::from(numbers(directive, lexer)?);
                self.state.concat(DMat4::from_scale(factors));
            }
            "Rotate" => {
                let [angle, x, y, z] = numbers(directive, lexer)?;
                self.state.concat(rotation(angle, DVec3::new(x, y, z), span)?);
            }
            "LookAt" => {
                let matrix = look_at(&numbers(directive, lexer)?, span)?;
                self.state.concat(matrix);
            }
            "Transform" => {
                let matrix = bracketed_matrix(directive, lexer)?;
                self.state.change(|_| matrix);
            }
            "ConcatTransform" => {
                let matrix = bracketed_matrix(directive, lexer)?;
                self.state.concat(matrix);
            }
            "TransformTimes" => {
                let [_, _] = numbers(directive, lexer)?;
            }
            "CoordinateSystem" => {
                let name = quoted(directive, lexer)?;
                self.coordinate_systems.insert(name.text, self.state.transform);
            }
            "CoordSysTransform" => {
                let name = quoted(directive, lexer)?;
                let Some(transform) = self.coordinate_systems.get(&name.text) else {
                    let near = nearest_name(&name.text, self.coordinate_systems.keys().map(String::as_str));
                    let error = PbrtError::new(name.span, "unknown coordinate system");
                    return Err(error.with_suggestion(near));
                };
                self.state.transform = *transform;
            }
            _ => self.state.active = active_transforms(directive, lexer)?,
        }
        Ok(())
    }
}

fn active_transforms(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<[bool; 2]> {
    let which = any(directive, lexer)?;
    match &*which.text {
        "All" => Ok([true; 2]),
        "StartTime" => Ok([true, false]),
        "EndTime" => Ok([false, true]),
        _ => Err(PbrtError::new(which.span, "expected All, StartTime or EndTime")),
    }
}

fn unknown_directive(name: &str, span: Range<usize>) -> Box<PbrtError> {
    let shown = escape_and_truncate(name, 32);
    if OLD_DIRECTIVES.contains(&name) {
        return PbrtError::new(span, format!("`{shown}` is a directive of pbrt-v3")).with_help(V3_HELP);
    }
    let error = PbrtError::new(span, format!("unknown directive `{shown}`"));
    error.with_suggestion(nearest_name(name, DIRECTIVES))
}

/// Skips tokens until a directive follows. Returns whether there is one.
fn skip_to_directive(lexer: &mut Lexer<'_>) -> bool {
    loop {
        match lexer.peek() {
            Ok(Some(token)) if token.kind == TokenKind::Word && DIRECTIVES.contains(&&*token.text) => {
                return true;
            }
            Ok(Some(_)) => {}
            Ok(None) | Err(_) => return false,
        }
        if lexer.next().is_err() {
            return false;
        }
    }
}

/// Reads a token, which must be present.
fn any<'a>(directive: &Token<'_>, lexer: &mut Lexer<'a>) -> PbrtResult<Token<'a>> {
    let missing = || {
        let message = format!("the file ends within `{}`", escape_and_truncate(&directive.text, 32));
        PbrtError::new(directive.span.clone(), message)
    };
    lexer.next()?.ok_or_else(missing)
}

/// Reads a quoted string.
fn quoted(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<Text> {
    let token = any(directive, lexer)?;
    if token.kind != TokenKind::Quoted {
        let name = escape_and_truncate(&directive.text, 32);
        let error = PbrtError::new(token.span, format!("`{name}` needs a string in double quotes"));
        return Err(error.with_label(format!("found {}", escape_and_truncate(&token.text, 32))));
    }
    Ok(Text { text: token.text.into_owned(), span: token.span })
}

/// Reads `N` numbers, with or without brackets.
fn numbers<const N: usize>(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<[f64; N]> {
    let has_brackets = lexer.peek()?.is_some_and(|token| token.kind == TokenKind::OpenBracket);
    if has_brackets {
        lexer.next()?;
    }
    let mut values = [0.0; N];
    for value in &mut values {
        *value = parse_number(&any(directive, lexer)?)?;
    }
    if has_brackets {
        let close = any(directive, lexer)?;
        if close.kind != TokenKind::CloseBracket {
            return Err(PbrtError::new(close.span, format!("expected ] after {N} numbers")));
        }
    }
    Ok(values)
}

/// Reads 16 numbers in brackets, column by column.
fn bracketed_matrix(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<DMat4> {
    Ok(DMat4::from_cols_array(&numbers(directive, lexer)?))
}
