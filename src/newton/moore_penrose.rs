mod condensed;
mod correct;
mod linearisation;

use self::condensed::CondensedSystem;
pub use self::linearisation::Linearisation;
use super::secants::Secants;
use crate::InputError;
use crate::input::check_length;
use crate::linear::{Bordered, DENSE_LIMIT, LinearError, LinearSolver, RowUpdates};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, check_selection};
use crate::sparse::Matrix;

/// The Moore–Penrose corrector of curves H(x) = 0 (n equations, n + 1 variables), with its workspaces.
///
/// One iteration: B = [∇H^(σ)(X); Tᵀ], X ← X − B⁻¹[H^(σ)(X); 0], T ← B⁻¹[0; 1] normalised (Allgower–Georg 1990; Dhooge,
/// Govaerts, Kuznetsov 2003).
#[derive(Debug, Clone)]
pub struct MoorePenrose<L> {
    pub(super) bordered: Bordered<L>,
    pub(super) jac: Matrix,
    pub(super) r: Vec<f64>,
    pub(super) dx: Vec<f64>,
    iterations: usize,
    pub(super) held: Held,
    /// Selection and point of the factors held, as far as they belong to one.
    pub(super) selection: Selection,
    pub(super) point: Vec<f64>,
    /// The length of the steps that rounding errors of H cause with these factors, once computed.
    rounding: Option<f64>,
    /// Steps of the last correction by chords.
    pub(super) secants: Secants,
    /// Rounding errors of H, and the step that they cause.
    pub(super) errors: (Vec<f64>, Vec<f64>),
    /// For affine pieces, the bordered Jacobian of a selection with updates.
    pub(super) updated: Option<(Selection, RowUpdates)>,
    /// The factors that these updates rely on, where they are hierarchical.
    pub(super) condensed: CondensedSystem,
    updates: usize,
    rows: Vec<usize>,
    changed_rows: Vec<usize>,
}

/// What the factors are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Held {
    /// No selection that is known.
    Nothing,
    /// The selection at the point.
    Point,
    /// The selection at another point nearby.
    Nearby,
    /// The same, while the assembled Jacobian and the tangent are those of the point itself.
    Refined,
    /// The selection at every point, as its piece is affine.
    Everywhere,
    /// The same by updates.
    Updates,
}

/// Largest number of residuals for which the inverse of a full Jacobian is kept, rather than its factors.
const MAX_INVERSE: usize = 1000;

/// Chord steps go on while each is at most this share of the one before.
pub(super) const CONTRACTION: f64 = 0.1;
/// The same for those of Broyden's method, which converges superlinearly.
const SECANTS: f64 = 0.3;
/// Chord steps go on below the tolerance on steps, down to this share of it: the accuracy that the last Newton step would reach.
const QUADRATIC: f64 = 1e-4;
/// Steps up to this multiple of the estimated effect of rounding errors count as rounding errors.
const AT_ROUNDING: f64 = 2.0;

/// How a correction ended.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Correction {
    /// Whether both tolerances were met.
    pub converged: bool,
    /// Number of iterations: chord steps count as the number of Newton steps that would reduce the error as much.
    pub iterations: usize,
    /// ‖H^(σ)‖₂ at the last iterate.
    pub residual_norm: f64,
    /// ‖X^k − X^(k−1)‖₂ of the last iteration.
    pub step_norm: f64,
    /// The rate of convergence at the beginning, ‖X² − X¹‖₂/‖X¹ − X⁰‖₂; 0 where one iteration was enough.
    pub rate: f64,
}

impl Correction {
    /// Notes the length of the step of an iteration, counted from 1, and the rate at the second.
    fn compare(&mut self, iteration: usize, step: f64) {
        if iteration == 2 && self.step_norm > 0.0 {
            self.rate = step / self.step_norm;
        }
        self.step_norm = step;
    }
}

