//! The parameters of a statement: `"type name" [values]`.

use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::rc::Rc;

use super::lexer::{Lexer, PbrtError, PbrtResult, Token, TokenKind};
use super::values::parse_values;
use crate::math::{DVec2, DVec3};
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

pub(super) use super::values::{Text, Values};

/// Types of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ParameterType {
    Float,
    Integer,
    Bool,
    String,
    Texture,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    Rgb,
    Spectrum,
    Blackbody,
}

const TYPES: [(&str, ParameterType); 13] = [
    ("float", ParameterType::Float),
    ("integer", ParameterType::Integer),
    ("bool", ParameterType::Bool),
    ("string", ParameterType::String),
    ("texture", ParameterType::Texture),
    ("point2", ParameterType::Point2),
    ("vector2", ParameterType::Vector2),
    ("point3", ParameterType::Point3),
    ("vector3", ParameterType::Vector3),
    ("normal", ParameterType::Normal),
    ("rgb", ParameterType::Rgb),
    ("spectrum", ParameterType::Spectrum),
    ("blackbody", ParameterType::Blackbody),
];

/// Types that exist only in pbrt-v3.
const OLD_TYPES: [&str; 5] = ["color", "xyz", "point", "vector", "normal3"];

impl ParameterType {
    fn name(self) -> &'static str {
        TYPES.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }
}

/// A parameter.
#[derive(Debug)]
pub(super) struct Parameter {
    pub(super) kind: ParameterType,
    pub(super) name: String,
    /// Span of the declaration.
    pub(super) span: Range<usize>,
    /// Span of the values.
    pub(super) values_span: Range<usize>,
    pub(super) values: Values,
    /// Whether the parameter is a default from an `Attribute` statement, which may remain unused.
    is_default: bool,
    is_used: Cell<bool>,
}

/// Maximum number of parameters in a statement.
const MAX_PARAMETERS: usize = 1000;

/// The parameters of a statement.
#[derive(Clone, Debug, Default)]
pub(super) struct Parameters {
    list: Vec<Rc<Parameter>>,
    /// Span of the statement's directive and type.
    pub(super) span: Range<usize>,
    /// Names that have been looked up.
    asked: RefCell<Vec<&'static str>>,
}

impl Parameters {
    /// Parses the parameters of a statement. `span` is the span of its directive and type.
    pub(super) fn parse(lexer: &mut Lexer<'_>, span: Range<usize>) -> PbrtResult<Self> {
        let mut parsed = Self { span, ..Self::default() };
        while let Some(token) = lexer.peek()?.filter(|token| token.kind == TokenKind::Quoted) {
            lexer.next()?;
            let parameter = parse_parameter(&token, lexer)?;
            if parsed.list.iter().any(|known| known.name == parameter.name) {
                let message =
                    format!("the parameter `{}` appears twice", escape_and_truncate_name(&parameter.name));
                return Err(PbrtError::new(parameter.span, message).with_help("remove one of them"));
            }
            if parsed.list.len() >= MAX_PARAMETERS {
                let message = format!("a statement can have at most {MAX_PARAMETERS} parameters");
                return Err(PbrtError::new(parameter.span, message));
            }
            parsed.list.push(Rc::new(parameter));
        }
        Ok(parsed)
    }

    /// Adds the defaults from `Attribute` statements for absent parameters. Later defaults take precedence.
    pub(super) fn add_defaults(&mut self, defaults: &[Rc<Parameter>]) {
        for default in defaults.iter().rev() {
            if !self.list.iter().any(|known| known.name == default.name) {
                self.list.push(Rc::clone(default));
            }
        }
    }

    /// Converts the parameters of an `Attribute` statement to defaults.
    pub(super) fn into_defaults(self) -> impl Iterator<Item = Rc<Parameter>> {
        self.list.into_iter().filter_map(|parameter| {
            let parameter = Rc::into_inner(parameter)?;
            Some(Rc::new(Parameter { is_default: true, ..parameter }))
        })
    }

    /// Returns a parameter of any type, and marks it as used.
    pub(super) fn find(&self, name: &'static str) -> Option<&Parameter> {
        self.asked.borrow_mut().push(name);
        let found = self.list.iter().find(|parameter| parameter.name == name)?;
        found.is_used.set(true);
        Some(found)
    }

