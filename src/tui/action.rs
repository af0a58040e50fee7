//! What a key can mean.

/// One thing that a person can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    CycleShadows,
    ToggleDepthOfField,
    TogglePhotons,
    CycleIntegrator,
    NextView,
    PreviousView,
    TogglePause,
    RenderAgain,
    WriteNow,
    SceneSettings,
    ToggleDiagnostics,
    ToggleHelp,
    PictureAlone,
    Redraw,
    Suspend,
    Interrupt,
    Quit,
}
