//! Parses the statements in a pbrt file and in the files it includes.

mod transforms;
mod world;

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::lexer::{Lexer, PbrtError, PbrtResult, Token, TokenKind};
use super::parameters::{Parameters, Text, V3_HELP};
use super::state::{
    AttributeTarget, ColorSpace, GraphicsState, MotionTransform, ObjectDefinition, PlacedEntity, Statements,
    TypedStatement,
};
use crate::assets::AssetError;
use crate::control::CancelToken;
use crate::formats::foreign::sources::SourceReader;
use crate::math::DMat4;
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

/// Maximum number of errors to report.
const MAX_ERRORS: usize = 50;
/// Maximum nesting depth of included files.
const MAX_INCLUDE_DEPTH: usize = 64;
/// Maximum nesting depth of `AttributeBegin` and `ObjectBegin` blocks.
const MAX_ATTRIBUTE_DEPTH: usize = 4096;

/// The directives of pbrt-v4.
const DIRECTIVES: [&str; 43] = [
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
    "All",
    "StartTime",
    "EndTime",
];

/// Directives that exist only in pbrt-v3.
const OLD_DIRECTIVES: [&str; 5] = ["WorldEnd", "Renderer", "SurfaceIntegrator", "VolumeIntegrator", "Volume"];

/// Kinds of blocks, which determine the directive that ends them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BlockKind {
    Attribute,
    Object,
}

/// Parses a file and the files it includes.
pub(super) struct Parser<'a> {
    pub(super) sources: &'a mut SourceReader,
    pub(super) errors: Vec<PbrtError>,
    pub(super) statements: Statements,
    token: &'a CancelToken,
    /// Folder of the main file, to which all paths are relative.
    folder: PathBuf,
    state: GraphicsState,
    stack: Vec<(GraphicsState, BlockKind, Range<usize>)>,
    /// Number of blocks that were open before the innermost `Import`. The imported file cannot end them.
    blocks_before_import: usize,
    coordinate_systems: HashMap<String, MotionTransform>,
    is_world: bool,
    /// The object being defined.
    object: Option<ObjectDefinition>,
    object_names: HashSet<String>,
    /// Number of shapes and instances.
    shape_count: usize,
    /// The files being read, from the main file to the innermost.
    open_files: Vec<PathBuf>,
}

/// Parses a file and the files it includes.
///
/// # Errors
/// Returns an error if the main file cannot be read. Other errors are in [`Parser::errors`].
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
        blocks_before_import: 0,
        coordinate_systems: HashMap::new(),
        is_world: false,
        object: None,
        object_names: HashSet::new(),
        shape_count: 0,
        open_files: vec![canonical_path(path)],
    };
    parser.statements.materials.push(default_material());
    let end = parser.parse_text(&text, base)?;
    parser.check_is_complete(end);
    Ok(parser)
}

fn default_material() -> TypedStatement {
    let kind = Text { text: "diffuse".to_owned(), span: 0..0 };
    TypedStatement { kind, parameters: Parameters::default(), color_space: ColorSpace::Srgb }
}

