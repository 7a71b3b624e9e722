use std::borrow::Cow;
use std::sync::Mutex;

use super::error::check_size;
use super::{InterfaceError, InterfaceLoad, fill_sizes, typical_sizes};
use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern};

/// A u + Bᵀ λ = f(α), G(B u, λ, α) = 0 in full form: x = (u, λ, α), n + q + 1 variables.
///
/// The law G is itself a piecewise-smooth map, of z = (v, λ, α) with v = B u: 2q + 1 variables, q residuals. Residuals are those of
/// equilibrium (n), then those of the law (q); sites, pieces and test functions are the law's.
///
/// ```
/// use semismooth::interface::{CondensedInterface, InterfaceLoad, InterfaceProblem};
/// use semismooth::newton::Newton;
/// use semismooth::piecewise::MinMap;
/// use semismooth::sparse::Matrix;
/// // Two springs in series; the middle may not pass 1: 0 ≤ λ ⟂ 1 − v ≥ 0, the load α pushes.
/// let a = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 1.0]])?;
/// let b = Matrix::from_rows(&[[1.0, 0.0]])?;
/// // A law of one quantity is a curve in (v, λ, α).
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
/// let problem = InterfaceProblem::new(a, b, InterfaceLoad::affine(vec![0.0; 2], vec![0.0, 1.0]), Stop)?;
/// let condensed = CondensedInterface::new(problem)?;
/// let mut x = [0.0, 3.0]; // λ and α
/// Newton::default().solve(&condensed, &mut x)?;
/// assert!((x[0] - 2.0).abs() < 1e-12); // 1 of the 3 is taken by the first spring
/// assert_eq!(condensed.expand(&x)?.len(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct InterfaceProblem<G> {
    pub(super) a: Matrix,
    pub(super) b: Matrix,
    pub(super) b_t: Matrix,
    pub(super) load: InterfaceLoad,
    pub(super) law: G,
    pub(super) law_pattern: Pattern,
    pattern: Pattern,
    pub(super) scratch: Mutex<Scratch>,
}

/// What an evaluation needs besides its arguments.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    /// The point (v, λ, α) of the law, and a direction there.
    pub(super) z: Vec<f64>,
    pub(super) dz: Vec<f64>,
    pub(super) amplitudes: Vec<f64>,
    pub(super) rates: Vec<f64>,
    /// dv/dα.
    pub(super) drift: Vec<f64>,
    pub(super) jac: Matrix,
}

impl<G: PiecewiseSmooth> InterfaceProblem<G> {
    /// A problem from its parts: A (n × n), B (q × n), the load and the law.
    ///
    /// # Errors
    /// Shapes that do not fit, a law that has not 2q + 1 variables and q residuals, entries that are not finite.
    pub fn new(a: Matrix, b: Matrix, load: InterfaceLoad, law: G) -> Result<Self, InterfaceError> {
        let (n, q) = (a.nrows(), b.nrows());
        check_size("the number of columns of A", n, a.ncols())?;
        check_size("the number of columns of B", n, b.ncols())?;
        check_size("the number of variables of the law", 2 * q + 1, law.num_vars())?;
        check_size("the number of residuals of the law", q, law.num_residuals())?;
        a.check_finite()?;
        b.check_finite()?;
        load.check(n)?;
        let law_pattern = law.pattern();
        check_size(
            "the number of rows in the pattern of the law",
            q,
            law_pattern.nrows(),
        )?;
        check_size(
            "the number of columns in the pattern of the law",
            2 * q + 1,
            law_pattern.ncols(),
        )?;
        let b_t = b.transpose();
        let pattern = pattern(&a, &b_t, &law_pattern, &load)?;
        let cases = load.cases.len();
        let scratch = Mutex::new(Scratch {
            z: vec![0.0; 2 * q + 1],
            dz: vec![0.0; 2 * q + 1],
            amplitudes: vec![0.0; cases],
            rates: vec![0.0; cases],
            drift: vec![0.0; q],
            jac: Matrix::zeros(law_pattern.clone()),
        });
        Ok(Self {
            a,
            b,
            b_t,
            load,
            law,
            law_pattern,
            pattern,
            scratch,
        })
    }

