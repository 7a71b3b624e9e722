//! What maps state about their pieces, and what remains proven where a statement does not fit.

use semismooth::enumeration::{Completeness, Doubt, EnumerationOptions, all_arms};
use semismooth::piecewise::{
    Exact, ExactConditions, ExactForm, ExactPiece, ExactPieces, ExactSite, PiecewiseSmooth, Selection,
    Structure,
};
use semismooth::sparse::Matrix;

use super::maps::two_pieces;
use super::{cut_short, list};

/// 3 · 0.1 x − 0.3 where x ≤ 1, x − 1 where x ≥ 1: with 3 · 0.1 not rounded the pieces differ by 2.8e-17 at x = 1.
struct Torn {
    shift: f64,
}

impl PiecewiseSmooth for Torn {
    two_pieces!(self, [negative, positive], 1, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] - 1.0;
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = [3.0 * 0.1 * x[0] - 0.3, x[0] - 1.0][s.piece(0)] - self.shift;
    }
    fn jacobian(&self, s: &Selection, _x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, [3.0 * 0.1, 1.0][s.piece(0)]);
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Structure for Torn {
    fn exact(&self) -> Option<&dyn ExactPieces> {
        Some(self)
    }
}

impl ExactPieces for Torn {
    fn conditions(&self, _alpha: f64) -> Option<ExactConditions> {
        let exact = |v: f64| Exact::new(v);
        let (one, shift) = (exact(1.0)?, exact(self.shift)?);
        let facet = ExactForm::unknown(1, 0, -&one);
        let mut left = ExactForm::zero(1);
        left.coefficients[0] = &exact(3.0)? * &exact(0.1)?;
        left.constant = -&(&exact(0.3)? + &shift);
        let mut right = facet.clone();
        right.constant = -&(&one + &shift);
        let piece = |piece: usize, form: usize, sign: i8| ExactPiece {
            piece,
            equalities: vec![(0, form)],
            facets: vec![(0, sign)],
        };
        let site = ExactSite {
            forms: vec![facet, left, right],
            pieces: vec![piece(0, 1, -1), piece(1, 2, 1)],
            implied: Vec::new(),
        };
        Some(ExactConditions {
            unknowns: 1,
            sites: vec![site],
            ..ExactConditions::default()
        })
    }
}

/// y where y ≤ 0, 2 y where y ≥ 0, less α; the slope of the second piece is stated to be `stated`.
struct Misstated {
    stated: f64,
}

impl PiecewiseSmooth for Misstated {
    two_pieces!(self, [negative, positive], 2, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0];
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = [1.0, 2.0][s.piece(0)] * x[0] - x[1];
    }
    fn jacobian(&self, s: &Selection, _x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, [1.0, 2.0][s.piece(0)]);
        jac.add(0, 1, -1.0);
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Structure for Misstated {
    fn exact(&self) -> Option<&dyn ExactPieces> {
        Some(self)
    }
}

impl ExactPieces for Misstated {
    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let form = |slope: f64, constant: f64| {
            let mut form = ExactForm::zero(1);
            form.coefficients[0] = Exact::new(slope)?;
            form.constant = Exact::new(constant)?;
            Some(form)
        };
        let piece = |piece: usize, sign: i8| ExactPiece {
            piece,
            equalities: vec![(0, 1 + piece)],
            facets: vec![(0, sign)],
        };
        let site = ExactSite {
            forms: vec![form(1.0, 0.0)?, form(1.0, -alpha)?, form(self.stated, -alpha)?],
            pieces: vec![piece(0, -1), piece(1, 1)],
            implied: Vec::new(),
        };
        Some(ExactConditions {
            unknowns: 1,
            sites: vec![site],
            ..ExactConditions::default()
        })
    }
    fn is_affine_in_parameter(&self) -> bool {
        true
    }
}

/// Proofs are those of the coefficients stated: points and directions that do not solve the map itself are never called complete.
#[test]
fn statements_that_the_pieces_contradict_prove_nothing() {
    let doubt = Doubt::Contradiction;
    for (stated, right) in [(2.0, true), (2.002, false), (3.0, false), (1.0, false)] {
        let found = list(&Misstated { stated }, 1.0);
        let expected = match right {
            true => (Completeness::Complete, Some(1)),
            false => (Completeness::Undecided { selections: 1, doubt }, None),
        };
        assert_eq!((found.completeness, found.index_sum), expected, "{stated}");
        let arms = all_arms(&Misstated { stated }, &[0.0, 0.0], &EnumerationOptions::default()).unwrap();
        let expected = match right {
            true => Completeness::Complete,
            false => Completeness::Undecided { selections: 0, doubt },
        };
        assert_eq!(arms.completeness, expected, "{stated}");
        // The arms themselves are those of the pieces, whatever is stated.
        let mut slopes: Vec<f64> = arms.arms.iter().map(|a| a.tangent[0] / a.tangent[1]).collect();
        slopes.sort_by(f64::total_cmp);
        assert!(
            slopes.len() == 2 && (slopes[0] - 0.5).abs() < 1e-12 && (slopes[1] - 1.0).abs() < 1e-12,
            "{slopes:?}"
        );
    }
}

