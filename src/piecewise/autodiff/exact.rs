//! Exact coefficients of traced maps, in abs-normal form.

use super::{Kind, Kinks, Mode, NonsmoothFunction, Traced};
use crate::piecewise::abs_normal::{AbsNormal, Added, Terms, abs_normal};
use crate::piecewise::{
    Exact, ExactConditions, ExactForm, ExactPiece, ExactPieces, ExactSite, PiecewiseSmooth,
};
use crate::sparse::Matrix;
use crate::tolerances::MAX_COEFFICIENTS;

impl<F: NonsmoothFunction> Traced<F> {
    /// The abs-normal form, at any parameter or at one.
    fn abs_normal(&self, fixed: Option<f64>) -> Option<AbsNormal> {
        let found = abs_normal(self.num_vars(), fixed, self.num_residuals(), |x, out| {
            self.function.eval(x, &mut Kinks::new(Mode::Switched), out);
        })?;
        let kinks = found.added.iter().filter_map(|added| match added {
            Added::Kink { tests, .. } => Some(tests.len()),
            Added::Quotient(_) => None,
        });
        kinks.eq(self.kinds.iter().map(|k| k.tests())).then_some(found)
    }

    /// Whether the formulas of each [`switch`](Kinks::switch) of an affine map are the same where its test
    /// vanishes: their difference is a multiple of the test. A curve would jump there unnoticed if they were
    /// not. `false` also where this cannot be decided in exact arithmetic.
    pub(super) fn is_continuous_at_switches(&self) -> bool {
        if !self.kinds.contains(&Kind::Switch) {
            return true;
        }
        let minus = -&Exact::one();
        let agree = |added: &Added| match added {
            Added::Kink { tests, pieces } => match (&tests[..], &pieces[..]) {
                ([test], [first, second]) => first.plus(&minus, second).is_multiple_of(test),
                // The bounds of a projection meet what they bound where the tests vanish.
                _ => true,
            },
            Added::Quotient(_) => true,
        };
        self.abs_normal(None)
            .is_some_and(|found| found.added.iter().all(agree))
    }

    /// Whether the last variable is a parameter.
    fn has_parameter(&self) -> bool {
        self.num_vars() != self.num_residuals()
    }

    /// The conditions of one kink, whose value z is an unknown: the test functions, and z less each of the pieces.
    pub(super) fn site(
        &self,
        site: usize,
        row: usize,
        [tests, values]: [&[ExactForm]; 2],
        z: &ExactForm,
    ) -> ExactSite {
        let minus = -&Exact::one();
        let behind = tests.len();
        let forms = tests
            .iter()
            .cloned()
            .chain(values.iter().map(|v| z.plus(&minus, v)));
        let pieces = (0..values.len()).map(|piece| ExactPiece {
            piece,
            equalities: vec![(row, behind + piece)],
            facets: self
                .cell(site, piece)
                .iter()
                .map(|f| (f.test(), if f.sign() > 0.0 { 1 } else { -1 }))
                .collect(),
        });
        // The largest or the least of the pieces; a projection lies between its bounds where these are in their order.
        let implied = match (self.kinds[site], values) {
            (Kind::Max | Kind::Abs, _) => vec![(behind, 1), (behind + 1, 1)],
            (Kind::Min, _) => vec![(behind, -1), (behind + 1, -1)],
            (Kind::Mid, [lower, _, upper]) => {
                let width = upper.plus(&minus, lower);
                let constant = width.coefficients.iter().all(Exact::is_zero);
                if constant && width.constant.sign() >= 0 {
                    vec![(behind, 1), (behind + 2, -1)]
                } else {
                    Vec::new()
                }
            }
            (Kind::Mid | Kind::Switch, _) => Vec::new(),
        };
        ExactSite {
            forms: forms.collect(),
            pieces: pieces.collect(),
            implied,
        }
    }
}

