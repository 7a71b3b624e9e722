//! Linearisations of affine pieces whose Jacobians are combined from rows of one large matrix: hierarchical factors, and updates of them.

use std::sync::Arc;

use super::{Held, Linearisation, MoorePenrose};
use crate::linear::{Bordered, CondensedRows, HierarchicalLu, LinearError, LinearSolver, RowUpdates};
use crate::piecewise::{CondensedJacobian, CondensedRoom, PiecewiseError, PiecewiseSmooth, Selection};

/// The factors of one selection.
#[derive(Debug, Clone, Default)]
pub(in crate::newton) struct CondensedSystem {
    base: Option<Bordered<HierarchicalLu>>,
    factorisations: usize,
    /// Of the selection at hand, and of the next.
    rows: CondensedRows,
    next: CondensedRows,
    room: CondensedRoom,
}

impl CondensedSystem {
    /// Whether updates are those of hierarchical factors.
    pub(super) fn in_use(&self) -> bool {
        self.base.is_some()
    }

    pub(in crate::newton) fn base(&mut self) -> Option<&mut Bordered<HierarchicalLu>> {
        self.base.as_mut()
    }

    pub(super) fn factorisations(&self) -> usize {
        self.factorisations
    }
}

impl<L: LinearSolver> MoorePenrose<L> {
    /// Factors ∇H^(σ) by blocks; false where the map is of another kind, or its factors are not accurate enough.
    pub(super) fn factor_condensed(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
    ) -> Result<bool, PiecewiseError> {
        self.condensed.base = None;
        let Some(of) = map.structure().and_then(|own| own.condensed()) else {
            return Ok(false);
        };
        let Some(hierarchical) = of.pieces.hierarchical() else {
            return Ok(false);
        };
        let CondensedSystem { rows, room, .. } = &mut self.condensed;
        of.pieces.rows(selection, rows);
        let n = rows.parameter.len();
        let (sizes, size) = match of.sizes.split_last() {
            Some((size, sizes)) => (sizes, *size),
            None => (&[] as &[f64], 1.0),
        };
        let last: Vec<f64> = rows.parameter.iter().map(|g| g * size).collect();
        let factors = HierarchicalLu::new(Arc::clone(hierarchical), rows, sizes);
        let pattern = self.jac.pattern();
        let base = factors.and_then(|factors| Bordered::of_factors(pattern, factors, &last));
        let Ok(mut base) = base else { return Ok(false) };
        debug_assert_eq!(n, pattern.nrows());
        let mut source = CondensedJacobian { of, rows, room };
        let sizes = source.row_sizes();
        let Ok(Some(updated)) = RowUpdates::of_factors(&mut source, sizes, &mut base) else {
            return Ok(false);
        };
        self.updated = Some((selection.clone(), updated));
        self.condensed.base = Some(base);
        self.condensed.factorisations += 1;
        Ok(true)
    }

    /// Changes to `selection` from the stored one, from which it differs in the rows noted.
    pub(super) fn update_condensed(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        (_, mut updated): (Selection, RowUpdates),
    ) -> Result<bool, PiecewiseError> {
        let CondensedSystem {
            base: Some(base),
            rows,
            next,
            room,
            ..
        } = &mut self.condensed
        else {
            return Ok(false);
        };
        let Some(of) = map.structure().and_then(|own| own.condensed()) else {
            return Ok(false);
        };
        updated.note(&mut CondensedJacobian { of, rows, room }, &self.changed_rows);
        of.pieces.rows(selection, next);
        let mut source = CondensedJacobian { of, rows: next, room };
        let replaced = updated.replace(&mut source, &self.changed_rows, base);
        std::mem::swap(rows, next);
        match replaced {
            Ok(true) => self.updated = Some((selection.clone(), updated)),
            Ok(false) | Err(LinearError::Singular { .. } | LinearError::Inaccurate { .. }) => {}
            Err(e) => return Err(e.into()),
        }
        Ok(self.updated.is_some())
    }
}

impl<L: LinearSolver> Linearisation<'_, L> {
    /// Adds Σⱼ |∇H_ij| sⱼ to each entry of `out`.
    pub(crate) fn add_term_sizes(&mut self, map: &dyn PiecewiseSmooth, sizes: &[f64], out: &mut [f64]) {
        let held = &mut *self.held;
        let hierarchical = held.held == Held::Updates && held.condensed.in_use();
        let CondensedSystem { rows, room, .. } = &mut held.condensed;
        match map
            .structure()
            .and_then(|own| own.condensed())
            .filter(|_| hierarchical)
        {
            Some(of) => CondensedJacobian { of, rows, room }.add_term_sizes(sizes, out),
            None => held.jac.as_ref().add_term_sizes(sizes, out),
        }
    }
}