fn canonical_path(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

impl Parser<'_> {
    #[allow(clippy::boxed_local, reason = "all results have boxed errors")]
    fn report(&mut self, error: Box<PbrtError>) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(*error);
        }
    }

    /// Parses the text of a file, continuing after errors. Returns the span of its end.
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
        Ok(lexer.end_of_text_span())
    }

    /// Checks for unclosed blocks and a missing `WorldBegin`.
    fn check_is_complete(&mut self, end: Range<usize>) {
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
            self.report(error.with_help("put the camera and the film before it, shapes and lights after it"));
        }
    }

    /// Parses the file that a statement includes. For an `Import`, restores the graphics state afterwards.
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
        let identity = canonical_path(&path);
        let error = |message: String| Ok(Err(PbrtError::new(name.span.clone(), message)));
        if self.open_files.contains(&identity) {
            return error(format!("{} includes itself", escape_and_truncate(&name.text, 60)));
        }
        if self.open_files.len() >= MAX_INCLUDE_DEPTH {
            return error(format!("included files are nested more than {MAX_INCLUDE_DEPTH} deep"));
        }
        let (text, base) = match self.sources.read(&path, self.token) {
            Ok(read) => read,
            Err(canceled @ AssetError::Canceled(_)) => return Err(canceled),
            Err(unreadable) => {
                let help = "paths are relative to the folder of the main file, even in included files";
                return Ok(Err(PbrtError::new(name.span.clone(), unreadable.to_string()).with_help(help)));
            }
        };
        let before = is_import.then(|| {
            let blocks = std::mem::replace(&mut self.blocks_before_import, self.stack.len());
            (self.state.clone(), blocks)
        });
        self.open_files.push(identity);
        let parsed = self.parse_text(&text, base);
        self.open_files.pop();
        if let Some((state, blocks)) = before {
            self.stack.truncate(self.blocks_before_import);
            (self.state, self.blocks_before_import) = (state, blocks);
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
                self.add_statement_before_world(directive, lexer)
            }
            "Option" => {
                quoted(directive, lexer)?;
                expect_token(directive, lexer).map(|_| ())
            }
            "WorldBegin" => self.begin_world(&span),
            "ColorSpace" => self.color_space(directive, lexer),
            "ReverseOrientation" => {
                self.check_after_world_begin(&span, "ReverseOrientation")?;
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
                self.check_after_world_begin(&span, &directive.text)?;
                self.world_entity(directive, lexer)
            }
            other => Err(unknown_directive(other, span)),
        }
    }

    /// Returns an error before `WorldBegin`, for statements that must follow it.
    fn check_after_world_begin(&self, span: &Range<usize>, name: &str) -> PbrtResult<()> {
        if self.is_world {
            return Ok(());
        }
        Err(PbrtError::new(span.clone(), format!("`{name}` must follow `WorldBegin`")))
    }

    /// Parses a quoted type and parameters, and adds the defaults from `Attribute` statements.
    fn entity(
        &self,
        directive: &Token<'_>,
        lexer: &mut Lexer<'_>,
        target: AttributeTarget,
    ) -> PbrtResult<TypedStatement> {
        let mut entity = self.entity_without_defaults(directive, lexer)?;
        entity.parameters.add_defaults(self.state.default_parameters(target));
        Ok(entity)
    }

    fn entity_without_defaults(
        &self,
        directive: &Token<'_>,
        lexer: &mut Lexer<'_>,
    ) -> PbrtResult<TypedStatement> {
        let kind = quoted(directive, lexer)?;
        let span = directive.span.start..kind.span.end;
        let parameters = Parameters::parse(lexer, span)?;
        Ok(TypedStatement { kind, parameters, color_space: self.state.color_space })
    }

    fn placed(&self, entity: TypedStatement) -> PlacedEntity {
        PlacedEntity { entity, transform: self.state.transform }
    }

    fn add_statement_before_world(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
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
                let error = PbrtError::new(entity.kind.span, "\"image\" is a pbrt-v3 film");
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
            return Err(PbrtError::new(span.clone(), "the scene has more than one `WorldBegin`"));
        }
        self.is_world = true;
        self.state.transform = [DMat4::IDENTITY; 2];
        self.state.active = [true; 2];
        self.coordinate_systems.insert("world".to_owned(), self.state.transform);
        Ok(())
    }

    fn attribute(&mut self, directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<()> {
        let TypedStatement { kind, parameters, .. } = self.entity_without_defaults(directive, lexer)?;
        let found = AttributeTarget::NAMES.iter().find(|(name, _)| *name == kind.text);
        let Some((_, target)) = found else {
            let near = nearest_name(&kind.text, AttributeTarget::NAMES.iter().map(|(name, _)| *name));
            return Err(PbrtError::new(kind.span, "unknown attribute target").with_suggestion(near));
        };
        self.state.store_attribute_defaults(*target, parameters)
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

    fn begin_block(&mut self, kind: BlockKind, span: Range<usize>) -> PbrtResult<()> {
        let name = match kind {
            BlockKind::Attribute => "AttributeBegin",
            BlockKind::Object => "ObjectBegin",
        };
        self.check_after_world_begin(&span, name)?;
        if self.stack.len() >= MAX_ATTRIBUTE_DEPTH {
            let message = format!("blocks are nested more than {MAX_ATTRIBUTE_DEPTH} deep");
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
        let is_open = self.stack.len() > self.blocks_before_import;
        match is_open.then(|| self.stack.pop()).flatten() {
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
}

fn unknown_directive(name: &str, span: Range<usize>) -> Box<PbrtError> {
    let shown = escape_and_truncate(name, 32);
    if OLD_DIRECTIVES.contains(&name) {
        return PbrtError::new(span, format!("`{shown}` is a pbrt-v3 directive")).with_help(V3_HELP);
    }
    let error = PbrtError::new(span, format!("unknown directive `{shown}`"));
    error.with_suggestion(nearest_name(name, DIRECTIVES))
}

/// Skips to the next directive. Returns whether there is one.
fn skip_to_directive(lexer: &mut Lexer<'_>) -> bool {
    let is_directive = |token: &Token<'_>| {
        token.kind == TokenKind::Word && token.text.starts_with(|c: char| c.is_ascii_uppercase())
    };
    loop {
        match lexer.peek() {
            Ok(Some(token)) if is_directive(&token) => return true,
            Ok(Some(_)) => {}
            Ok(None) | Err(_) => return false,
        }
        if lexer.next().is_err() {
            return false;
        }
    }
}

/// Reads the next token of a statement. Returns an error at the end of the file.
fn expect_token<'a>(directive: &Token<'_>, lexer: &mut Lexer<'a>) -> PbrtResult<Token<'a>> {
    let missing = || {
        let message =
            format!("the file ends in the middle of `{}`", escape_and_truncate(&directive.text, 32));
        PbrtError::new(directive.span.clone(), message)
    };
    lexer.next()?.ok_or_else(missing)
}

/// Reads a quoted string.
fn quoted(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<Text> {
    let token = expect_token(directive, lexer)?;
    if token.kind != TokenKind::Quoted {
        let name = escape_and_truncate(&directive.text, 32);
        let error = PbrtError::new(token.span, format!("`{name}` needs a string in double quotes"));
        return Err(error.with_label(format!("found {}", escape_and_truncate(&token.text, 32))));
    }
    Ok(Text { text: token.text.into_owned(), span: token.span })
}
