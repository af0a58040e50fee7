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
    ScrollUp,
    ScrollDown,
    ToggleHelp,
    Close,
    Redraw,
    Suspend,
    Interrupt,
    Quit,
}
