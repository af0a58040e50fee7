//! Table rows: scenes, reference scenes and bounds.

/// A scene file and the files it refers to.
#[derive(Clone)]
pub(crate) struct SceneFiles {
    pub(crate) scene: String,
    pub(crate) files: Vec<(&'static str, String)>,
    /// Command-line options.
    pub(crate) options: &'static str,
}

impl SceneFiles {
    pub(crate) fn new(scene: String) -> Self {
        Self { scene, files: Vec::new(), options: "" }
    }

    pub(crate) fn with(mut self, name: &'static str, content: String) -> Self {
        self.files.push((name, content));
        self
    }

    pub(crate) fn with_options(mut self, options: &'static str) -> Self {
        self.options = options;
        self
    }
}

/// How to compare a row's images.
#[derive(Clone, Copy)]
pub(crate) enum RowMeasure {
    /// √(Σ(t·a − b)²/Σb²), where a is the image, b the reference and t this factor.
    Difference(f64),
    /// Relative deviation of the image's mean from the expected value.
    Mean(f64),
}

/// A table row: scenes with their references. The worst pair counts.
pub(crate) struct StressRow {
    pub(crate) name: String,
    pub(crate) pairs: Vec<(SceneFiles, SceneFiles)>,
    pub(crate) figure: RowMeasure,
    pub(crate) bound: f64,
    /// Whether the case requires as much work as the reference and may therefore take at most three times as
    /// long.
    pub(crate) is_timed: bool,
}

impl StressRow {
    /// A row whose images must match their references.
    pub(crate) fn matching(
        name: impl Into<String>,
        pairs: Vec<(SceneFiles, SceneFiles)>,
        bound: f64,
    ) -> Self {
        Self { name: name.into(), pairs, figure: RowMeasure::Difference(1.0), bound, is_timed: false }
    }

    /// A row for an image with a known mean.
    pub(crate) fn mean(
        name: impl Into<String>,
        pair: (SceneFiles, SceneFiles),
        mean: f64,
        bound: f64,
    ) -> Self {
        Self { name: name.into(), pairs: vec![pair], figure: RowMeasure::Mean(mean), bound, is_timed: false }
    }

    /// Also compares the times. The reference must require as much work.
    pub(crate) fn timed(self) -> Self {
        Self { is_timed: true, ..self }
    }
}

/// Which cases to run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum CaseSet {
    /// The cases that the test suite runs.
    Short,
    /// All cases.
    Long,
}
