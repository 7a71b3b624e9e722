use std::borrow::Cow;
use std::sync::{Arc, Mutex, OnceLock};

use super::evaluation::Scratch;
use super::fill_sizes;
use super::operator::Operator;
use super::view::{CondensedView, FullView, View};
use crate::input::{check_size, check_vector};
use crate::linear::{CondensedRows, Hierarchical, LinearError};
use crate::piecewise::{
    Condensed, CondensedPieces, Derivatives, Description, ExactPieces, Facet, PiecewiseError,
    PiecewiseSmooth, PiecewiseSmoothExt, Selection, Structure,
};
use crate::sparse::{Matrix, Pattern};
use crate::spread::Random;
use crate::tolerances::{ALLOWANCE, VALUE};

/// A u + Bᵀ λ = f(α), G(B u, λ, α) = 0, in one of its [views](View): x = (u, λ, α) or x = (λ, α).
///
/// A is n × n, B is q × n. The law G is itself a piecewise-smooth map of z = (v, λ, α) with v = B u: q residuals, 2q + 1 variables.
/// Residuals are those of equilibrium (n, in full form alone), then those of the law; sites, pieces and test functions are the
/// law's. A law of 2q + 2 variables has a second parameter β, and so has the map: x = (u, λ, α, β).
///
/// In full form A need be neither symmetric nor definite, and Newton steps are sparse. The condensed form has v(λ, α) = B A⁻¹ f(α) − C λ
/// with C = B A⁻¹ Bᵀ from one Cholesky factorisation; evaluations cost O(q²). Both forms have the same solutions and transitions. With H
/// the map in full and h that in condensed form, det ∇_yH = det A · det ∇_λh, so that signs agree.
///
/// ```
/// use semismooth::interface::{InterfaceProblem, LoadPath};
/// use semismooth::newton::Newton;
/// use semismooth::sparse::Matrix;
/// // Two springs in series under the load α, with a stop at 1 for the node between them: 0 ≤ λ ⟂ 1 − v ≥ 0.
/// let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 1.0]])?;
/// let b = Matrix::from_rows(&[[1.0, 0.0]])?;
/// // A law of one quantity is a curve in (v, λ, α).
/// #[derive(Clone)]
/// struct Stop;
/// # use semismooth::piecewise::{Facet, PiecewiseSmooth, Selection};
/// impl PiecewiseSmooth for Stop {
///     fn num_vars(&self) -> usize { 3 }
///     fn num_residuals(&self) -> usize { 1 }
///     fn num_sites(&self) -> usize { 1 }
///     fn num_pieces(&self, _site: usize) -> usize { 2 }
///     fn num_tests(&self, _site: usize) -> usize { 1 }
///     fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
///         const CELLS: [[Facet; 1]; 2] = [[Facet::negative(0)], [Facet::positive(0)]];
///         &CELLS[piece]
///     }
///     fn test_functions(&self, z: &[f64], out: &mut [f64]) { out[0] = z[1] + z[0] - 1.0; }
///     fn residual(&self, s: &Selection, z: &[f64], out: &mut [f64]) { out[0] = [z[1], 1.0 - z[0]][s.piece(0)]; }
///     fn jacobian(&self, s: &Selection, _z: &[f64], jac: &mut Matrix) {
///         if s.piece(0) == 0 { jac.add(0, 1, 1.0) } else { jac.add(0, 0, -1.0) }
///     }
///     fn is_piecewise_affine(&self) -> bool { true }
/// }
/// let load = LoadPath::affine(vec![0.0; 2], vec![0.0, 1.0]);
/// let condensed = InterfaceProblem::from_parts(a, &b, load, Stop)?.condensed()?;
/// let mut x = [0.0, 3.0]; // λ and α
/// Newton::default().solve(&condensed, &mut x)?;
/// assert!((x[0] - 2.0).abs() < 1e-12); // the first spring carries 1 of the 3
/// assert_eq!(condensed.expand(&x)?.len(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Interface<V, G> {
    pub(crate) operator: Arc<Operator>,
    pub(crate) view: V,
    pub(crate) law: G,
    law_pattern: Pattern,
    /// Computed on first use: that of the full form takes as long as the assembly of a body, and the condensed form does not need it.
    pattern: OnceLock<Pattern>,
    scratch: Mutex<Scratch>,
}

