//! Maps written as formulas state their kinks as unknowns, so that their lists are proven.

use proptest::prelude::*;
use semismooth::enumeration::{Completeness, Doubt, EnumerationOptions, all_arms, all_solutions};
use semismooth::interface::{InterfaceProblem, LoadPath};
use semismooth::piecewise::{
    Kinks, NonsmoothFunction, PiecewiseSmooth, PiecewiseSmoothExt, Real, Selections, Traced,
};
use semismooth::sparse::Matrix;

/// A network of kinks that depend on one another, with coefficients in eighths, some in thirds.
#[derive(Debug, Clone)]
struct Net(Vec<i32>);

impl NonsmoothFunction for Net {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let mut left = self.0.iter().map(|c| f64::from(*c) / 8.0);
        let mut sum = |terms: &[T]| {
            let mut sum = T::from(left.next().unwrap());
            for term in terms {
                sum += *term * left.next().unwrap();
            }
            sum
        };
        let (a, b) = (sum(x), sum(x));
        let first = kinks.max(a, b);
        let second = kinks.abs(sum(&[x[0], x[1], first])) / 3.0;
        let (a, b) = (sum(&[x[0], first]), sum(&[x[1], second]));
        let third = kinks.min(a, b);
        let fourth = kinks.project(T::from(-1.0), sum(&[x[0], x[1], third]), T::from(2.0)) / -3.0;
        for (k, row) in out.iter_mut().enumerate() {
            *row = x[k] * 2.0 + sum(&[first, second, third, fourth]);
        }
    }
}

/// All solutions by Cramer's rule for every selection: points with the signs of their determinants. `None` where a decision is close.
fn by_selections(map: &Traced<Net>) -> Option<Vec<([f64; 2], i8)>> {
    let mut found = Vec::new();
    for selection in Selections::all(map) {
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&selection, &[0.0; 2], &mut jac);
        let mut r = [0.0; 2];
        map.residual(&selection, &[0.0; 2], &mut r);
        let g = |i, j| jac.get(i, j);
        let det = g(0, 0) * g(1, 1) - g(0, 1) * g(1, 0);
        if det.abs() < 1e-6 {
            return None;
        }
        let x = [
            (g(0, 1) * r[1] - g(1, 1) * r[0]) / det,
            (g(1, 0) * r[0] - g(0, 0) * r[1]) / det,
        ];
        // The test functions of this selection: those of nested kinks depend on the selected pieces, which agree with the natural ones
        // inside the cell.
        let mut theta = [0.0; 5];
        map.test_functions(&x, &mut theta);
        if theta.iter().any(|t| t.abs() < 1e-6) {
            return None;
        }
        let mut first = 0;
        let inside = (0..map.num_sites()).all(|site| {
            let tests = &theta[first..first + map.num_tests(site)];
            first += map.num_tests(site);
            map.cell(site, selection.piece(site))
                .iter()
                .all(|f| f.margin(tests) > 0.0)
        });
        if inside {
            found.push((x, det.signum() as i8));
        }
    }
    Some(found)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn lists_are_those_of_all_selections(coefficients in prop::collection::vec(-16i32..=16, 32)) {
        let map = Traced::new(Net(coefficients));
        let Some(mut wanted) = by_selections(&map) else {
            return Err(TestCaseError::reject("something is close"));
        };
        let set = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
        prop_assert_eq!(set.completeness, Completeness::Complete);
        prop_assert_eq!(set.solutions.len(), wanted.len());
        for solution in &set.solutions {
            let near = |w: &([f64; 2], i8)| {
                let close = |k: usize| (w.0[k] - solution.x[k]).abs() <= 1e-9 * (1.0 + w.0[k].abs());
                solution.x.len() == 2 && close(0) && close(1) && solution.det_signs == [Some(w.1)]
            };
            let k = wanted.iter().position(near);
            prop_assert!(k.is_some(), "{solution:?}");
            wanted.remove(k.unwrap());
        }
        let sum: i64 = set.solutions.iter().map(|s| i64::from(s.index.unwrap())).sum();
        prop_assert_eq!(set.index_sum, Some(sum));
    }
}

/// |x|/3 + max(x, y)/−7 = α and y = x/5: quotients are not rounded.
struct Quotients;

