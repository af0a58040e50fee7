//! Functions of rows, in the place that calls them or once for each instruction set, as [`RoughRow::IS_COPIED`] says.

use crate::materials::bsdf::{BsdfValues, LobeSet, RoughRow};
use crate::math::lanes::{Folds, Lanes, Lanes3, Loops};

/// The functions of [`RoughRow`] that are large, for all kinds.
pub(super) trait RoughCalls: RoughRow {
    /// [`RoughRow::f`].
    #[inline(always)]
    fn call_f(&self, directions: &Lanes3, folds: impl Folds) -> BsdfValues {
        if Self::IS_COPIED { self.f(directions) } else { folds.call(Evaluation { row: self, directions }) }
    }

    /// [`RoughRow::parts`].
    #[inline(always)]
    fn call_parts(&self, directions: &Lanes3, values: &BsdfValues, folds: impl Folds) -> [Lanes3; 2] {
        if Self::IS_COPIED {
            self.parts(directions, values)
        } else {
            folds.call(Division { row: self, directions, values })
        }
    }

    /// [`RoughRow::pdf`].
    #[inline(always)]
    fn call_pdf(
        &self,
        lobes: LobeSet,
        normals: &Lanes3,
        directions: &Lanes3,
        values: &BsdfValues,
        folds: impl Folds,
    ) -> Lanes {
        if Self::IS_COPIED {
            self.pdf(lobes, normals, directions, values)
        } else {
            folds.call(Density { row: self, lobes, normals, directions, values })
        }
    }

    /// [`RoughRow::sample`].
    #[inline(always)]
    fn call_sample(
        &self,
        lobes: LobeSet,
        normals: &Lanes3,
        choices: &Lanes,
        u: &[Lanes; 2],
        folds: impl Folds,
    ) -> Lanes3 {
        if Self::IS_COPIED {
            self.sample(lobes, normals, choices, u)
        } else {
            folds.call(Sampling { row: self, lobes, normals, choices, u })
        }
    }
}

impl<R: RoughRow> RoughCalls for R {}

/// A call of [`RoughRow::f`].
struct Evaluation<'a, R> {
    row: &'a R,
    directions: &'a Lanes3,
}

impl<R: RoughRow> Loops for Evaluation<'_, R> {
    type Done = BsdfValues;

    #[inline(always)]
    fn run(self, _: impl Folds) -> BsdfValues {
        self.row.f(self.directions)
    }
}

/// A call of [`RoughRow::parts`].
struct Division<'a, R> {
    row: &'a R,
    directions: &'a Lanes3,
    values: &'a BsdfValues,
}

impl<R: RoughRow> Loops for Division<'_, R> {
    type Done = [Lanes3; 2];

    #[inline(always)]
    fn run(self, _: impl Folds) -> [Lanes3; 2] {
        self.row.parts(self.directions, self.values)
    }
}

/// A call of [`RoughRow::pdf`].
struct Density<'a, R> {
    row: &'a R,
    lobes: LobeSet,
    normals: &'a Lanes3,
    directions: &'a Lanes3,
    values: &'a BsdfValues,
}

impl<R: RoughRow> Loops for Density<'_, R> {
    type Done = Lanes;

    #[inline(always)]
    fn run(self, _: impl Folds) -> Lanes {
        self.row.pdf(self.lobes, self.normals, self.directions, self.values)
    }
}

/// A call of [`RoughRow::sample`].
struct Sampling<'a, R> {
    row: &'a R,
    lobes: LobeSet,
    normals: &'a Lanes3,
    choices: &'a Lanes,
    u: &'a [Lanes; 2],
}

impl<R: RoughRow> Loops for Sampling<'_, R> {
    type Done = Lanes3;

    #[inline(always)]
    fn run(self, _: impl Folds) -> Lanes3 {
        self.row.sample(self.lobes, self.normals, self.choices, self.u)
    }
}