/// An interface problem in full form, x = (u, λ, α).
pub type InterfaceProblem<G> = Interface<FullView, G>;

/// An interface problem condensed onto its multipliers, x = (λ, α).
pub type CondensedInterface<G> = Interface<CondensedView, G>;

impl<V: View, G: PiecewiseSmooth> Interface<V, G> {
    pub(crate) fn with_view(operator: Arc<Operator>, view: V, law: G) -> Result<Self, PiecewiseError> {
        let q = operator.num_traces();
        let law_pattern = law.pattern();
        let expected = 2 * q + if law.num_vars() == 2 * q + 2 { 2 } else { 1 };
        check_size("the number of variables of the law", expected, law.num_vars())?;
        check_size("the number of residuals of the law", q, law.num_residuals())?;
        check_size(
            "the number of rows in the pattern of the law",
            q,
            law_pattern.nrows(),
        )?;
        check_size(
            "the number of columns in the pattern of the law",
            expected,
            law_pattern.ncols(),
        )?;
        let parameters = expected - 2 * q;
        let load = &operator.load;
        let slots = (0..load.parts().count()).map(|k| load.slot(k) + 1);
        check_size(
            "the number of parameters of the load",
            parameters,
            slots.fold(parameters, usize::max),
        )?;
        if let Some(reduced) = view.reduced().filter(|_| operator.anchors.is_empty()) {
            reduced.compress(|| groups(&law));
        }
        Ok(Self {
            scratch: Mutex::new(Scratch::new(&operator, &law_pattern, view.reduced().is_some())),
            operator,
            view,
            law,
            law_pattern,
            pattern: OnceLock::new(),
        })
    }

    /// The same problem with another load and law, with the pattern of this one.
    pub(crate) fn exchanged<H: PiecewiseSmooth>(
        &self,
        operator: Arc<Operator>,
        view: V,
        law: H,
    ) -> Interface<V, H> {
        Interface {
            scratch: Mutex::new(Scratch::new(
                &operator,
                &self.law_pattern,
                view.reduced().is_some(),
            )),
            operator,
            view,
            law,
            law_pattern: self.law_pattern.clone(),
            pattern: self.pattern.clone(),
        }
    }

    /// The law G.
    #[must_use]
    pub fn law(&self) -> &G {
        &self.law
    }

    /// The operator A.
    #[must_use]
    pub fn operator(&self) -> &Matrix {
        &self.operator.a
    }

    /// Number n of displacements u.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.operator.num_displacements()
    }

    /// Number q of traces v = B u, and of multipliers λ.
    #[must_use]
    pub fn num_traces(&self) -> usize {
        self.operator.num_traces()
    }

    /// 1, or 2 where the law has a second parameter.
    #[must_use]
    pub fn num_parameters(&self) -> usize {
        self.law_pattern.ncols() - 2 * self.num_traces()
    }

    /// The load f at the parameters α[, β].
    ///
    /// # Errors
    /// Another number of parameters, values that are not finite.
    pub fn load_at(&self, parameters: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
        check_vector("the list of parameters", parameters, self.num_parameters())?;
        Ok(self.operator.load_at(parameters))
    }

    /// The point (u, λ, α) of the full form: one solve in condensed form.
    ///
    /// # Complexity
    /// That of [`Condensation::expand`](crate::linear::Condensation::expand) in condensed form.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn expand(&self, x: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
        check_vector("x", x, self.num_vars())?;
        let Some(reduced) = self.view.reduced() else {
            return Ok(x.to_vec());
        };
        let q = self.num_traces();
        let mut u = self.operator.load_at(&x[q..]);
        reduced.expand(&x[..q], &mut u)?;
        u.extend_from_slice(x);
        Ok(u)
    }

    /// The point (λ, α) of the condensed form that corresponds to a point (u, λ, α).
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn restrict(&self, full: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
        let n = self.num_displacements();
        let expected = n + self.num_traces() + self.num_parameters();
        check_vector("the full point", full, expected)?;
        Ok(full[n..].to_vec())
    }

    /// The traces v = B u at x.
    ///
    /// # Complexity
    /// O(q²) operations in condensed form; linear in the entries of B in full form.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn traces(&self, x: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
        check_vector("x", x, self.num_vars())?;
        Ok(self.with_scratch(|s| {
            self.parts().law_point(x, s);
            s.z[..self.num_traces()].to_vec()
        }))
    }

    /// Number of variables before the multipliers.
    pub(crate) fn leading(&self) -> usize {
        if self.view.reduced().is_some() {
            0
        } else {
            self.num_displacements()
        }
    }

    /// Runs `f` with the workspace of this problem, or with a new one while another thread uses it.
    pub(super) fn with_scratch<R>(&self, f: impl FnOnce(&mut Scratch) -> R) -> R {
        let condensed = self.view.reduced().is_some();
        f(&mut Scratch::borrow(
            &self.scratch,
            &self.operator,
            &self.law_pattern,
            condensed,
        ))
    }
}

