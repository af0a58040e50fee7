//! Frame pacing: decides which previews are worth drawing.

use std::time::{Duration, Instant};

use super::fidelity::PreviewFidelity;

/// Inputs for deciding whether to draw a new preview.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PacingInputs {
    /// Connection bandwidth, or `None` if it is too fast to measure.
    pub bytes_per_second: Option<f64>,
    /// Number of cells in the preview.
    pub cells: u32,
    /// Mean samples per pixel in the new preview. 0 for a coarse preview.
    pub samples: f64,
    /// Mean samples per pixel in this request's last drawn preview, or `None` if no preview has been drawn.
    pub aimed_samples: Option<f64>,
    /// Time since the last drawn preview became the target.
    pub since_aim: Duration,
    /// Whether the last drawn preview has been sent and, on a fast terminal, acknowledged.
    pub is_shown: bool,
    /// Whether the terminal is fast enough to follow the render.
    pub is_fast: bool,
    /// Whether the preview is drawn as pixels.
    pub is_in_pixels: bool,
    /// Whether the preview is final.
    pub is_final: bool,
    /// Estimated time until the final preview is ready, if known.
    pub final_in: Option<Duration>,
}

/// What to do with a preview.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacingDecision {
    /// Draw the preview with this precision.
    Aim(PreviewFidelity),
    /// Wait for a better preview.
    Wait,
}

/// Approximate bytes per cell for an intermediate preview.
const MOVING_BYTES: f64 = 6.0;
/// Minimum ratio between the sample counts of successive previews. Noise decreases with the square root of
/// the sample count.
const MORE_SAMPLES: f64 = 2.0;
/// Minimum ratio between sample counts while the previous preview is still being sent.
const MANY_MORE_SAMPLES: f64 = 4.0;
/// During the first pass, the preview is redrawn each time this fraction of a sample per pixel has been
/// added.
const FIRST_PASS: f64 = 0.25;
/// Minimum time between previews, except before the first and last.
const MIN_INTERVAL: Duration = Duration::from_millis(100);
/// Minimum time between previews drawn as pixels, which take longer to encode and decode.
const MIN_PIXEL_INTERVAL: Duration = Duration::from_millis(180);
/// Time after which any improvement is drawn.
const MAX_INTERVAL: Duration = Duration::from_secs(2);
/// Fraction of the bandwidth available for intermediate previews.
const PREVIEW_BANDWIDTH: f64 = 0.5;

/// Decides whether a preview is worth its cost. The first and last previews always are. A fast terminal gets
/// 5 to 10 previews per second. A slow connection gets few intermediate previews, and none that would delay
/// the last one.
pub fn preview_pacing_decision(moment: &PacingInputs) -> PacingDecision {
    if moment.is_final {
        return PacingDecision::Aim(PreviewFidelity::Still);
    }
    let Some(aimed) = moment.aimed_samples else { return PacingDecision::Aim(PreviewFidelity::First) };
    if moment.is_fast {
        let is_due = moment.is_shown && moment.since_aim >= moment.shortest_preview_interval();
        return if is_due { PacingDecision::Aim(PreviewFidelity::Following) } else { PacingDecision::Wait };
    }
    let frame = moment.estimate_send_duration();
    let is_too_late = moment.final_in.is_some_and(|left| left < frame);
    let is_too_soon = moment.since_aim < MIN_INTERVAL.max(frame.div_f64(PREVIEW_BANDWIDTH));
    if is_too_late || is_too_soon {
        return PacingDecision::Wait;
    }
    let is_better = |factor: f64| moment.samples >= (aimed * factor).max(1.0) && moment.samples > aimed;
    let is_worth_it = if moment.is_shown {
        is_better(MORE_SAMPLES)
            || (moment.samples < 1.0 && moment.samples >= aimed + FIRST_PASS)
            || (moment.samples > aimed && moment.since_aim >= MAX_INTERVAL)
    } else {
        is_better(MANY_MORE_SAMPLES)
    };
    if is_worth_it { PacingDecision::Aim(PreviewFidelity::Moving) } else { PacingDecision::Wait }
}

impl PacingInputs {
    /// Minimum time between previews on a fast terminal.
    fn shortest_preview_interval(&self) -> Duration {
        if self.is_in_pixels { MIN_PIXEL_INTERVAL } else { MIN_INTERVAL }
    }

    /// Time when a fast terminal should get the next preview, if one is pending.
    pub fn next_due_time(&self, aimed: Instant) -> Option<Instant> {
        (self.is_fast && self.is_shown).then(|| aimed + self.shortest_preview_interval())
    }