impl NonsmoothFunction for Quotients {
    fn num_vars(&self) -> usize {
        3
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = kinks.abs(x[0]) / 3.0 + kinks.max(x[0], x[1]) / -7.0 - x[2];
        out[1] = x[1] - x[0] / 5.0;
    }
}

#[test]
fn quotients_are_exact() {
    let map = Traced::new(Quotients);
    // x ≥ 0: (1/3 − 1/7) x = α, or (4/21) x = α. x ≤ 0, y = x/5 ≥ x: −x/3 − x/35 = α, or x = −(105/38) α.
    for alpha in [4.0, 38.0, 1e-300, 0.3] {
        let set = all_solutions(&map, alpha, &EnumerationOptions::default()).unwrap();
        assert_eq!(
            (set.completeness, set.index_sum),
            (Completeness::Complete, Some(0))
        );
        let mut found: Vec<&[f64]> = set.solutions.iter().map(|s| s.x.as_slice()).collect();
        found.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let wanted = [-105.0 / 38.0 * alpha, 21.0 / 4.0 * alpha];
        assert_eq!(found.len(), 2);
        for (x, wanted) in found.iter().zip(wanted) {
            assert!((x[0] - wanted).abs() <= 1e-15 * wanted.abs(), "{x:?}");
            assert!(
                (x[1] - wanted / 5.0).abs() <= 1e-15 * wanted.abs() && x[2] == alpha,
                "{x:?}"
            );
        }
    }
    // The apex is the only point of the line in two of the four selections.
    let apex = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(
        (apex.completeness, apex.solutions.len()),
        (Completeness::Complete, 1)
    );
    assert_eq!(apex.solutions[0].x, [0.0; 3]);
    let none = all_solutions(&map, -1.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(
        (none.completeness, none.solutions.len()),
        (Completeness::Complete, 0)
    );
    let arms = all_arms(&map, &[0.0; 3], &EnumerationOptions::default()).unwrap();
    assert_eq!(
        (arms.completeness, arms.orientation),
        (Completeness::Complete, Some((0, 0)))
    );
    let mut slopes: Vec<f64> = arms.arms.iter().map(|a| a.tangent[0] / a.tangent[2]).collect();
    slopes.sort_by(f64::total_cmp);
    assert!(
        (slopes[0] + 105.0 / 38.0).abs() < 1e-14 && (slopes[1] - 5.25).abs() < 1e-14,
        "{slopes:?}"
    );
    assert!(arms.arms.iter().all(|a| a.tangent.len() == 3 && a.rate() > 0.0));
}

/// Formulas of one variable and α; the crate can state the coefficients of `Affine`, and those of `Slope` at each α.
#[derive(Clone, Copy)]
enum Formula {
    Affine,
    Slope,
    Square,
    Hidden,
    Branch,
    Rounded,
    Sine,
}

impl NonsmoothFunction for Formula {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let bend = kinks.positive_part(x[0] - 1.0);
        out[0] = bend
            + match self {
                Self::Affine => x[0] * 2.0 - x[1],
                Self::Slope => x[0] * (x[1] + 2.0) - 1.0,
                Self::Square => x[0] * x[0] - x[1],
                Self::Hidden => x[0].abs() - x[1],
                Self::Branch if x[0].value() > 0.0 => x[0] - x[1],
                Self::Branch => x[0] * 2.0 - x[1],
                Self::Rounded => x[0] * (T::from(1.0) / 3.0) - x[1],
                Self::Sine => x[0] - x[1].sin(),
            };
    }
}

#[test]
fn only_affine_formulas_state_coefficients() {
    let stated = |f: Formula| {
        let map = Traced::new(f);
        let exact = map.exact().unwrap();
        (exact.conditions(0.5).is_some(), exact.is_affine_in_parameter())
    };
    assert_eq!(stated(Formula::Affine), (true, true));
    // (2 + α) x is affine at each α, not in both.
    assert_eq!(stated(Formula::Slope), (true, false));
    for other in [
        Formula::Square,
        Formula::Hidden,
        Formula::Branch,
        Formula::Rounded,
        Formula::Sine,
    ] {
        assert_eq!(stated(other), (false, false));
    }
    let set = all_solutions(&Traced::new(Formula::Slope), 0.5, &EnumerationOptions::default()).unwrap();
    assert_eq!(
        (set.completeness, set.solutions.len()),
        (Completeness::Complete, 1)
    );
    assert!((set.solutions[0].x[0] - 0.4).abs() < 1e-15 && set.solutions[0].x[1] == 0.5);
    // At the kink, x = 1 / (2 + α), the parameter α is rounded: no arms are claimed.
    let arms = all_arms(
        &Traced::new(Formula::Slope),
        &[0.4, 0.5],
        &EnumerationOptions::default(),
    )
    .unwrap();
    assert!(matches!(
        arms.completeness,
        Completeness::Undecided {
            doubt: Doubt::NoCoefficients,
            ..
        }
    ));
}