impl<L: LinearSolver> MoorePenrose<L> {
    /// A corrector for maps of the shape of `map`.
    ///
    /// # Errors
    /// Maps that do not have exactly one variable more than residuals.
    pub fn new<P: PiecewiseSmooth + ?Sized>(map: &P, solver: L) -> Result<Self, PiecewiseError> {
        let (m, n) = (map.num_vars(), map.num_residuals());
        if n == 0 || m != n + 1 {
            return Err(PiecewiseError::Dimensions {
                vars: m,
                residuals: n,
                expected: "a curve has exactly one variable more than residuals",
            });
        }
        let pattern = map.pattern();
        if pattern.nrows() != n || pattern.ncols() != m {
            return Err(PiecewiseError::Input(InputError::Length {
                what: "the declared pattern (rows times columns)",
                expected: n * m,
                found: pattern.nrows() * pattern.ncols(),
            }));
        }
        Ok(Self {
            bordered: Bordered::new(&pattern, solver)?,
            jac: Matrix::zeros(pattern),
            r: vec![0.0; n],
            dx: vec![0.0; m],
            iterations: 0,
            held: Held::Nothing,
            selection: Selection::default(),
            point: Vec::new(),
            rounding: None,
            secants: Secants::default(),
            errors: (vec![0.0; n], vec![0.0; m]),
            updated: None,
            condensed: CondensedSystem::default(),
            updates: 0,
            rows: Vec::new(),
            changed_rows: Vec::new(),
        })
    }