    /// Marks parameters as used that glimt does not need.
    pub(super) fn ignore(&self, names: &[&'static str]) {
        for name in names {
            self.find(name);
        }
    }

    /// Returns a parameter, or an error unless it has one of the types.
    fn find_with_type(&self, name: &'static str, kinds: &[ParameterType]) -> PbrtResult<Option<&Parameter>> {
        let Some(found) = self.find(name) else { return Ok(None) };
        if kinds.contains(&found.kind) {
            return Ok(Some(found));
        }
        let names: Vec<_> = kinds.iter().map(|kind| kind.name()).collect();
        let message = format!("`{name}` must have the type {}", names.join(" or "));
        Err(PbrtError::new(found.span.clone(), message).with_label(format!("found {}", found.kind.name())))
    }

    /// Reads the numbers of a parameter, or returns an error unless their number is a multiple of `count`.
    fn numbers(&self, name: &'static str, kinds: &[ParameterType], count: usize) -> PbrtResult<&[f64]> {
        let Some(found) = self.find_with_type(name, kinds)? else { return Ok(&[]) };
        let numbers = found.numbers()?;
        if !numbers.len().is_multiple_of(count) {
            let message = format!("`{name}` must have groups of {count} numbers, but has {}", numbers.len());
            return Err(PbrtError::new(found.values_span.clone(), message));
        }
        Ok(numbers)
    }

    pub(super) fn floats(&self, name: &'static str) -> PbrtResult<&[f64]> {
        self.numbers(name, &[ParameterType::Float], 1)
    }

    pub(super) fn float(&self, name: &'static str, default: f64) -> PbrtResult<f64> {
        Ok(self.optional_float(name)?.unwrap_or(default))
    }

    pub(super) fn optional_float(&self, name: &'static str) -> PbrtResult<Option<f64>> {
        let Some(found) = self.find_with_type(name, &[ParameterType::Float])? else { return Ok(None) };
        found.single(found.numbers()?).map(|number| Some(*number))
    }

    /// Reads a number, or returns an error unless it is greater than 0.
    pub(super) fn positive_float(&self, name: &'static str, default: f64) -> PbrtResult<f64> {
        let number = self.float(name, default)?;
        match self.find(name) {
            Some(found) if number <= 0.0 => {
                Err(PbrtError::new(found.values_span.clone(), format!("`{name}` must be greater than 0")))
            }
            Some(_) | None => Ok(number),
        }
    }

    pub(super) fn integers(&self, name: &'static str) -> PbrtResult<Vec<i64>> {
        let Some(found) = self.find_with_type(name, &[ParameterType::Integer])? else {
            return Ok(Vec::new());
        };
        let whole = |number: &f64| {
            let is_whole = number.fract() == 0.0 && number.abs() <= f64::from(i32::MAX);
            is_whole.then_some(*number as i64).ok_or_else(|| {
                PbrtError::new(found.values_span.clone(), format!("`{name}` must be integers"))
            })
        };
        found.numbers()?.iter().map(whole).collect()
    }

    /// Reads an integer, or returns an error if it is out of range.
    pub(super) fn integer(
        &self,
        name: &'static str,
        default: i64,
        range: std::ops::RangeInclusive<i64>,
    ) -> PbrtResult<i64> {
        let numbers = self.integers(name)?;
        let Some(found) = self.find(name) else { return Ok(default) };
        let number = *found.single(&numbers)?;
        if range.contains(&number) {
            return Ok(number);
        }
        let message = format!("`{name}` must be between {} and {}", range.start(), range.end());
        Err(PbrtError::new(found.values_span.clone(), message))
    }

    pub(super) fn bool(&self, name: &'static str, default: bool) -> PbrtResult<bool> {
        let Some(found) = self.find_with_type(name, &[ParameterType::Bool])? else { return Ok(default) };
        match &found.values {
            Values::Flags(flags) => found.single(flags).copied(),
            Values::Texts(_) | Values::Numbers(_) => {
                let message = format!("`{name}` must be true or false");
                Err(PbrtError::new(found.values_span.clone(), message))
            }
        }
    }

    /// Reads a string. Treats empty strings as absent.
    pub(super) fn string(&self, name: &'static str) -> PbrtResult<Option<&Text>> {
        let Some(found) = self.find_with_type(name, &[ParameterType::String])? else { return Ok(None) };
        found.single(found.texts()?).map(|text| Some(text).filter(|text| !text.text.is_empty()))
    }

    pub(super) fn strings(&self, name: &'static str) -> PbrtResult<&[Text]> {
        let Some(found) = self.find_with_type(name, &[ParameterType::String])? else { return Ok(&[]) };
        found.texts()
    }

    pub(super) fn point2s(&self, name: &'static str) -> PbrtResult<Vec<DVec2>> {
        let numbers = self.numbers(name, &[ParameterType::Point2, ParameterType::Float], 2)?;
        Ok(numbers.as_chunks().0.iter().map(|&pair| DVec2::from_array(pair)).collect())
    }

    pub(super) fn point3s(&self, name: &'static str) -> PbrtResult<Vec<DVec3>> {
        self.triples(name, ParameterType::Point3)
    }

    pub(super) fn normals(&self, name: &'static str) -> PbrtResult<Vec<DVec3>> {
        self.triples(name, ParameterType::Normal)
    }

    fn triples(&self, name: &'static str, kind: ParameterType) -> PbrtResult<Vec<DVec3>> {
        let numbers = self.numbers(name, &[kind], 3)?;
        Ok(numbers.as_chunks().0.iter().map(|&triple| DVec3::from_array(triple)).collect())
    }

    /// Reads one point or vector.
    pub(super) fn triple(
        &self,
        name: &'static str,
        kind: ParameterType,
        default: DVec3,
    ) -> PbrtResult<DVec3> {
        let all = self.triples(name, kind)?;
        let Some(found) = self.find(name) else { return Ok(default) };
        found.single(&all).copied()
    }

    /// Span of a parameter's values, or of the statement if the parameter is absent.
    pub(super) fn span_of(&self, name: &'static str) -> Range<usize> {
        self.find(name).map_or_else(|| self.span.clone(), |found| found.values_span.clone())
    }

    /// Returns an error if the statement has an unknown parameter, that is, one that was never looked up.
    pub(super) fn check_all_used(&self) -> PbrtResult<()> {
        let is_wrong = |parameter: &&Rc<Parameter>| !parameter.is_default && !parameter.is_used.get();
        let Some(wrong) = self.list.iter().find(is_wrong) else { return Ok(()) };
        wrong.is_used.set(true);
        let message = format!("unknown parameter `{}`", escape_and_truncate_name(&wrong.name));
        let near = nearest_name(&wrong.name, self.asked.borrow().iter().copied());
        Err(PbrtError::new(wrong.span.clone(), message).with_suggestion(near))
    }
}

impl Parameter {
    /// The values as numbers.
    pub(super) fn numbers(&self) -> PbrtResult<&[f64]> {
        match &self.values {
            Values::Numbers(numbers) => Ok(numbers),
            Values::Texts(_) | Values::Flags(_) => {
                let message = format!("`{}` must be numbers", escape_and_truncate_name(&self.name));
                Err(PbrtError::new(self.values_span.clone(), message))
            }
        }
    }