impl<V: Clone, G: Clone> Clone for Interface<V, G> {
    fn clone(&self) -> Self {
        let scratch = match self.scratch.lock() {
            Ok(scratch) => scratch.clone(),
            Err(poisoned) => poisoned.into_inner().clone(),
        };
        Self {
            operator: Arc::clone(&self.operator),
            view: self.view.clone(),
            law: self.law.clone(),
            law_pattern: self.law_pattern.clone(),
            pattern: self.pattern.clone(),
            scratch: Mutex::new(scratch),
        }
    }
}

impl<V: View, G: PiecewiseSmooth> PiecewiseSmooth for Interface<V, G> {
    fn num_vars(&self) -> usize {
        self.leading() + self.law_pattern.ncols() - self.num_traces()
    }

    fn num_residuals(&self) -> usize {
        self.leading() + self.num_traces()
    }

    fn num_sites(&self) -> usize {
        self.law.num_sites()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.law.num_pieces(site)
    }

    fn num_tests(&self, site: usize) -> usize {
        self.law.num_tests(site)
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        self.law.cell(site, piece)
    }

    fn pattern(&self) -> Pattern {
        let make = || match self.view.reduced() {
            Some(_) => Pattern::full(self.num_residuals(), self.num_vars()),
            None => full_pattern(&self.operator, &self.law_pattern),
        };
        self.pattern.get_or_init(make).clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.law.is_piecewise_affine() && self.operator.load.is_affine()
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.with_scratch(|s| {
            self.parts().law_point(x, s);
            self.law.test_functions(&s.z, out);
        });
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (equilibrium, rows) = out.split_at_mut(self.leading());
        self.with_scratch(|s| {
            if !equilibrium.is_empty() {
                self.parts().equilibrium(x, s, equilibrium);
            }
            self.parts().law_point(x, s);
            self.law.residual(selection, &s.z, rows);
        });
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        self.with_scratch(|s| {
            if self.view.reduced().is_none() {
                self.parts().equilibrium_jacobian(x, s, jac);
            }
            self.parts()
                .point_of_derivatives(self.law.is_piecewise_affine(), x, s);
            s.jac.clear();
            self.law.jacobian(selection, &s.z, &mut s.jac);
            self.parts().add_gradients(s, jac);
        });
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }

    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }

    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

/// Random errors with which the rounding of the terms of equilibrium is propagated to traces.
const PROBES: u64 = 4;

