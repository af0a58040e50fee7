//! Plans the drawing of text, which is always exact.

use super::cell::{CellContent, ForegroundParts};
use super::cursor_moves::{self, CellPosition};
use super::screen::{CellRun, ScreenModel};
use super::target_screen::{TargetScreen, TextOrPreviewRegion};

/// Minimum length of a run of blanks that is erased with one sequence.
const MIN_ERASED_RUN: usize = 9;
/// Minimum length of a run of blanks that is erased to the end of the row.
const ERASED_TO_END: usize = 4;

/// Plans the strokes that draw the text of one region in a row, or one row of a preview drawn with
/// characters.
pub(super) fn plan_text_row(
    screen: &ScreenModel,
    wanted: &TargetScreen,
    y: u16,
    region: TextOrPreviewRegion,
) -> Vec<CellRun> {
    let mut strokes = Vec::new();
    for x in 0..wanted.columns {
        let at = CellPosition { x, y };
        let look = &wanted.row(y)[usize::from(x)];
        if screen.content_at(at) == look || wanted.region_at(x, y) != region {
            continue;
        }
        if let Some(stroke) = single_cell_run(at, look) {
            bridge_gap(screen, &mut strokes, at);
            strokes.push(stroke);
        }
    }
    replace_blanks_with_erase(wanted, y, &strokes)
}

fn single_cell_run(at: CellPosition, look: &CellContent) -> Option<CellRun> {
    match look {
        CellContent::Text(text) => Some(CellRun::Text { at, text: text.clone() }),
        CellContent::Mosaic(mosaic) => {
            let glyph =
                ForegroundParts::ALL.into_iter().find(|glyph| glyph.can_represent_color_pair(mosaic.pair))?;
            Some(CellRun::Mosaic { at, glyph, mosaic: *mosaic, count: 1 })
        }
        CellContent::Unknown | CellContent::Covered => None,
    }
}

/// Redraws the cells between the last stroke and `to` if this takes fewer bytes than moving the cursor.
fn bridge_gap(screen: &ScreenModel, strokes: &mut Vec<CellRun>, to: CellPosition) {
    let Some(CellRun::Text { at, text }) = strokes.last() else { return };
    let first = at.x + text.columns;
    let jump = cursor_moves::csi_with_count(to.x - first, b'C').len();
    let (mut between, mut bytes) = (Vec::new(), 0);
    for x in first..to.x {
        let at = CellPosition { x, ..to };
        match screen.content_at(at) {
            CellContent::Text(other) if other.pen == text.pen && other.is_single_narrow_char() => {
                bytes += other.symbol.len();
                between.push(CellRun::Text { at, text: other.clone() });
            }
            CellContent::Mosaic(mosaic)
                if mosaic.pair == [text.pen.bg; 2] && text.pen.modifier.is_empty() =>
            {
                bytes += 1;
                between.push(CellRun::Mosaic {
                    at,
                    glyph: ForegroundParts::Blank,
                    mosaic: *mosaic,
                    count: 1,
                });
            }
            CellContent::Text(_) | CellContent::Mosaic(_) | CellContent::Unknown | CellContent::Covered => {
                return;
            }
        }
        if bytes > jump {
            return;
        }
    }
    strokes.extend(between);
}

/// Replaces long runs of blanks with erase sequences.
fn replace_blanks_with_erase(wanted: &TargetScreen, y: u16, strokes: &[CellRun]) -> Vec<CellRun> {
    let mut shorter = Vec::with_capacity(strokes.len());
    for run in strokes
        .chunk_by(|a, b| is_single_blank(a) && is_single_blank(b) && a.position().x + 1 == b.position().x)
    {
        let at = run[0].position();
        let end = usize::from(at.x) + run.len();
        let rest = end as u16..wanted.columns;
        let is_last = rest.clone().all(|x| !wanted.is_preview_cell(x, y))
            && wanted.row(y)[end.min(usize::from(wanted.columns))..]
                .iter()
                .all(|look| *look == CellContent::BLANK);
        if is_single_blank(&run[0]) && is_last && run.len() >= ERASED_TO_END {
            shorter.push(CellRun::Erase { at, count: None });
        } else if is_single_blank(&run[0]) && run.len() >= MIN_ERASED_RUN {
            shorter.push(CellRun::Erase { at, count: Some(run.len() as u16) });
        } else {
            shorter.extend_from_slice(run);
        }
    }
    shorter
}

fn is_single_blank(stroke: &CellRun) -> bool {
    matches!(stroke, CellRun::Mosaic { mosaic, count: 1, .. } if CellContent::Mosaic(*mosaic) == CellContent::BLANK)
}