impl<F: NonsmoothFunction> Traced<F> {
    /// M and q of a function M x + q of as many values as variables, without kinks; `None` for others, and where a coefficient is no
    /// floating-point number: then rounding would make it another function. Solvers of affine problems prove that there is no solution.
    ///
    /// ```
    /// use semismooth::piecewise::{Formula, Traced};
    /// let function = |text| Traced::new(Formula::read(&[text], &["x"]).unwrap());
    /// let (m, q) = function("2*(x - 1) + x = 4").affine().unwrap();
    /// assert_eq!((m.get(0, 0), q), (3.0, vec![-6.0]));
    /// assert!(function("abs(x) = 1").affine().is_none() && function("x^2 = 1").affine().is_none());
    /// ```
    #[must_use]
    pub fn affine(&self) -> Option<(Matrix, Vec<f64>)> {
        let n = self.num_vars();
        if self.num_sites() > 0 || self.num_residuals() != n || !self.is_piecewise_affine() {
            return None;
        }
        let stored = |e: &Exact| Some(e.to_f64()).filter(|&v| Exact::new(v).as_ref() == Some(e));
        let found = self.abs_normal(None).filter(|found| found.added.is_empty())?;
        let (mut entries, mut q) = (Vec::new(), Vec::with_capacity(n));
        for (i, terms) in found.values.iter().enumerate() {
            q.push(stored(&terms.constant)?);
            for (j, e) in terms.terms.iter().filter(|t| !t.1.is_zero()) {
                entries.push((i, *j, stored(e)?));
            }
        }
        Some((Matrix::from_triplets(n, n, &entries).ok()?, q))
    }
}

/// The kinks, and quotients by numbers, are unknowns after those of the map: the abs-normal form (Griewank 2013).
impl<F: NonsmoothFunction> ExactPieces for Traced<F> {
    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let (n, m) = (self.num_residuals(), self.num_vars());
        let fixed = self.has_parameter().then_some(alpha);
        let found = self.abs_normal(None).or_else(|| self.abs_normal(Some(fixed?)))?;
        // After the variables come the kinks and quotients; a parameter is no unknown.
        let own = m - usize::from(fixed.is_some());
        let unknowns = own + found.added.len();
        let count = |a: &Added| match a {
            Added::Kink { tests, pieces } => tests.len() + pieces.len(),
            Added::Quotient(_) => 1,
        };
        let forms = n + found.added.iter().map(count).sum::<usize>();
        if unknowns.saturating_mul(forms) > MAX_COEFFICIENTS {
            return None;
        }
        let at = Exact::new(fixed.unwrap_or(0.0))?;
        let dense = |terms: &Terms| {
            let mut terms = terms.clone();
            if fixed.is_some() {
                let of_parameter = |t: &(usize, Exact)| t.0 + 1 == m;
                if let Some(k) = terms.terms.iter().position(of_parameter) {
                    let (_, rate) = terms.terms.remove(k);
                    terms.constant = &terms.constant + &(&rate * &at);
                }
            }
            terms.form(unknowns, |k| if k < m { k } else { k - m + own })
        };
        let mut common: Vec<ExactForm> = found.values.iter().map(dense).collect();
        let mut sites = Vec::with_capacity(self.kinds.len());
        for (k, added) in found.added.iter().enumerate() {
            match added {
                Added::Quotient(form) => common.push(dense(form)),
                Added::Kink { tests, pieces } => {
                    let tests: Vec<ExactForm> = tests.iter().map(dense).collect();
                    let values: Vec<ExactForm> = pieces.iter().map(dense).collect();
                    let z = ExactForm::unknown(unknowns, own + k, Exact::default());
                    sites.push(self.site(sites.len(), n + k, [&tests, &values], &z));
                }
            }
        }
        Some(ExactConditions {
            unknowns,
            common,
            sites,
            bounds: Vec::new(),
        })
    }

    fn is_affine_in_parameter(&self) -> bool {
        self.has_parameter() && self.abs_normal(None).is_some()
    }
}