/// n springs in series, stiffness 1, 3, 9 with kinks at the elongations 1 and 2, pulled by α: all rows are coupled. In their displacements,
/// or in displacements and forces.
struct Springs {
    n: usize,
    mixed: bool,
}

impl NonsmoothFunction for Springs {
    fn num_vars(&self) -> usize {
        self.num_residuals() + 1
    }
    fn num_residuals(&self) -> usize {
        if self.mixed { 2 * self.n } else { self.n }
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (n, load) = (self.n, x[self.num_residuals()]);
        let mut of_spring = |i: usize| {
            let e = if i == 0 { x[0] } else { x[i] - x[i - 1] };
            e + kinks.positive_part(e - 1.0) * 2.0 + kinks.positive_part(e - 2.0) * 6.0
        };
        let mut before = of_spring(0);
        for i in 0..n {
            let next = if i + 1 < n { of_spring(i + 1) } else { load };
            if self.mixed {
                out[i] = x[n + i] - before;
                out[n + i] = x[n + i] - if i + 1 < n { x[n + i + 1] } else { load };
            } else {
                out[i] = before - next;
            }
            before = next;
        }
    }
}

#[test]
fn a_stiffening_chain_of_forty_is_proven_with_few_nodes() {
    let map = Traced::new(Springs { n: 40, mixed: false });
    let options = EnumerationOptions::default().with_max_nodes(2_000);
    for (e, alpha) in [(0.5, 0.5), (1.0, 1.0), (1.5, 2.5), (3.0, 13.0)] {
        let set = all_solutions(&map, alpha, &options).unwrap();
        assert_eq!(set.completeness, Completeness::Complete, "α = {alpha}");
        assert_eq!(set.solutions.len(), 1);
        let solution = &set.solutions[0];
        assert!(
            (0..40).all(|i| (solution.x[i] - e * (i + 1) as f64).abs() < 1e-12) && solution.x.len() == 41
        );
        // At the kink 2⁴⁰ selections meet.
        if e == 1.0 {
            assert_eq!(solution.num_selections, 40f64.exp2());
            assert!(solution.selections.len() <= 256 && solution.det_signs.iter().all(|d| *d == Some(1)));
        } else {
            assert_eq!((solution.num_selections, set.index_sum), (1.0, Some(1)));
        }
    }
    let mut x: Vec<f64> = (1..=40).map(f64::from).collect();
    x.push(1.0);
    let arms = all_arms(&map, &x, &options).unwrap();
    assert_eq!(
        (arms.completeness, arms.orientation),
        (Completeness::Complete, Some((1, 1)))
    );
    assert_eq!(arms.arms.len(), 2);
}

/// Twice as many unknowns, with few of them in each row, are eliminated as well.
#[test]
fn a_stiffening_chain_is_proven_with_its_forces_as_unknowns() {
    let map = Traced::new(Springs { n: 40, mixed: true });
    for (e, alpha) in [(0.5, 0.5), (1.0, 1.0), (1.5, 2.5), (2.0, 4.0), (3.0, 13.0)] {
        let set = all_solutions(&map, alpha, &EnumerationOptions::default()).unwrap();
        assert_eq!(set.completeness, Completeness::Complete, "α = {alpha}");
        assert_eq!(set.solutions.len(), 1);
        let x = &set.solutions[0].x;
        assert!(
            (0..40).all(|i| (x[i] - e * (i + 1) as f64).abs() < 1e-12 && (x[40 + i] - alpha).abs() < 1e-12)
        );
        let kink = e == 1.0 || e == 2.0;
        assert_eq!(
            set.solutions[0].num_selections,
            if kink { 40f64.exp2() } else { 1.0 }
        );
        assert!(set.nodes < 20_000);
    }
}

/// A spring of stiffness 2 pressed against a buffer: the force λ ≥ 0 of the buffer is 4 (v − 1) for v ≥ 1, cut off at 2.
#[derive(Clone)]
struct Buffer;

