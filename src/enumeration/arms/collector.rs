//! Arms found selection by selection.

use super::{Candidates, DirectionalArm, DirectionalArms};
use crate::enumeration::kernel::{MAX_KERNEL, solutions};
use crate::enumeration::local::VanishingTests;
use crate::enumeration::{Completeness, EnumerationError};
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::piecewise::{ActiveSet, PiecewiseError, PiecewiseSmooth, Selection};
use crate::sparse::Matrix;
use crate::sparse::norm;
use crate::tolerances::{DIRECTION, TANGENTIAL};

/// Computes and collects the arms of single selections.
pub(super) struct Collector<'a> {
    map: &'a dyn PiecewiseSmooth,
    x: &'a [f64],
    vanishing: VanishingTests,
    jac: Matrix,
    solver: AutoSolver,
    arms: Vec<DirectionalArm>,
    unresolved: Vec<Selection>,
}

impl<'a> Collector<'a> {
    pub(super) fn new(
        map: &'a dyn PiecewiseSmooth,
        x: &'a [f64],
        active: &ActiveSet,
    ) -> Result<Self, EnumerationError> {
        let jac = Matrix::zeros(map.pattern());
        let mut solver = AutoSolver::default();
        solver.analyze(jac.leading_columns(map.num_residuals()).pattern)?;
        Ok(Self {
            vanishing: VanishingTests::new(map, x, active),
            map,
            x,
            jac,
            solver,
            arms: Vec::new(),
            unresolved: Vec::new(),
        })
    }

    pub(super) fn examine(&mut self, selection: &Selection) -> Result<(), EnumerationError> {
        let n = self.map.num_residuals();
        self.jac.clear();
        self.map.jacobian(selection, self.x, &mut self.jac);
        if let Some((row, col)) = self.jac.stray() {
            return Err(PiecewiseError::StrayEntry { row, col }.into());
        }
        let mut tangent = vec![0.0; n];
        for (i, _, v) in self.jac.triplets().filter(|t| t.1 == n) {
            tangent[i] -= v;
        }
        let factored = self.solver.factor(self.jac.leading_columns(n));
        let solved = factored.and_then(|()| self.solver.solve_in_place(&mut tangent));
        let sign = match solved {
            Ok(()) => {
                tangent.push(1.0);
                self.solver.log_det().map(|d| d.0)
            }
            Err(LinearError::Singular { .. } | LinearError::Inaccurate { .. }) => {
                if n > MAX_KERNEL {
                    self.unresolved.push(selection.clone());
                    return Ok(());
                }
                let mut rows = vec![vec![0.0; n + 2]; n];
                for (i, j, v) in self.jac.triplets() {
                    rows[i][j] += v;
                }
                let kernel = solutions(rows, n + 1).map_or_else(Vec::new, |s| s.kernel);
                let [one] = kernel.as_slice() else {
                    self.unresolved.push(selection.clone());
                    return Ok(());
                };
                tangent.clone_from(one);
                Some(0)
            }
            Err(e) => return Err(e.into()),
        };
        let length = norm(&tangent);
        for factor in [1.0 / length, -1.0 / length] {
            let direction: Vec<f64> = tangent.iter().map(|t| t * factor).collect();
            let vertical = direction.last().is_some_and(|rate| rate.abs() <= TANGENTIAL);
            // The determinant of a selection with a vertical tangent is rounding noise.
            let sign = if vertical { Some(0) } else { sign };
            if self.enters(selection, &direction) {
                self.add(selection, direction, sign);
            }
        }
        Ok(())
    }

    fn enters(&self, selection: &Selection, direction: &[f64]) -> bool {
        let own = self.vanishing.of(self.map, selection, self.x);
        own.iter().all(|v| {
            let rate = v.rate(direction);
            let cell = self.map.cell(v.site, selection.piece(v.site)).iter();
            cell.filter(|f| f.test() == v.test)
                .all(|f| f.sign() * rate >= -TANGENTIAL * v.gradient_norm)
        })
    }

    fn add(&mut self, selection: &Selection, tangent: Vec<f64>, sign: Option<i8>) {
        let same = |a: &&mut DirectionalArm| {
            let apart: Vec<f64> = a.tangent.iter().zip(&tangent).map(|(a, b)| a - b).collect();
            norm(&apart) < DIRECTION
        };
        if let Some(known) = self.arms.iter_mut().find(same) {
            known.selections.push(selection.clone());
            known.det_signs.push(sign);
        } else {
            self.arms.push(DirectionalArm {
                tangent,
                selections: vec![selection.clone()],
                det_signs: vec![sign],
            });
        }
    }

    pub(super) fn finish(self, found: &Candidates) -> DirectionalArms {
        let mut arms = DirectionalArms::new(self.arms, self.unresolved, found.nodes);
        if !found.complete {
            arms.completeness = Completeness::Incomplete {
                examined: found.examined,
                total: found.total,
            };
        }
        arms
    }
}