#[test]
fn pieces_that_disagree_leave_points_near_their_facet_undecided() {
    let far = list(&Torn { shift: 0.5 }, 0.0);
    assert_eq!(
        (far.completeness, far.solutions.len()),
        (Completeness::Complete, 1)
    );
    let near = list(&Torn { shift: 0.0 }, 0.0);
    assert_eq!(
        near.completeness,
        Completeness::Undecided {
            selections: 1,
            doubt: Doubt::Discontinuous
        }
    );
}

/// |x_k| = 1 for k = 1, …, n, without stated bounds: the whole search is in exact arithmetic.
struct Signs {
    n: usize,
    /// The alteration of the statement.
    alter: fn(&mut ExactConditions),
}

fn signs(n: usize) -> Signs {
    Signs { n, alter: |_| {} }
}

impl PiecewiseSmooth for Signs {
    two_pieces!(self, [positive, negative], self.n, self.n, self.n);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(x);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        for (k, x) in x.iter().enumerate() {
            out[k] = [1.0, -1.0][s.piece(k)] * x - 1.0;
        }
    }
    fn jacobian(&self, s: &Selection, _x: &[f64], jac: &mut Matrix) {
        for k in 0..self.n {
            jac.add(k, k, [1.0, -1.0][s.piece(k)]);
        }
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Structure for Signs {
    fn exact(&self) -> Option<&dyn ExactPieces> {
        Some(self)
    }
}

impl ExactPieces for Signs {
    fn conditions(&self, _alpha: f64) -> Option<ExactConditions> {
        let (n, one) = (self.n, Exact::one());
        let site = |k: usize| {
            let facet = ExactForm::unknown(n, k, Exact::default());
            let right = ExactForm::unknown(n, k, -&one);
            let left = ExactForm::zero(n).plus(&-&one, &ExactForm::unknown(n, k, one.clone()));
            let piece = |piece: usize, form: usize, sign: i8| ExactPiece {
                piece,
                equalities: vec![(k, form)],
                facets: vec![(0, sign)],
            };
            ExactSite {
                forms: vec![facet, right, left],
                pieces: vec![piece(0, 1, 1), piece(1, 2, -1)],
                implied: Vec::new(),
            }
        };
        let mut all = ExactConditions {
            unknowns: n,
            sites: (0..n).map(site).collect(),
            ..ExactConditions::default()
        };
        (self.alter)(&mut all);
        Some(all)
    }
}

/// Where the search in exact arithmetic has to stop, nothing is claimed, at whichever check of the clock time runs out.
#[test]
fn an_exact_search_that_stops_proves_nothing() {
    let map = signs(6);
    let whole = list(&map, 0.0);
    assert_eq!(
        (whole.completeness, whole.solutions.len(), whole.index_sum),
        (Completeness::Complete, 64, Some(0))
    );
    let (same, all) = cut_short(&map, usize::MAX);
    assert_eq!(same.completeness, Completeness::Complete);
    let mut undecided = 0;
    for most in (0..all).step_by(all / 60) {
        let set = cut_short(&map, most).0;
        assert!(
            !set.completeness.is_complete() && set.index_sum.is_none(),
            "{most} of {all}"
        );
        let by_limit = matches!(
            set.completeness,
            Completeness::Undecided {
                doubt: Doubt::Limit,
                ..
            }
        );
        undecided += usize::from(by_limit);
    }
    assert!(undecided > 20, "{undecided}");
}

/// Conditions with indices or sizes that do not fit the map are ignored: the list is that of a map that states nothing.
#[test]
fn statements_that_do_not_fit_prove_nothing() {
    let alterations: [fn(&mut ExactConditions); 14] = [
        |c| c.unknowns = 2,
        |c| c.sites.truncate(2),
        |c| c.common.push(ExactForm::zero(2)),
        |c| c.sites[1].pieces[0].piece = 2,
        |c| c.sites[1].pieces[1].equalities[0].0 = 3,
        |c| c.sites[1].pieces[1].equalities[0].1 = 3,
        |c| c.sites[1].pieces[1].facets[0].0 = 3,
        |c| c.sites[1].pieces[1].facets[0].1 = 0,
        |c| c.sites[1].pieces[1].facets[0].1 = i8::MIN,
        |c| c.sites[1].implied.push((3, 1)),
        |c| c.sites[1].implied.push((1, 0)),
        |c| c.sites[1].implied.push((1, i8::MIN)),
        |c| c.sites[1].forms[0] = ExactForm::zero(2),
        |c| c.sites[1].forms[2] = ExactForm::zero(4),
    ];
    for (k, alter) in alterations.into_iter().enumerate() {
        let found = list(&Signs { n: 3, alter }, 0.0);
        let doubt = Doubt::NoCoefficients;
        assert_eq!(
            found.completeness,
            Completeness::Undecided { selections: 0, doubt },
            "{k}"
        );
        assert_eq!(found.solutions.len(), 8, "{k}");
    }
}