impl<V: View, G: PiecewiseSmooth> Interface<V, G> {
    /// Adds what rounding may leave of test functions of the law at z: in condensed form, of the traces B A⁻¹ f − B A⁻¹ Bᵀ λ, by
    /// random roundings of the terms |A| |A⁻¹ f|, |A| |A⁻¹ Bᵀ λ|, |Bᵀ| |λ| and |f|.
    pub(super) fn add_roundings(&self, x: &[f64], z: &[f64], out: &mut [f64]) {
        let Some(reduced) = self.view.reduced() else {
            return;
        };
        let q = self.num_traces();
        let (lambda, parameters) = x.split_at(q);
        // Those of the load and of the forces are computed each on its own, and may cancel.
        let (mut u, mut free) = (
            self.operator.load_at(parameters),
            self.operator.load_at(parameters),
        );
        if reduced.expand(lambda, &mut u).is_err() || reduced.expand(&vec![0.0; q], &mut free).is_err() {
            return;
        }
        let both = u.iter_mut().zip(&free);
        both.for_each(|(u, free)| *u = free.abs() + (*u - free).abs());
        let mut terms = self.operator.load.terms(parameters, u.len());
        Matrix::as_ref(&self.operator.b_t).add_term_sizes(lambda, &mut terms);
        let mut largest = vec![0.0_f64; out.len()];
        let Ok(traces) = self.roundings_of_traces(&u, terms) else {
            return;
        };
        for traces in traces.chunks_exact(q.max(1)) {
            let (mut dz, mut moved) = (vec![0.0; z.len()], vec![0.0; out.len()]);
            dz[..q].copy_from_slice(traces);
            self.law.test_derivatives(z, &dz, &mut moved);
            for (l, m) in largest.iter_mut().zip(&moved) {
                *l = l.max(m.abs());
            }
        }
        out.iter_mut()
            .zip(&largest)
            .for_each(|(o, l)| *o += ALLOWANCE * l);
    }

    /// In condensed form, samples of what roundings leave of the traces of a solution u of equilibrium, one after the other: of its terms
    /// |A| |u| and of others of these sizes. None in full form.
    pub(crate) fn roundings_of_traces(
        &self,
        u: &[f64],
        mut terms: Vec<f64>,
    ) -> Result<Vec<f64>, LinearError> {
        let Some(reduced) = self.view.reduced() else {
            return Ok(Vec::new());
        };
        Matrix::as_ref(&self.operator.a).add_term_sizes(u, &mut terms);
        let mut samples = Vec::with_capacity(PROBES as usize * terms.len());
        for seed in 1..=PROBES {
            let mut spread = Random::new(seed);
            samples.extend(terms.iter().map(|t| VALUE * t * spread.error()));
        }
        reduced.traces_of_solution(&samples)
    }
}

impl<V: View, G: PiecewiseSmooth> Derivatives for Interface<V, G> {
    fn test_roundings(&self, x: &[f64], out: &mut [f64]) {
        let z = self.with_scratch(|s| {
            self.parts().law_point(x, s);
            s.z.clone()
        });
        self.add_roundings(x, &z, out);
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        self.with_scratch(|s| {
            self.parts()
                .law_direction(self.law.is_piecewise_affine(), x, d, s);
            self.law.test_derivatives(&s.z, &s.dz, out);
        });
    }

    fn has_nested_kinks(&self) -> bool {
        self.law.has_nested_kinks()
    }

    fn tests_of_selection(&self, selection: &Selection, x: &[f64], d: Option<&[f64]>, out: &mut [f64]) {
        self.with_scratch(|s| match d {
            Some(d) => {
                self.parts()
                    .law_direction(self.law.is_piecewise_affine(), x, d, s);
                self.law.tests_of_selection(selection, &s.z, Some(&s.dz), out);
            }
            None => {
                self.parts().law_point(x, s);
                self.law.tests_of_selection(selection, &s.z, None, out);
            }
        });
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let affine = self.law.is_piecewise_affine();
        self.with_scratch(|s| {
            self.parts().point_of_derivatives(affine, x, s);
            self.law.test_gradient(site, test, &s.z, &mut s.dz);
            self.parts().gradient(s, gradient);
        });
    }
}

impl<V: View, G: PiecewiseSmooth> Structure for Interface<V, G> {
    fn exact(&self) -> Option<&dyn ExactPieces> {
        self.states_coefficients().then_some(self)
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.law.site_rows(site, rows);
        let first = self.leading();
        rows.iter_mut().for_each(|i| *i += first);
    }

    fn site_jacobian(&self, site: usize, selection: &Selection, x: &[f64], jac: &mut Matrix) -> bool {
        self.with_scratch(|s| {
            self.parts()
                .point_of_derivatives(self.law.is_piecewise_affine(), x, s);
            s.jac.clear();
            let done = self.law.site_jacobian(site, selection, &s.z, &mut s.jac);
            if done {
                self.parts().add_gradients_one_by_one(s, jac);
            }
            done
        })
    }