    /// The law G.
    #[must_use]
    pub fn law(&self) -> &G {
        &self.law
    }

    /// The operator A.
    #[must_use]
    pub fn operator(&self) -> &Matrix {
        &self.a
    }

    /// Number n of displacements u.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.a.nrows()
    }

    /// Number q of traces v = B u, and of multipliers λ.
    #[must_use]
    pub fn num_traces(&self) -> usize {
        self.b.nrows()
    }

    /// The load f(α).
    #[must_use]
    pub fn load_at(&self, alpha: f64) -> Vec<f64> {
        self.with_scratch(|s| {
            self.load.amplitudes(alpha, &mut s.amplitudes, &mut s.rates);
            let mut f = self.load.constant.clone();
            InterfaceLoad::accumulate(&self.load.cases, &s.amplitudes, &mut f);
            f
        })
    }

    /// Typical sizes of u, λ and α.
    pub(super) fn sizes(&self) -> Option<[f64; 3]> {
        typical_sizes(&self.a, [&self.b], self.load.sizes(), &[])
    }

    /// Runs `f` with the scratch of this problem, or with one of its own when another thread uses that.
    pub(super) fn with_scratch<R>(&self, f: impl FnOnce(&mut Scratch) -> R) -> R {
        match self.scratch.try_lock() {
            Ok(mut scratch) => f(&mut scratch),
            Err(std::sync::TryLockError::Poisoned(p)) => f(&mut p.into_inner()),
            Err(std::sync::TryLockError::WouldBlock) => {
                let (q, cases) = (self.num_traces(), self.load.cases.len());
                f(&mut Scratch {
                    z: vec![0.0; 2 * q + 1],
                    dz: vec![0.0; 2 * q + 1],
                    amplitudes: vec![0.0; cases],
                    rates: vec![0.0; cases],
                    drift: vec![0.0; q],
                    jac: Matrix::zeros(self.law_pattern.clone()),
                })
            }
        }
    }

    /// z = (B u, λ, α).
    fn law_point(&self, x: &[f64], z: &mut [f64]) {
        let (n, q) = (self.num_displacements(), self.num_traces());
        self.b.mul_vec(&x[..n], &mut z[..q]);
        z[q..].copy_from_slice(&x[n..]);
    }
}

impl<G: PiecewiseSmooth + Clone> Clone for InterfaceProblem<G> {
    fn clone(&self) -> Self {
        Self {
            a: self.a.clone(),
            b: self.b.clone(),
            b_t: self.b_t.clone(),
            load: self.load.clone(),
            law: self.law.clone(),
            law_pattern: self.law_pattern.clone(),
            pattern: self.pattern.clone(),
            scratch: Mutex::new(self.with_scratch(|s| s.clone())),
        }
    }
}

/// Sites and pieces are the law's.
macro_rules! sites_of_law {
    ($($law:tt)+) => {
        fn num_sites(&self) -> usize {
            self.$($law)+.num_sites()
        }
        fn num_pieces(&self, site: usize) -> usize {
            self.$($law)+.num_pieces(site)
        }
        fn num_tests(&self, site: usize) -> usize {
            self.$($law)+.num_tests(site)
        }
        fn cell(&self, site: usize, piece: usize) -> &[Facet] {
            self.$($law)+.cell(site, piece)
        }
        fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
            self.$($law)+.piece_name(site, piece)
        }
        fn site_name(&self, site: usize) -> Cow<'_, str> {
            self.$($law)+.site_name(site)
        }
    };
}
pub(super) use sites_of_law;

impl<G: PiecewiseSmooth> PiecewiseSmooth for InterfaceProblem<G> {
    sites_of_law!(law);

    fn num_vars(&self) -> usize {
        self.num_residuals() + 1
    }

