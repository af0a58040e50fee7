//! OBJ (Wavefront, *Object Files*, 1995): polygons with an index of their own for each part of a corner, which become vertices
//! with one index.

mod build;
mod libraries;
mod statements;
mod vertex;
mod words;

use std::collections::{BTreeSet, HashMap};

use super::assemble::assemble_text;
use super::parsed::Parsed;
use super::text::with_line_feeds;
use super::{AssetError, LoadedMesh, Source};
use crate::assets::FileMaterial;
use build::{Run, build};
use libraries::{Found, Libraries};
use statements::{Change, Corner, NONE, Smoothing, Statements, face_start};

pub(super) fn parse(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    parse_lines(&Source { bytes: &with_line_feeds(source.bytes), ..*source })
}

fn parse_lines(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    let mut statements = Statements::read(source)?;
    let materials = Materials::of(source, &statements.changes)?;
    let runs = runs(&statements, &materials.used);
    let mut parsed = Parsed {
        materials: materials.all,
        material_warnings: materials.warnings,
        companions: materials.found.files,
        pictures: materials.found.pictures,
        warnings: std::mem::take(&mut statements.warnings),
        ..Parsed::default()
    };
    build(&statements, &runs, &mut parsed);
    parsed.warnings.extend(gaps(source, &statements, &runs));
    drop(statements);
    assemble_text(source, parsed, |face| Some(face_start(source, face)))
}

/// The materials of an OBJ.
struct Materials {
    all: Vec<FileMaterial>,
    /// The material of each `usemtl` statement, [`NONE`] without one.
    used: Vec<u32>,
    warnings: Vec<String>,
    found: Found,
}

impl Materials {
    /// Loads the libraries and looks up the materials. A library counts from its statement on, and before it for names that no
    /// earlier library has.
    fn of(source: &Source<'_>, changes: &[(usize, Change)]) -> Result<Self, AssetError> {
        let name_of = |change: &Change| match change {
            Change::Material(name) if !name.is_empty() => Some(name.clone()),
            Change::Material(_) | Change::Library(_) | Change::Object | Change::Smoothing(_) => None,
        };
        let names: BTreeSet<String> = changes.iter().filter_map(|(_, change)| name_of(change)).collect();
        let mut libraries = Libraries { source, used: &names, found: Found::default() };
        let mut known = HashMap::new();
        let mut used = Vec::new();
        for (_, change) in changes {
            match change {
                Change::Library(name) => known.extend(libraries.load(name)?),
                Change::Material(name) => used.push((name, known.get(name).copied())),
                Change::Object | Change::Smoothing(_) => {}
            }
        }
        let place = |(name, found): (&String, Option<usize>)| found.or_else(|| known.get(name).copied());
        let used = used.into_iter().map(|used| place(used).map_or(NONE, |place| place as u32)).collect();
        let mut found = libraries.found;
        let mut warnings = std::mem::take(&mut found.warnings);
        if !found.missing {
            let unknown = names.difference(&found.resolved);
            warnings.extend(unknown.map(|name| format!("no material is named {name:?}")));
        }
        let all = std::mem::take(&mut found.materials);
        Ok(Self { all, used, warnings, found })
    }
}

/// Divides the faces into runs at every change.
fn runs(statements: &Statements, materials: &[u32]) -> Vec<Run> {
    let mut materials = materials.iter();
    let mut runs = vec![Run { faces: 0, material: NONE, smoothing: Smoothing::Unsaid, is_object: false }];
    let mut before = 0;
    let end = statements.arities.len();
    for (faces, change) in
        statements.changes.iter().map(|(at, change)| (*at, Some(change))).chain([(end, None)])
    {
        let Some(last) = runs.last_mut() else { continue };
        last.faces = faces - before;
        let mut next = Run { faces: 0, is_object: false, ..*last };
        before = faces;
        match change {
            Some(Change::Object) => next.is_object = true,
            Some(Change::Material(_)) => {
                next.material = materials.next().copied().unwrap_or(NONE);
                next.is_object = next.material != last.material;
            }
            Some(Change::Smoothing(smoothing)) => next.smoothing = *smoothing,
            Some(Change::Library(_)) | None => {}
        }
        runs.push(next);
    }
    runs
}

/// Warns of objects in which some corners have texture coordinates and others have none.
fn gaps(source: &Source<'_>, statements: &Statements, runs: &[Run]) -> Option<String> {
    let (mut face, mut corner) = (0, 0);
    let (mut first, mut count) = (None, 0);
    for object in runs.chunk_by(|_, next| !next.is_object) {
        let (mut lacking, mut has_some) = (Vec::new(), false);
        for _ in 0..object.iter().map(|run| run.faces).sum() {
            let end = corner + statements.arities[face] as usize;
            let has_uvs = |corner: &Corner| corner[1] != NONE;
            let corners = &statements.corners[corner..end];
            has_some |= corners.iter().any(has_uvs);
            if !corners.iter().all(has_uvs) {
                lacking.push(face);
            }
            (face, corner) = (face + 1, end);
        }
        if has_some {
            first = first.or(lacking.first().copied());
            count += lacking.len();
        }
    }
    let line = source.line(face_start(source, first?));
    let faces = match count {
        1 => format!("line {line}: a face has"),
        _ => format!("line {line} and {} more faces have", count - 1),
    };
    Some(format!("{faces} corners without texture coordinates: (0, 0) is used there"))
}

#[cfg(test)]
mod tests;