    fn check(
        &self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        vectors: &[(&'static str, &[f64])],
    ) -> Result<(), PiecewiseError> {
        let (m, n) = (map.num_vars(), map.num_residuals());
        check_length("the residual of the map", n, self.r.len())?;
        check_length("the vector of variables of the map", m, self.dx.len())?;
        for (what, vector) in vectors {
            check_length(what, vector.len(), self.dx.len())?;
        }
        check_selection("the selection", selection, map)
    }

    /// Number of factorisations so far.
    #[must_use]
    pub fn factorisations(&self) -> usize {
        self.bordered.factorisations() + self.condensed.factorisations()
    }

    /// Number of correction steps so far.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    fn at_hand(&self) -> Option<&RowUpdates> {
        let updated = self.updated.as_ref().filter(|_| self.held == Held::Updates);
        updated.map(|(_, updated)| updated)
    }

    /// Number of updates by which factorisations were saved.
    #[must_use]
    pub fn updates(&self) -> usize {
        self.updates
    }

    /// Assembles ∇H^(σ)(x), factors it and computes its kernel. `hint` (length n + 1) is an approximate
    /// tangent.
    ///
    /// # Errors
    /// [`LinearError::Kernel`](crate::linear::LinearError::Kernel) where the kernel is not a line; entries outside the pattern;
    /// vectors of other lengths, selections of other maps.
    pub fn linearize<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        selection: &Selection,
        x: &[f64],
        hint: Option<&[f64]>,
    ) -> Result<Linearisation<'_, L>, PiecewiseError> {
        self.linearize_on(&map, selection, x, hint)?;
        Ok(Linearisation::of(self))
    }

    fn linearize_on(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        x: &[f64],
        hint: Option<&[f64]>,
    ) -> Result<(), PiecewiseError> {
        self.check(map, selection, &[("the point x", x)])?;
        if !map.is_piecewise_affine() {
            return self.factorise(map, selection, x, hint).map(drop);
        }
        if self.holds_everywhere(selection) {
            return Ok(());
        }
        if self.update(map, selection, x)? {
            self.held = Held::Updates;
            self.updates += 1;
        } else if self.factor_condensed(map, selection)? {
            self.held = Held::Updates;
        } else {
            self.jacobian_at(map, selection, x)?;
            self.factor(hint)?;
            let n = self.jac.nrows();
            let keep_inverse = n <= DENSE_LIMIT || (self.jac.pattern().is_full() && n <= MAX_INVERSE);
            let updated = RowUpdates::new(&self.jac, &mut self.bordered, keep_inverse)?;
            self.updated = updated.map(|updated| (selection.clone(), updated));
            self.held = Held::Everywhere;
        }
        self.selection.copy_from(selection);
        Ok(())
    }

    /// [`linearize`](Self::linearize) by factors of the Jacobian itself, with which transposed systems are
    /// solved, too.
    pub(crate) fn factorise(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        x: &[f64],
        hint: Option<&[f64]>,
    ) -> Result<Linearisation<'_, L>, PiecewiseError> {
        self.jacobian_at(map, selection, x)?;
        self.selection.copy_from(selection);
        self.factor_at(x, hint)?;
        Ok(Linearisation::of(self))
    }

    /// Whether the factors are those of an affine piece.
    fn holds_everywhere(&self, selection: &Selection) -> bool {
        matches!(self.held, Held::Everywhere | Held::Updates) && self.selection == *selection
    }

    /// Factors the assembled Jacobian.
    pub(super) fn factor(&mut self, hint: Option<&[f64]>) -> Result<(), LinearError> {
        if !self.condensed.in_use() {
            self.updated.take_if(|(_, updated)| updated.relies_on_factors());
        }
        self.held = Held::Nothing;
        self.rounding = None;
        self.bordered.factor(&self.jac, hint)
    }

    /// Factors the assembled Jacobian, which is that of the stored selection at x.
    pub(super) fn factor_at(&mut self, x: &[f64], hint: Option<&[f64]>) -> Result<(), LinearError> {
        self.factor(hint)?;
        self.point.clear();
        self.point.extend_from_slice(x);
        self.held = Held::Point;
        Ok(())
    }

    /// Changes to `selection` by low-rank updates where it differs from the stored one at one or two sites whose rows are known to be few.
    fn update(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        x: &[f64],
    ) -> Result<bool, PiecewiseError> {
        const FEW_SITES: usize = 2;
        let Some((known, mut updated)) = self.updated.take() else {
            return Ok(false);
        };
        self.changed_rows.clear();
        for (count, site) in known.differing_sites(selection).enumerate() {
            if count == FEW_SITES {
                return Ok(false);
            }
            map.site_rows(site, &mut self.rows);
            self.changed_rows.extend_from_slice(&self.rows);
        }
        // Sites may share rows.
        self.changed_rows.sort_unstable();
        self.changed_rows.dedup();
        if self.changed_rows.len() * 4 > self.jac.nrows().max(8) {
            return Ok(false);
        }
        if self.condensed.in_use() {
            return self.update_condensed(map, selection, (known, updated));
        }
        if !(self.held == Held::Updates && self.selection == known) {
            self.jacobian_at(map, &known, x)?;
        }
        updated.note(&mut &self.jac, &self.changed_rows);
        // Only the rows that change are assembled.
        if !self.assemble_sites(map, &known, selection, x)? {
            self.jacobian_at(map, selection, x)?;
        }
        let replaced = updated.replace(&mut &self.jac, &self.changed_rows, &mut self.bordered);
        if replaced == Ok(true) {
            self.updated = Some((selection.clone(), updated));
        }
        Ok(self.updated.is_some())
    }

    /// Reassembles the rows of the sites in which the selections differ; false if the map does not offer that.
    fn assemble_sites(
        &mut self,
        map: &dyn PiecewiseSmooth,
        known: &Selection,
        selection: &Selection,
        x: &[f64],
    ) -> Result<bool, PiecewiseError> {
        self.held = Held::Nothing;
        self.jac.clear_rows(&self.changed_rows);
        for site in known.differing_sites(selection) {
            if !map.site_jacobian(site, selection, x, &mut self.jac) {
                return Ok(false);
            }
        }
        self.check_stray().map(|()| true)
    }

    /// One correction of x, where H^(σ)(x) = `r`, with the stored factors if they are those of `selection` (affine pieces);
    /// false if they are not.
    pub(crate) fn refine(&mut self, selection: &Selection, r: &[f64], x: &mut [f64]) -> bool {
        if !self.holds_everywhere(selection) {
            return false;
        }
        match &mut self.updated {
            Some((_, updated)) if self.held == Held::Updates => match self.condensed.base() {
                Some(base) => updated.correct(r, x, base).is_ok(),
                None => updated.correct(r, x, &mut self.bordered).is_ok(),
            },
            _ => {
                let tangent = self.bordered.tangent().to_vec();
                if self.bordered.solve(r, &tangent, 0.0, &mut self.dx).is_err() {
                    return false;
                }
                x.iter_mut().zip(&self.dx).for_each(|(x, d)| *x -= d);
                true
            }
        }
    }

    /// ∇H^(σ)(x), not factored.
    pub(crate) fn jacobian_at(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        x: &[f64],
    ) -> Result<&Matrix, PiecewiseError> {
        self.held = match self.held {
            Held::Everywhere | Held::Updates => Held::Nothing,
            Held::Refined => Held::Nearby,
            held => held,
        };
        self.jac.clear();
        map.jacobian(selection, x, &mut self.jac);
        self.check_stray()?;
        Ok(&self.jac)
    }

    /// The same for the selection of the factors.
    pub(super) fn assemble(&mut self, map: &dyn PiecewiseSmooth, x: &[f64]) -> Result<(), PiecewiseError> {
        let selection = std::mem::take(&mut self.selection);
        let assembled = self.jacobian_at(map, &selection, x).map(drop);
        self.selection = selection;
        assembled
    }

    fn check_stray(&self) -> Result<(), PiecewiseError> {
        match self.jac.stray() {
            Some((row, col)) => Err(PiecewiseError::StrayEntry { row, col }),
            None => Ok(()),
        }
    }
}
