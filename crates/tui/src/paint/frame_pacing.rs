//! Choice of the pictures that are worth drawing.

use std::time::{Duration, Instant};

use super::fidelity::Fidelity;

/// The moment at which there is a picture that was not aimed at yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTiming {
    /// Bytes per second of the line. `None` if it is faster than anybody noticed.
    pub bytes_per_second: Option<f64>,
    /// Cells of the picture.
    pub cells: u32,
    /// Mean samples per pixel of the current picture; 0 for a coarse picture.
    pub samples: f64,
    /// Mean samples per pixel of this request's last picture that was aimed at. `None` if there was none.
    pub aimed_samples: Option<f64>,
    /// Since then.
    pub since_aim: Duration,
    /// Whether that picture is on the screen: sent, and, where the terminal is quick, answered for.
    pub is_shown: bool,
    /// Whether the terminal takes bytes so fast that it can follow the render.
    pub is_quick: bool,
    /// Whether the picture is drawn in pixels.
    pub is_in_pixels: bool,
    /// Whether the picture stays.
    pub is_final: bool,
    /// Time to the final picture, if known.
    pub final_in: Option<Duration>,
}

/// Advice about a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacingAdvice {
    /// Aim at it.
    Aim(Fidelity),
    /// Wait for a better one.
    Wait,
}

/// Bytes that a cell takes until it is as it stays, about.
const MOVING_BYTES: f64 = 6.0;
/// At least so many times the samples of the picture before: the noise falls by the root of that.
const MORE_SAMPLES: f64 = 2.0;
/// The same while the picture before is still on its way.
const MANY_MORE_SAMPLES: f64 = 4.0;
/// While pixels get their first sample, a picture that has so many more of them is worth being drawn.
const FIRST_PASS: f64 = 0.25;
/// Pictures come no faster than this, but for the first and the last one.
const SHORTEST: Duration = Duration::from_millis(100);
/// The same of pictures in pixels, which take time to be encoded and decoded.
const SHORTEST_IN_PIXELS: Duration = Duration::from_millis(180);
/// After this any picture is better than one that stands still.
const LONGEST: Duration = Duration::from_secs(2);
/// Part of the line that pictures on the way may take.
const SHARE: f64 = 0.5;

/// Whether a picture is worth its bytes. The first and the last one always are. A quick terminal gets every picture, 5 to
/// 10 times a second. On a line that takes long for a picture there are few in between, and none that would keep the
/// last one waiting.
pub fn advise(moment: &FrameTiming) -> PacingAdvice {
    if moment.is_final {
        return PacingAdvice::Aim(Fidelity::Still);
    }
    let Some(aimed) = moment.aimed_samples else { return PacingAdvice::Aim(Fidelity::First) };
    if moment.is_quick {
        let is_due = moment.is_shown && moment.since_aim >= moment.shortest();
        return if is_due { PacingAdvice::Aim(Fidelity::Following) } else { PacingAdvice::Wait };
    }
    let frame = moment.frame();
    let is_too_late = moment.final_in.is_some_and(|left| left < frame);
    let is_too_soon = moment.since_aim < SHORTEST.max(frame.div_f64(SHARE));
    if is_too_late || is_too_soon {
        return PacingAdvice::Wait;
    }
    let is_better = |factor: f64| moment.samples >= (aimed * factor).max(1.0) && moment.samples > aimed;
    let is_worth_it = if moment.is_shown {
        is_better(MORE_SAMPLES)
            || (moment.samples < 1.0 && moment.samples >= aimed + FIRST_PASS)
            || (moment.samples > aimed && moment.since_aim >= LONGEST)
    } else {
        is_better(MANY_MORE_SAMPLES)
    };
    if is_worth_it { PacingAdvice::Aim(Fidelity::Moving) } else { PacingAdvice::Wait }
}

impl FrameTiming {
    /// The time between two pictures on a quick terminal.
    fn shortest(&self) -> Duration {
        if self.is_in_pixels { SHORTEST_IN_PIXELS } else { SHORTEST }
    }

    /// When a quick terminal is to get the next picture, if one waits.
    pub fn due(&self, aimed: Instant) -> Option<Instant> {
        (self.is_quick && self.is_shown).then(|| aimed + self.shortest())
    }

