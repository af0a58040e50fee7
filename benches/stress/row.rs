//! What is rendered and what it is held against.

/// A scene file and the files that it names.
#[derive(Clone)]
pub(crate) struct Picture {
    pub(crate) scene: String,
    pub(crate) files: Vec<(&'static str, String)>,
    /// Options of the program.
    pub(crate) options: &'static str,
}

impl Picture {
    pub(crate) fn new(scene: String) -> Self {
        Self { scene, files: Vec::new(), options: "" }
    }

    pub(crate) fn with(mut self, name: &'static str, content: String) -> Self {
        self.files.push((name, content));
        self
    }

    pub(crate) fn by(mut self, options: &'static str) -> Self {
        self.options = options;
        self
    }
}

/// What a row measures.
#[derive(Clone, Copy)]
pub(crate) enum Figure {
    /// √(Σ(t·a − b)²/Σb²) of the picture a and its twin b, t given.
    Difference(f64),
    /// How far the mean of the picture is from the right answer, relative to that.
    Mean(f64),
}

/// A row of the table: pictures with their twins; the worst of them counts.
pub(crate) struct Row {
    pub(crate) name: String,
    pub(crate) pairs: Vec<(Picture, Picture)>,
    pub(crate) figure: Figure,
    pub(crate) bound: f64,
    /// Whether the twin is as much work, so that no more than three times its time may be taken.
    pub(crate) is_timed: bool,
}

impl Row {
    /// Pictures that are to look like their twins.
    pub(crate) fn alike(name: impl Into<String>, pairs: Vec<(Picture, Picture)>, bound: f64) -> Self {
        Self { name: name.into(), pairs, figure: Figure::Difference(1.0), bound, is_timed: false }
    }

    /// A picture whose mean is known.
    pub(crate) fn mean(name: impl Into<String>, pair: (Picture, Picture), mean: f64, bound: f64) -> Self {
        Self { name: name.into(), pairs: vec![pair], figure: Figure::Mean(mean), bound, is_timed: false }
    }

    /// The twin is as much work.
    pub(crate) fn timed(self) -> Self {
        Self { is_timed: true, ..self }
    }
}

/// How many of the cases.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// For every run of the tests.
    Short,
    /// All.
    Long,
}