    /// Returns the time needed to send an intermediate preview.
    fn estimate_send_duration(&self) -> Duration {
        let bytes = f64::from(self.cells) * MOVING_BYTES;
        self.bytes_per_second.map_or(Duration::ZERO, |rate| {
            Duration::try_from_secs_f64(bytes / rate.max(1.0))
                .unwrap_or(Duration::MAX)
                .min(Duration::from_secs(3600))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inputs one second after a preview with one sample per pixel was drawn.
    const MOMENT: PacingInputs = PacingInputs {
        bytes_per_second: None,
        cells: 2500,
        samples: 1.5,
        aimed_samples: Some(1.0),
        since_aim: Duration::from_secs(1),
        is_shown: true,
        is_fast: false,
        is_in_pixels: false,
        is_final: false,
        final_in: None,
    };

    const MOVING: PacingDecision = PacingDecision::Aim(PreviewFidelity::Moving);

    #[test]
    fn first_and_last_previews_are_always_drawn() {
        for bytes_per_second in [None, Some(0.0), Some(100.0), Some(f64::NAN)] {
            let slow =
                PacingInputs { bytes_per_second, since_aim: Duration::ZERO, is_shown: false, ..MOMENT };
            assert_eq!(
                preview_pacing_decision(&PacingInputs { aimed_samples: None, ..slow }),
                PacingDecision::Aim(PreviewFidelity::First)
            );
            assert_eq!(
                preview_pacing_decision(&PacingInputs { is_final: true, ..slow }),
                PacingDecision::Aim(PreviewFidelity::Still)
            );
        }
    }

    #[test]
    fn intermediate_previews_double_the_samples() {
        assert_eq!(preview_pacing_decision(&MOMENT), PacingDecision::Wait);
        assert_eq!(preview_pacing_decision(&PacingInputs { samples: 2.0, ..MOMENT }), MOVING);
        let late = PacingInputs { since_aim: Duration::from_secs(3), ..MOMENT };
        assert_eq!(preview_pacing_decision(&late), MOVING, "after a long time, any progress is drawn");
        assert_eq!(
            preview_pacing_decision(&PacingInputs { samples: 1.0, ..late }),
            PacingDecision::Wait,
            "an unchanged preview is not redrawn"
        );
    }

    #[test]
    fn fast_terminals_get_5_to_10_previews_per_second() {
        let following = PacingDecision::Aim(PreviewFidelity::Following);
        let quick = PacingInputs { is_fast: true, since_aim: Duration::from_millis(100), ..MOMENT };
        assert_eq!(
            preview_pacing_decision(&quick),
            following,
            "drawn regardless of the number of new samples"
        );
        assert_eq!(
            preview_pacing_decision(&PacingInputs { samples: 0.5, ..quick }),
            following,
            "drawn even if the sample count is lower"
        );
        assert_eq!(
            preview_pacing_decision(&PacingInputs { since_aim: Duration::from_millis(99), ..quick }),
            PacingDecision::Wait
        );
        assert_eq!(
            preview_pacing_decision(&PacingInputs { is_shown: false, ..quick }),
            PacingDecision::Wait,
            "not drawn before the previous preview has been shown"
        );
        let in_pixels = PacingInputs { is_in_pixels: true, ..quick };
        assert_eq!(preview_pacing_decision(&in_pixels), PacingDecision::Wait);
        assert_eq!(
            preview_pacing_decision(&PacingInputs { since_aim: Duration::from_millis(200), ..in_pixels }),
            following
        );
    }

    #[test]
    fn first_pass_is_drawn_in_steps() {
        let coarse = PacingInputs { samples: 0.1, aimed_samples: Some(0.0), ..MOMENT };
        assert_eq!(preview_pacing_decision(&coarse), PacingDecision::Wait);
        assert_eq!(preview_pacing_decision(&PacingInputs { samples: 0.25, ..coarse }), MOVING);
        assert_eq!(
            preview_pacing_decision(&PacingInputs { samples: 1.0, aimed_samples: Some(0.5), ..coarse }),
            MOVING
        );
    }

    #[test]
    fn slow_connections_get_few_previews() {
        // 15 kB take a quarter of a second at 60 kB/s.
        let thin = PacingInputs { bytes_per_second: Some(60e3), samples: 2.0, ..MOMENT };
        assert_eq!(preview_pacing_decision(&thin), MOVING);
        assert_eq!(
            preview_pacing_decision(&PacingInputs { since_aim: Duration::from_millis(400), ..thin }),
            PacingDecision::Wait
        );
        assert_eq!(
            preview_pacing_decision(&PacingInputs { is_shown: false, ..thin }),
            PacingDecision::Wait,
            "the previous preview is still being sent"
        );
        assert_eq!(
            preview_pacing_decision(&PacingInputs { is_shown: false, samples: 4.0, ..thin }),
            MOVING,
            "the previous preview is much worse"
        );
        let ending = PacingInputs { final_in: Some(Duration::from_millis(200)), ..thin };
        assert_eq!(
            preview_pacing_decision(&ending),
            PacingDecision::Wait,
            "it would delay the final preview"
        );
    }

    #[test]
    fn short_render_draws_few_previews() {
        for (bytes_per_second, most) in [(None, 12), (Some(125e3), 8), (Some(10e3), 2)] {
            let (mut aimed, mut at, mut count) = (None, 0.0, 0);
            // 2.5 seconds, with a preview every 66 ms.
            for preview in 0..38_u32 {
                let seconds = f64::from(preview) * 0.066;
                let moment = PacingInputs {
                    bytes_per_second,
                    samples: seconds / 2.5 * 64.0,
                    aimed_samples: aimed,
                    since_aim: Duration::from_secs_f64(seconds - at),
                    ..MOMENT
                };
                if preview_pacing_decision(&moment) != PacingDecision::Wait {
                    (aimed, at, count) = (Some(moment.samples), seconds, count + 1);
                }
            }
            assert!(count <= most && count >= 1, "{bytes_per_second:?}: {count}");
        }
    }
}