    /// The values as strings.
    pub(super) fn texts(&self) -> PbrtResult<&[Text]> {
        match &self.values {
            Values::Texts(texts) => Ok(texts),
            Values::Numbers(_) | Values::Flags(_) => {
                let message = format!("`{}` must be in quotes", escape_and_truncate_name(&self.name));
                Err(PbrtError::new(self.values_span.clone(), message))
            }
        }
    }

    /// Returns the only element of `values`, or an error unless there is exactly one.
    pub(super) fn single<'a, T>(&self, values: &'a [T]) -> PbrtResult<&'a T> {
        match values {
            [one] => Ok(one),
            _ => {
                let message = format!(
                    "`{}` must have one value, but has {}",
                    escape_and_truncate_name(&self.name),
                    values.len()
                );
                Err(PbrtError::new(self.values_span.clone(), message))
            }
        }
    }
}

fn escape_and_truncate_name(name: &str) -> String {
    escape_and_truncate(name, 40)
}

fn parse_parameter(declaration: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<Parameter> {
    let span = declaration.span.clone();
    let mut words = declaration.text.split([' ', '\t']).filter(|word| !word.is_empty());
    let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
        let error = PbrtError::new(span, "a parameter needs a type and a name");
        return Err(error.with_help("for example, \"float radius\""));
    };
    let Some((_, kind)) = TYPES.iter().find(|(known, _)| *known == kind) else {
        return Err(unknown_type(kind, span));
    };
    let (values, values_span) = parse_values(&span, lexer)?;
    let (is_default, is_used) = (false, Cell::new(false));
    Ok(Parameter { kind: *kind, name: name.to_owned(), span, values_span, values, is_default, is_used })
}