impl NonsmoothFunction for Buffer {
    fn num_vars(&self) -> usize {
        3
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[1] - kinks.project(T::from(0.0), (x[0] - 1.0) * 4.0, T::from(2.0));
    }
}

#[test]
fn laws_written_as_formulas_are_proven_in_both_forms() {
    let one = |v: f64| Matrix::from_rows(&[[v]]).unwrap();
    let problem = InterfaceProblem::from_parts(
        one(2.0),
        &one(1.0),
        LoadPath::affine(vec![0.0], vec![1.0]),
        Traced::new(Buffer),
    )
    .unwrap();
    let condensed = problem.condensed().unwrap();
    // 2 v + λ = α: v = α/2, (α + 4)/6, (α − 2)/2.
    for (alpha, v, force) in [
        (1.0, 0.5, 0.0),
        (3.5, 1.25, 1.0),
        (8.0, 3.0, 2.0),
        (2.0, 1.0, 0.0),
    ] {
        let full = all_solutions(&problem, alpha, &EnumerationOptions::default()).unwrap();
        let small = all_solutions(&condensed, alpha, &EnumerationOptions::default()).unwrap();
        for (set, wanted) in [(full, vec![v, force, alpha]), (small, vec![force, alpha])] {
            assert_eq!(set.completeness, Completeness::Complete, "α = {alpha}");
            assert_eq!(set.solutions.len(), 1);
            let near = set.solutions[0]
                .x
                .iter()
                .zip(&wanted)
                .all(|(a, b)| (a - b).abs() < 1e-14);
            assert!(
                near && set.solutions[0].x.len() == wanted.len(),
                "{:?}",
                set.solutions[0]
            );
            assert!(set.solutions[0].det_signs.iter().all(|d| *d == Some(1)));
        }
    }
    let arms = all_arms(&condensed, &[0.0, 2.0], &EnumerationOptions::default()).unwrap();
    assert_eq!((arms.completeness, arms.arms.len()), (Completeness::Complete, 2));
}

/// switch(x, x + jump, −x) + x/2 = load: the absolute value if there is no jump.
#[derive(Clone)]
struct Switched {
    jump: f64,
    load: f64,
}

impl NonsmoothFunction for Switched {
    fn num_vars(&self) -> usize {
        1
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = kinks.switch(x[0], x[0] + self.jump, -x[0]) + x[0] * 0.5 - self.load;
    }
}

#[test]
fn switched_formulas_are_proven_where_their_pieces_agree() {
    let list = |jump, load| {
        let map = Traced::new(Switched { jump, load });
        all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap()
    };
    let absolute = list(0.0, 3.0);
    let points: Vec<f64> = absolute.solutions.iter().map(|s| s.x[0]).collect();
    assert_eq!(points, [2.0, -6.0]);
    assert_eq!(absolute.index_sum, Some(0));
    assert!(absolute.completeness.is_complete());
    // A solution of a single piece lies on the facet.
    let jumping = list(1.0, 0.0).completeness;
    assert!(
        matches!(
            jumping,
            Completeness::Undecided {
                doubt: Doubt::Discontinuous,
                ..
            }
        ),
        "{jumping}"
    );
    assert_eq!(
        jumping.to_string(),
        "not proven, 1 undecided: the pieces do not agree on a facet between them"
    );
}

/// min(x, m x − 3), which vanishes at 3/m alone.
struct Far(f64);

impl NonsmoothFunction for Far {
    fn num_vars(&self) -> usize {
        1
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = kinks.min(x[0], x[0] * self.0 - 3.0);
    }
}

#[test]
fn solutions_that_are_no_floating_point_numbers_are_not_listed_and_leave_the_list_unproven() {
    let options = EnumerationOptions::default();
    let near = all_solutions(&Traced::new(Far(1e-300)), 0.0, &options).unwrap();
    assert!(near.completeness.is_complete() && near.solutions.len() == 1);
    assert!((near.solutions[0].x[0] / 3e300 - 1.0).abs() < 1e-8);
    let far = all_solutions(&Traced::new(Far(5e-324)), 0.0, &options).unwrap();
    assert!(far.solutions.is_empty() && far.index_sum.is_none(), "{far}");
    let doubt = Doubt::Overflow;
    assert_eq!(far.completeness, Completeness::Undecided { selections: 1, doubt });
}
