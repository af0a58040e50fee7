//! Rows of the table: pictures, their twins, and bounds.

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

/// Measure of a row.
#[derive(Clone, Copy)]
pub(crate) enum Figure {
    /// √(Σ(t·a − b)²/Σb²) of the picture a and its twin b, t given.
    Difference(f64),
    /// Deviation of the picture's mean from the right answer, relative to it.
    Mean(f64),
}

/// A row of the table: pictures with their twins; the worst of them counts.
pub(crate) struct Row {
    pub(crate) name: String,
    pub(crate) pairs: Vec<(Picture, Picture)>,
    pub(crate) figure: Figure,
    pub(crate) bound: f64,
    /// Whether the case is as much work as its twin, so that it may take at most three times its time.
    pub(crate) is_timed: bool,
}

impl Row {
    /// A row of pictures that must look like their twins.
    pub(crate) fn alike(name: impl Into<String>, pairs: Vec<(Picture, Picture)>, bound: f64) -> Self {
        Self { name: name.into(), pairs, figure: Figure::Difference(1.0), bound, is_timed: false }
    }

    /// A row for a picture whose mean is known.
    pub(crate) fn mean(name: impl Into<String>, pair: (Picture, Picture), mean: f64, bound: f64) -> Self {
        Self { name: name.into(), pairs: vec![pair], figure: Figure::Mean(mean), bound, is_timed: false }
    }

    /// The row with its time compared: the twin is as much work.
    pub(crate) fn timed(self) -> Self {
        Self { is_timed: true, ..self }
    }
}

/// Extent of the cases.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// The cases for every run of the tests.
    Short,
    /// All cases.
    Long,
}