fn unknown_type(kind: &str, span: Range<usize>) -> Box<PbrtError> {
    let error = PbrtError::new(span, format!("unknown parameter type `{}`", escape_and_truncate_name(kind)));
    if OLD_TYPES.contains(&kind) {
        return error.with_label("this is a pbrt-v3 type").with_help(V3_HELP);
    }
    error.with_suggestion(nearest_name(kind, TYPES.iter().map(|(name, _)| *name)))
}

/// Help for pbrt-v3 features.
pub(super) const V3_HELP: &str =
    "glimt reads pbrt-v4 scenes; `pbrt --upgrade OLD.pbrt > NEW.pbrt` (of pbrt-v4) converts older ones";

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> PbrtResult<Parameters> {
        Parameters::parse(&mut Lexer::new(text, 0), 0..0)
    }

    #[test]
    fn brackets_around_single_values_are_optional() {
        let parsed =
            parse("\"float fov\" 30 \"bool b\" true \"string s\" [ \"x\" ] \"point3 P\" [0 1 2 # c\n 3 4 5]");
        let parsed = parsed.expect("parameters");
        assert_eq!(parsed.float("fov", 1.0), Ok(30.0));
        assert_eq!(parsed.bool("b", false), Ok(true));
        assert_eq!(
            parsed.string("s").map(|text| text.map(|text| text.text.clone())),
            Ok(Some("x".to_owned()))
        );
        assert_eq!(parsed.point3s("P"), Ok(vec![DVec3::new(0.0, 1.0, 2.0), DVec3::new(3.0, 4.0, 5.0)]));
        assert_eq!(parsed.check_all_used(), Ok(()));
    }

    #[test]
    fn invalid_parameters_are_underlined() {
        let place = |text: &str| {
            let error = parse(text).expect_err("an error");
            (text[error.span.clone()].to_owned(), error.message)
        };
        for (text, underlined) in [
            ("\"float\" 1", "\"float\""),
            ("\"flaot x\" 1", "\"flaot x\""),
            ("\"float x\" [1 \"a\"]", "\"a\""),
            ("\"float x\" [1 2", "["),
            ("\"float x\" 1e999", "1e999"),
            ("\"float x\" nan", "nan"),
            ("\"float x\" 1 \"float x\" 2", "\"float x\""),
            ("\"float x\" ]", "]"),
            ("\"float x\" [[1]]", "["),
        ] {
            assert_eq!(place(text).0, underlined, "{text}: {}", place(text).1);
        }
    }

    #[test]
    fn unknown_parameters_get_suggestions() {
        let parsed = parse("\"float raduis\" 2").expect("parameters");
        assert_eq!(parsed.float("radius", 1.0), Ok(1.0));
        let error = parsed.check_all_used().expect_err("an error");
        assert_eq!((error.span, error.label.as_str()), (0..14, "did you mean `radius`?"));
        let parsed = parse("\"integer radius\" 2").expect("parameters");
        assert_eq!(parsed.float("radius", 1.0).expect_err("an error").label, "found integer");
    }

    #[test]
    fn own_parameters_override_defaults() {
        let (mut own, defaults) =
            (parse("\"float a\" 1"), parse("\"float a\" 2 \"float b\" 3 \"float c\" 4"));
        let defaults: Vec<_> = defaults.expect("parameters").into_defaults().collect();
        let own = own.as_mut().expect("parameters");
        own.add_defaults(&defaults);
        assert_eq!(
            (own.float("a", 0.0), own.float("b", 0.0), own.check_all_used()),
            (Ok(1.0), Ok(3.0), Ok(()))
        );
    }

    #[test]
    fn pbrt_v3_types_are_explained() {
        let error = parse("\"color Kd\" [1 1 1]").expect_err("an error");
        assert!(error.label.contains("pbrt-v3") && error.help.is_some());
    }
}
