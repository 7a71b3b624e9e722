//! Bordered systems against the explicit square system of order n + 1.

use proptest::prelude::*;
use semismooth::InputError;
use semismooth::linear::{AutoSolver, Bordered, DENSE_LIMIT, DenseLu, LinearError, LinearSolver, SparseLu};
use semismooth::sparse::{Matrix, MatrixRef, Pattern, PatternRef};

/// [∇H; tᵀ] as one full matrix.
fn explicit(h: &Matrix, t: &[f64]) -> Matrix {
    let n = h.nrows();
    let mut full = Matrix::zeros(Pattern::full(n + 1, n + 1));
    full.add_block(0, 0, 1.0, h);
    for (j, &t) in t.iter().enumerate() {
        full.add(n, j, t);
    }
    full
}

fn check(h: &Matrix, t: &[f64], hint: Option<&[f64]>) {
    let n = h.nrows();
    let full = explicit(h, t);
    let mut dense = DenseLu::new();
    dense.analyze(full.pattern().as_ref()).unwrap();
    dense.factor(full.as_ref()).unwrap();
    let (det_sign, log) = dense.log_det().unwrap();

    let mut bordered = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
    bordered.factor(h, hint).unwrap();
    let tau = bordered.tangent().to_vec();
    let mut image = vec![0.0; n];
    h.mul_vec(&tau, &mut image);
    assert!(
        image.iter().all(|v| v.abs() < 1e-12),
        "the tangent is in the kernel"
    );
    assert!((tau.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-14);
    assert_eq!(bordered.orientation(t), Some(det_sign));
    assert_eq!(bordered.orientation(&tau), Some(1));
    let slope: f64 = tau.iter().zip(t).map(|(a, b)| a * b).sum();
    let (sign, own_log) = bordered.log_det().unwrap();
    assert_eq!(sign, 1);
    assert!((own_log + slope.abs().ln() - log).abs() < 1e-9);

    let r: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
    let (mut x, mut expected) = (vec![0.0; n + 1], r.clone());
    expected.push(0.7);
    dense.solve_in_place(&mut expected).unwrap();
    bordered.solve(&r, t, 0.7, &mut x).unwrap();
    let size = expected.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
    for (x, e) in x.iter().zip(&expected) {
        assert!((x - e).abs() < 1e-9 * size, "{x} {e}");
    }

    let g: Vec<f64> = (0..=n).map(|i| (i as f64).sin()).collect();
    let (mut y, mut expected) = (vec![0.0; n], g.clone());
    dense.solve_transpose_in_place(&mut expected).unwrap();
    let s = bordered.solve_transpose(&g, t, &mut y).unwrap();
    y.push(s);
    let size = expected.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
    for (y, e) in y.iter().zip(&expected) {
        assert!((y - e).abs() < 1e-9 * size, "{y} {e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn agrees_with_the_explicit_system(
        n in 1_usize..8,
        entries in prop::collection::vec(-1.0..1.0_f64, 90),
        hint in prop::option::of(prop::collection::vec(-1.0..1.0_f64, 9)),
    ) {
        let h = Matrix::from_values(Pattern::full(n, n + 1), entries[..n * (n + 1)].to_vec()).unwrap();
        let t = &entries[80..=80 + n];
        let full = explicit(&h, t);
        let mut dense = DenseLu::new();
        dense.analyze(full.pattern().as_ref()).unwrap();
        let fit = dense.factor(full.as_ref()).is_ok_and(|()| dense.rcond() > Some(1e-5));
        prop_assume!(fit);
        check(&h, t, hint.as_ref().map(|h| &h[..=n]));
    }
}

#[test]
fn works_where_the_square_part_is_singular() {
    // y² + α at y = 0 next to a regular equation: a smooth fold.
    let fold = Matrix::from_rows(&[[0.0, 0.0, 1.0], [1.0, 2.0, 0.5]]).unwrap();
    let vertical = Matrix::from_rows(&[[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
    for h in [fold, vertical] {
        for hint in [
            None,
            Some([1e-3, 1e-3, 1.0]),
            Some([0.0; 3]),
            Some([1.0, 0.0, 0.0]),
        ] {
            let hint = hint.as_ref().map(|h| &h[..]);
            check(&h, &[1.0, -0.3, 0.2], hint);
            let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
            b.factor(&h, hint).unwrap();
            assert_eq!(b.det_sign(), Some(0));
            assert_eq!(b.orientation(&[0.0, 0.0, 1.0]), Some(0));
            let e = b.solve(&[1.0, 1.0], &[0.0, 0.0, 1.0], 0.0, &mut [0.0; 3]);
            assert!(matches!(e, Err(LinearError::Singular { .. })));
        }
    }
    // Signs of det ∇_yH: -1 and +1.
    for (rows, sign) in [
        ([[2.0, 1.0, 0.0], [1.0, 0.0, 1.0]], -1),
        ([[2.0, 1.0, 0.0], [1.0, 3.0, 1.0]], 1),
    ] {
        let h = Matrix::from_rows(&rows).unwrap();
        for hint in [None, Some([1.0, 0.0, 0.0]), Some([0.0, 1.0, 0.0])] {
            let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
            b.factor(&h, hint.as_ref().map(|h| &h[..])).unwrap();
            assert_eq!(b.det_sign(), Some(sign));
        }
    }
}

/// Rows orthogonal to a given kernel, one of whose components is small: where a hint asks for that coordinate, solutions do not lose the
/// digits of its reciprocal. The last row is met to the rounding of its own terms.
#[test]
fn small_components_of_the_kernel_cost_no_digits() {
    let n = 5;
    for small in [1e-3, 2e-4, 1e-6, 1e-8, 1e-10] {
        let kernel = [small, 0.4, -0.7, 0.3, 0.9, -0.6];
        let square: f64 = kernel.iter().map(|v| v * v).sum();
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                let row: Vec<f64> = (0..=n)
                    .map(|j| ((7 * i * i + 3 * j * j + 5 * i * j + 1) as f64).sin())
                    .collect();
                let along: f64 = row.iter().zip(&kernel).map(|(r, k)| r * k).sum();
                row.iter()
                    .zip(&kernel)
                    .map(|(r, k)| r - along / square * k)
                    .collect()
            })
            .collect();
        let h = Matrix::from_rows(&rows).unwrap();
        let (t, hint) = ([0.3, 0.2, -0.5, 0.1, 0.8, 0.4], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        check(&h, &t, Some(&hint));
        let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
        b.factor(&h, Some(&hint)).unwrap();
        let mut x = [0.0; 6];
        let r: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        b.solve(&r, &t, 0.7, &mut x).unwrap();
        let (mut rest, mut size) = (-0.7, 0.7);
        for (t, x) in t.iter().zip(&x) {
            rest += t * x;
            size += (t * x).abs();
        }
        assert!(f64::abs(rest) <= 8.0 * f64::EPSILON * size, "{small:e}: {rest:e}");
    }
}

/// y₁² + α and y₁ + 2 y₂ + α/2 at y₁ = 0 with y in any unit: the kernel is (−2, 1, 0), and no other vector.
#[test]
fn units_of_unknowns_do_not_enlarge_the_kernel() {
    for unit in [1.0, 1e-20, 1e20] {
        let h = Matrix::from_rows(&[[0.0, 0.0, 1.0], [unit, 2.0 * unit, 0.5]]).unwrap();
        let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
        b.factor(&h, None).unwrap();
        let [x, y, z] = b.tangent() else { panic!() };
        assert!(
            (x + 2.0 * y).abs() < 1e-15 && z.abs() < 1e-15,
            "{unit:e}: {x} {y} {z}"
        );
        assert_eq!(b.det_sign(), Some(0));
    }
}

#[test]
fn a_kernel_too_large_is_named() {
    let h = Matrix::from_rows(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]]).unwrap();
    let kernel = |found| Err(LinearError::Kernel { expected: 1, found });
    let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
    assert_eq!(b.factor(&h, None), kernel(2));
    assert_eq!(b.factor(&h, Some(&[1.0, 0.0, 0.0])), kernel(2));
    let zero = Matrix::zeros(Pattern::full(2, 3));
    assert_eq!(b.factor(&zero, None), kernel(3));
    // And a large one: two empty rows.
    let n = DENSE_LIMIT + 50;
    let t: Vec<_> = (2..n).map(|i| (i, i, 1.0)).collect();
    let h = Matrix::from_triplets(n, n + 1, &t).unwrap();
    let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
    assert_eq!(b.factor(&h, None), kernel(2));
}

/// Tridiagonal with a full last column; `fold` makes ∇_yH singular (a Neumann matrix).
fn tridiagonal(n: usize, fold: bool) -> Matrix {
    let mut t = Vec::new();
    for i in 0..n {
        let ends = usize::from(i == 0) + usize::from(i + 1 == n);
        let diagonal = if fold { 2.0 - ends as f64 } else { 2.5 };
        t.push((i, i, diagonal));
        if i > 0 {
            t.push((i, i - 1, -1.0));
            t.push((i - 1, i, -1.0));
        }
        t.push((i, n, 1.0 + (i as f64).sin() / 2.0));
    }
    Matrix::from_triplets(n, n + 1, &t).unwrap()
}

#[test]
fn large_sparse_systems() {
    let n = 20_000;
    for (fold, hint) in [(false, false), (false, true), (true, false), (true, true)] {
        let h = tridiagonal(n, fold);
        let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
        let guess: Vec<f64> = (0..=n).map(|j| if j < n { 1.0 } else { 1e-4 }).collect();
        b.factor(&h, hint.then_some(&guess[..])).unwrap();
        assert!(!b.solver().is_dense());
        assert_eq!(b.det_sign(), Some(i8::from(!fold)));
        let (r, mut x) = (vec![1.0; n], vec![0.0; n + 1]);
        let t = b.tangent().to_vec();
        b.solve(&r, &t, 0.25, &mut x).unwrap();
        let size = x.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
        let mut image = vec![0.0; n];
        h.mul_vec(&x, &mut image);
        assert!(
            image.iter().all(|y| (y - 1.0).abs() < 1e-12 * size),
            "fold {fold}"
        );
        let dot: f64 = t.iter().zip(&x).map(|(a, b)| a * b).sum();
        assert!((dot - 0.25).abs() < 1e-12 * size);
        h.mul_vec(&t, &mut image);
        assert!(image.iter().all(|y| y.abs() < 1e-12));
        // With the tangent as a hint the frozen coordinate stays the same.
        let (k, made) = (b.frozen(), b.factorisations());
        b.factor(&h, Some(&t)).unwrap();
        assert_eq!((b.frozen(), b.factorisations()), (k, made + 1), "fold {fold}");
    }
}

#[test]
fn a_large_arrow_keeps_its_frozen_coordinate() {
    // The last row is full: ∇H couples all of y with one equation.
    let n = 5000;
    let mut t: Vec<_> = (0..n).map(|i| (i, i, 3.0)).collect();
    t.extend((0..n - 1).map(|j| (n - 1, j, 0.01)));
    t.extend((0..n).map(|i| (i, n, -1.0)));
    let h = Matrix::from_triplets(n, n + 1, &t).unwrap();
    let mut b = Bordered::new(h.pattern(), SparseLu::with_determinants()).unwrap();
    for _ in 0..3 {
        b.factor(&h, None).unwrap();
        assert_eq!((b.frozen(), b.det_sign()), (n, Some(1)));
        let mut x = vec![0.0; n + 1];
        let tau = b.tangent().to_vec();
        b.solve(&vec![1.0; n], &tau, 0.0, &mut x).unwrap();
        let mut image = vec![0.0; n];
        h.mul_vec(&x, &mut image);
        assert!(image.iter().all(|y| (y - 1.0).abs() < 1e-10));
    }
    assert_eq!(b.factorisations(), 3);
}

/// A solver of the user, which provides no determinants: diagonal matrices.
#[derive(Default)]
struct Diagonal(Vec<f64>);

impl LinearSolver for Diagonal {
    fn analyze(&mut self, _: PatternRef<'_>) -> Result<(), LinearError> {
        Ok(())
    }
    fn factor(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        if a.pattern.row_idx.iter().enumerate().any(|(k, &i)| i != k) {
            return Err(LinearError::Solver {
                what: "not diagonal".to_owned(),
            });
        }
        self.0 = a.values.to_vec();
        match self.0.contains(&0.0) {
            true => Err(LinearError::Singular { rcond: 0.0 }),
            false => Ok(()),
        }
    }
    fn solve_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        b.iter_mut().zip(&self.0).for_each(|(b, d)| *b /= d);
        Ok(())
    }
    fn solve_transpose_in_place(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.solve_in_place(b)
    }
}

#[test]
fn a_plugged_in_solver_serves() {
    let triplets = [(0, 0, 2.0), (1, 1, -4.0), (0, 2, 1.0), (1, 2, 1.0)];
    let h = Matrix::from_triplets(2, 3, &triplets).unwrap();
    let mut b = Bordered::new(h.pattern(), Diagonal::default()).unwrap();
    b.factor(&h, None).unwrap();
    assert_eq!(b.frozen(), 2);
    assert_eq!((b.det_sign(), b.log_det()), (None, None));
    assert_eq!(b.orientation(&[0.0, 0.0, 1.0]), None);
    assert!(b.tangent()[2] > 0.0);
    let mut x = [0.0; 3];
    b.solve(&[3.0, -3.0], &[0.0, 0.0, 1.0], 1.0, &mut x).unwrap();
    for (x, e) in x.iter().zip([1.0, 1.0, 1.0]) {
        assert!((x - e).abs() < 1e-14);
    }
    let boxed: Box<dyn LinearSolver> = Box::new(Diagonal::default());
    assert!(Bordered::new(h.pattern(), boxed).is_ok());
}

#[test]
fn bad_input_is_an_error() {
    for (m, n) in [(2, 2), (3, 2), (0, 0)] {
        let e = Bordered::new(&Pattern::full(m, n), AutoSolver::new()).unwrap_err();
        assert!(matches!(e, LinearError::Input(InputError::Length { .. })), "{e}");
    }
    let h = Matrix::from_rows(&[[1.0, 2.0, 3.0], [0.0, 1.0, 1.0]]).unwrap();
    let t = [1.0, 0.0, 0.0];
    let mut b = Bordered::new(h.pattern(), AutoSolver::new()).unwrap();
    let not_factored = Err(LinearError::NotFactored);
    assert_eq!(b.solve(&[0.0; 2], &t, 1.0, &mut [0.0; 3]), not_factored);
    assert_eq!((b.orientation(&t), b.det_sign()), (None, None));
    let other = Matrix::zeros(Pattern::full(1, 2));
    assert_eq!(b.factor(&other, None), Err(LinearError::NotAnalyzed));
    assert!(matches!(
        b.factor(&h, Some(&[1.0])),
        Err(LinearError::Input(InputError::Length { .. }))
    ));
    assert!(matches!(
        b.factor(&h, Some(&[f64::NAN; 3])),
        Err(LinearError::NotFinite { .. })
    ));
    let mut bad = h.clone();
    bad.values_mut()[5] = f64::NAN;
    assert!(matches!(b.factor(&bad, None), Err(LinearError::NotFinite { .. })));
    assert_eq!(b.solve(&[0.0; 2], &t, 1.0, &mut [0.0; 3]), not_factored);
    b.factor(&h, None).unwrap();
    assert!(matches!(
        b.solve(&[0.0; 3], &t, 1.0, &mut [0.0; 3]),
        Err(LinearError::Input(InputError::Length { .. }))
    ));
    assert!(matches!(
        b.solve(&[0.0; 2], &t[..2], 1.0, &mut [0.0; 3]),
        Err(LinearError::Input(InputError::Length { .. }))
    ));
    assert!(matches!(
        b.solve(&[0.0; 2], &t, 1.0, &mut [0.0; 2]),
        Err(LinearError::Input(InputError::Length { .. }))
    ));
    assert!(matches!(
        b.solve(&[0.0; 2], &t, f64::NAN, &mut [0.0; 3]),
        Err(LinearError::NotFinite { .. })
    ));
    assert!(matches!(
        b.solve(&[0.0; 2], &[0.0; 3], 1.0, &mut [0.0; 3]),
        Err(LinearError::Singular { .. })
    ));
    // No equation, one unknown.
    let empty = Matrix::zeros(Pattern::full(0, 1));
    let mut b = Bordered::new(empty.pattern(), AutoSolver::new()).unwrap();
    b.factor(&empty, None).unwrap();
    let mut x = [0.0];
    b.solve(&[], &[2.0], 3.0, &mut x).unwrap();
    assert_eq!((b.tangent(), x), (&[1.0][..], [1.5]));
}