    fn num_residuals(&self) -> usize {
        self.num_displacements() + self.num_traces()
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.law.is_piecewise_affine() && self.load.is_affine()
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.law.site_rows(site, rows);
        rows.iter_mut().for_each(|i| *i += self.num_displacements());
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        fill_sizes(self.sizes(), self.num_displacements(), sizes);
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.with_scratch(|s| {
            self.law_point(x, &mut s.z);
            self.law.test_functions(&s.z, out);
        });
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (n, q) = (self.num_displacements(), self.num_traces());
        let (equilibrium, rows) = out.split_at_mut(n);
        self.with_scratch(|s| {
            self.load.amplitudes(x[n + q], &mut s.amplitudes, &mut s.rates);
            InterfaceLoad::combine(&self.load.constant, &self.load.cases, &s.amplitudes, equilibrium);
            equilibrium.iter_mut().for_each(|f| *f = -*f);
            self.a.as_ref().mul_add(1.0, &x[..n], equilibrium);
            self.b_t.as_ref().mul_add(1.0, &x[n..n + q], equilibrium);
            self.law_point(x, &mut s.z);
            self.law.residual(selection, &s.z, rows);
        });
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let (n, q) = (self.num_displacements(), self.num_traces());
        jac.add_block(0, 0, 1.0, &self.a);
        jac.add_block(0, n, 1.0, &self.b_t);
        self.with_scratch(|s| {
            self.load.amplitudes(x[n + q], &mut s.amplitudes, &mut s.rates);
            for (case, rate) in self.load.cases.iter().zip(&s.rates) {
                for (i, f) in case.iter().enumerate().filter(|c| *c.1 != 0.0) {
                    jac.add(i, n + q, -rate * f);
                }
            }
            self.law_point(x, &mut s.z);
            s.jac.clear();
            self.law.jacobian(selection, &s.z, &mut s.jac);
            for (i, k, v) in s.jac.triplets() {
                if k < q {
                    let span = self.b_t.pattern().col_ptr()[k]..self.b_t.pattern().col_ptr()[k + 1];
                    for e in span {
                        jac.add(n + i, self.b_t.pattern().row_idx()[e], v * self.b_t.values()[e]);
                    }
                } else {
                    jac.add(n + i, n + k - q, v);
                }
            }
        });
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        self.with_scratch(|s| {
            self.law_point(x, &mut s.z);
            self.law_point(d, &mut s.dz);
            self.law.test_derivatives(&s.z, &s.dz, out);
        });
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let (n, q) = (self.num_displacements(), self.num_traces());
        self.with_scratch(|s| {
            self.law_point(x, &mut s.z);
            self.law.test_gradient(site, test, &s.z, &mut s.dz);
            self.b_t.mul_vec(&s.dz[..q], &mut gradient[..n]);
            gradient[n..].copy_from_slice(&s.dz[q..]);
        });
    }
}

fn pattern(a: &Matrix, b_t: &Matrix, law: &Pattern, load: &InterfaceLoad) -> Result<Pattern, InterfaceError> {
    let (n, q) = (a.nrows(), b_t.ncols());
    let mut entries: Vec<(usize, usize)> = a.triplets().map(|(i, j, _)| (i, j)).collect();
    entries.extend(b_t.triplets().map(|(i, j, _)| (i, n + j)));
    for case in &load.cases {
        let loaded = case.iter().enumerate().filter(|c| *c.1 != 0.0);
        entries.extend(loaded.map(|(i, _)| (i, n + q)));
    }
    for k in 0..2 * q + 1 {
        for &i in &law.row_idx()[law.col_ptr()[k]..law.col_ptr()[k + 1]] {
            if k < q {
                let span = b_t.pattern().col_ptr()[k]..b_t.pattern().col_ptr()[k + 1];
                entries.extend(b_t.pattern().row_idx()[span].iter().map(|&j| (n + i, j)));
            } else {
                entries.push((n + i, n + k - q));
            }
        }
    }
    Ok(Pattern::from_entries(n + q, n + q + 1, entries)?)
}