    /// Time of the line for a picture on the way.
    fn frame(&self) -> Duration {
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

    /// A second after an aim at one sample.
    const MOMENT: FrameTiming = FrameTiming {
        bytes_per_second: None,
        cells: 2500,
        samples: 1.5,
        aimed_samples: Some(1.0),
        since_aim: Duration::from_secs(1),
        is_shown: true,
        is_quick: false,
        is_in_pixels: false,
        is_final: false,
        final_in: None,
    };

    const MOVING: PacingAdvice = PacingAdvice::Aim(Fidelity::Moving);

    #[test]
    fn the_first_and_the_last_picture_are_drawn_whatever_the_line() {
        for bytes_per_second in [None, Some(0.0), Some(100.0), Some(f64::NAN)] {
            let slow = FrameTiming { bytes_per_second, since_aim: Duration::ZERO, is_shown: false, ..MOMENT };
            assert_eq!(
                advise(&FrameTiming { aimed_samples: None, ..slow }),
                PacingAdvice::Aim(Fidelity::First)
            );
            assert_eq!(advise(&FrameTiming { is_final: true, ..slow }), PacingAdvice::Aim(Fidelity::Still));
        }
    }

    #[test]
    fn a_picture_on_the_way_has_twice_the_samples() {
        assert_eq!(advise(&MOMENT), PacingAdvice::Wait);
        assert_eq!(advise(&FrameTiming { samples: 2.0, ..MOMENT }), MOVING);
        let late = FrameTiming { since_aim: Duration::from_secs(3), ..MOMENT };
        assert_eq!(advise(&late), MOVING, "or it is a while ago");
        assert_eq!(
            advise(&FrameTiming { samples: 1.0, ..late }),
            PacingAdvice::Wait,
            "but not the same one again"
        );
    }

    #[test]
    fn a_quick_terminal_gets_every_picture_5_to_10_times_a_second() {
        let following = PacingAdvice::Aim(Fidelity::Following);
        let quick = FrameTiming { is_quick: true, since_aim: Duration::from_millis(100), ..MOMENT };
        assert_eq!(advise(&quick), following, "however few samples are new");
        assert_eq!(
            advise(&FrameTiming { samples: 0.5, ..quick }),
            following,
            "their number may be told late"
        );
        assert_eq!(
            advise(&FrameTiming { since_aim: Duration::from_millis(99), ..quick }),
            PacingAdvice::Wait
        );
        assert_eq!(
            advise(&FrameTiming { is_shown: false, ..quick }),
            PacingAdvice::Wait,
            "one after the other"
        );
        let in_pixels = FrameTiming { is_in_pixels: true, ..quick };
        assert_eq!(advise(&in_pixels), PacingAdvice::Wait);
        assert_eq!(advise(&FrameTiming { since_aim: Duration::from_millis(200), ..in_pixels }), following);
    }

    #[test]
    fn the_first_pass_is_shown_in_parts() {
        let coarse = FrameTiming { samples: 0.1, aimed_samples: Some(0.0), ..MOMENT };
        assert_eq!(advise(&coarse), PacingAdvice::Wait);
        assert_eq!(advise(&FrameTiming { samples: 0.25, ..coarse }), MOVING);
        assert_eq!(advise(&FrameTiming { samples: 1.0, aimed_samples: Some(0.5), ..coarse }), MOVING);
    }

    #[test]
    fn on_a_thin_line_pictures_are_few() {
        // 15 kB: a quarter of a second at 60 kB/s.
        let thin = FrameTiming { bytes_per_second: Some(60e3), samples: 2.0, ..MOMENT };
        assert_eq!(advise(&thin), MOVING);
        assert_eq!(
            advise(&FrameTiming { since_aim: Duration::from_millis(400), ..thin }),
            PacingAdvice::Wait
        );
        assert_eq!(
            advise(&FrameTiming { is_shown: false, ..thin }),
            PacingAdvice::Wait,
            "the one before is on its way"
        );
        assert_eq!(advise(&FrameTiming { is_shown: false, samples: 4.0, ..thin }), MOVING, "but much worse");
        let ending = FrameTiming { final_in: Some(Duration::from_millis(200)), ..thin };
        assert_eq!(advise(&ending), PacingAdvice::Wait, "the last one would wait for it");
    }

    #[test]
    fn a_render_of_64_samples_shows_a_handful_of_pictures() {
        for (bytes_per_second, most) in [(None, 12), (Some(125e3), 8), (Some(10e3), 2)] {
            let (mut aimed, mut at, mut count) = (None, 0.0, 0);
            // 2.5 seconds, a preview every 66 ms.
            for preview in 0..38_u32 {
                let seconds = f64::from(preview) * 0.066;
                let moment = FrameTiming {
                    bytes_per_second,
                    samples: seconds / 2.5 * 64.0,
                    aimed_samples: aimed,
                    since_aim: Duration::from_secs_f64(seconds - at),
                    ..MOMENT
                };
                if advise(&moment) != PacingAdvice::Wait {
                    (aimed, at, count) = (Some(moment.samples), seconds, count + 1);
                }
            }
            assert!(count <= most && count >= 1, "{bytes_per_second:?}: {count}");
        }
    }
}