    fn condensed(&self) -> Option<Condensed<'_>> {
        let found = self.view.reduced()?.hierarchical().is_some();
        let linear = self.is_piecewise_affine() && self.operator.load.base().is_some();
        (found && linear && self.num_parameters() == 1).then_some(Condensed {
            pieces: self,
            sizes: &[],
        })
    }
}

impl<V: View, G: PiecewiseSmooth> Description for Interface<V, G> {
    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        self.law.piece_name(site, piece)
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        self.law.site_name(site)
    }

    /// The typical size of β is that of α.
    fn typical_sizes(&self, sizes: &mut [f64]) {
        let last = sizes.len() - (self.num_parameters() - 1);
        fill_sizes(self.operator.sizes, self.leading(), &mut sizes[..last]);
        let alpha = sizes[last - 1];
        if let Some([displacement, ..]) = self.operator.sizes {
            sizes[last - 1 - self.operator.anchors.len()..last - 1].fill(displacement);
        }
        sizes[last..].fill(alpha);
    }

    fn reported_tests(&self, x: &[f64], out: &mut [f64]) -> bool {
        self.with_scratch(|s| {
            // Whether there are any does not depend on the point: traces are computed only if so.
            s.reports = s.reports || self.law.reported_tests(&s.z, out);
            if s.reports {
                self.parts().law_point(x, s);
                s.reports = self.law.reported_tests(&s.z, out);
            }
            s.reports
        })
    }

    fn in_prescribed_scale(&self) -> Option<Box<dyn PiecewiseSmooth + '_>> {
        let law = self.law.in_prescribed_scale()?;
        let operator = Arc::clone(&self.operator);
        Some(Box::new(self.exchanged(operator, self.view.clone(), law)))
    }
}

impl<V: View, G: PiecewiseSmooth> CondensedPieces for Interface<V, G> {
    fn hierarchical(&self) -> Option<&Arc<Hierarchical>> {
        self.view.reduced()?.hierarchical()
    }

    fn row(&self, k: usize) -> &[f64] {
        self.view.reduced().map_or(&[], |reduced| reduced.row(k))
    }

    fn rows(&self, selection: &Selection, rows: &mut CondensedRows) {
        // Affine laws under affine loads have the same derivatives everywhere.
        let zero = vec![0.0; self.num_vars()];
        self.with_scratch(|s| {
            self.parts().point_of_derivatives(true, &zero, s);
            s.jac.clear();
            self.law.jacobian(selection, &s.z, &mut s.jac);
            self.parts().condensed_rows(s, rows);
        });
    }

    fn motion(&self, lambda: &[f64], out: &mut [f64]) {
        self.with_scratch(|s| self.parts().motion(lambda, s, out));
    }
}

/// The rows of each site, which are those of its traces.
fn groups(law: &dyn PiecewiseSmooth) -> Vec<Vec<usize>> {
    let sites = 0..law.num_sites();
    let rows = sites.map(|site| {
        let mut rows = Vec::new();
        law.site_rows(site, &mut rows);
        rows
    });
    rows.collect()
}

fn full_pattern(operator: &Operator, law: &Pattern) -> Pattern {
    let (n, q) = (operator.num_displacements(), operator.num_traces());
    let load = &operator.load;
    let mut entries: Vec<(usize, usize)> = operator.a.triplets().map(|(i, j, _)| (i, j)).collect();
    entries.extend(operator.b_t.triplets().map(|(i, j, _)| (i, n + j)));
    if load.base().is_none() {
        entries.extend((0..n).map(|i| (i, n + q)));
    }
    for (k, case) in load.parts().enumerate() {
        let loaded = case.forces().iter().enumerate().filter(|c| *c.1 != 0.0);
        entries.extend(loaded.map(|(i, _)| (i, n + q + load.slot(k))));
    }
    for k in 0..law.ncols() {
        for &i in &law.row_idx()[law.col_ptr()[k]..law.col_ptr()[k + 1]] {
            if k < q {
                entries.extend(operator.trace(k).map(|(j, _)| (n + i, j)));
                if operator.yielding(k) != 0.0 {
                    entries.push((n + i, n + k));
                }
            } else {
                entries.push((n + i, n + k - q));
            }
        }
    }
    let variables = n + law.ncols() - q;
    Pattern::from_entries(n + q, variables, entries).unwrap_or_else(|_| Pattern::full(n + q, variables))
}
