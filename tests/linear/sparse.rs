//! Patterns, matrices and files of them.

use std::path::PathBuf;

use proptest::prelude::*;
use semismooth::InputError;
use semismooth::sparse::{
    Matrix, Pattern, parse_matrix_market, parse_vector, read_matrix_market, read_vector, write_matrix_market,
};

type Triplets = Vec<(usize, usize, f64)>;

fn triplets(max: usize) -> impl Strategy<Value = (usize, usize, Triplets)> {
    (1..max, 1..max).prop_flat_map(|(m, n)| {
        let entry = (0..m, 0..n, -1e3..1e3_f64);
        (Just(m), Just(n), prop::collection::vec(entry, 0..40))
    })
}

fn to_dense(m: usize, n: usize, triplets: &Triplets) -> Vec<Vec<f64>> {
    let mut dense = vec![vec![0.0; n]; m];
    for &(i, j, v) in triplets {
        dense[i][j] += v;
    }
    dense
}

fn scratch_file(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    dir.join(format!("{name}-{}.mtx", std::process::id()))
}

proptest! {
    #[test]
    fn triplets_match_dense((m, n, t) in triplets(12)) {
        let a = Matrix::from_triplets(m, n, &t).unwrap();
        let dense = to_dense(m, n, &t);
        let back = a.transpose();
        for i in 0..m {
            for j in 0..n {
                prop_assert_eq!(a.get(i, j), dense[i][j]);
                prop_assert_eq!(back.get(j, i), dense[i][j]);
            }
        }
        prop_assert_eq!(back.transpose(), a.clone());
        let full = Matrix::from_rows(&dense).unwrap();
        prop_assert!(full.pattern().is_full());
        let x: Vec<f64> = (0..n).map(|j| (j as f64).cos()).collect();
        let (mut y, mut z) = (vec![9.0; m], vec![9.0; m]);
        a.mul_vec(&x, &mut y);
        for i in 0..m {
            z[i] = (0..n).map(|j| dense[i][j] * x[j]).sum();
            prop_assert!((y[i] - z[i]).abs() < 1e-9);
        }
        // ⟨A x, w⟩ = ⟨x, Aᵀ w⟩.
        let w: Vec<f64> = (0..m).map(|i| (i as f64).sin()).collect();
        let mut v = vec![9.0; n];
        a.mul_transpose_vec(&w, &mut v);
        let left: f64 = y.iter().zip(&w).map(|(a, b)| a * b).sum();
        let right: f64 = x.iter().zip(&v).map(|(a, b)| a * b).sum();
        prop_assert!((left - right).abs() < 1e-8);
        let norm = (0..n).map(|j| (0..m).map(|i| dense[i][j].abs()).sum()).fold(0.0, f64::max);
        prop_assert!((a.as_ref().norm_1() - norm).abs() < 1e-9);
    }

    #[test]
    fn blocks_add_up((m, n, t) in triplets(6), row in 0_usize..4, col in 0_usize..4) {
        let block = Matrix::from_triplets(m, n, &t).unwrap();
        let mut a = Matrix::zeros(Pattern::full(8, 8));
        a.add_block(row, col, -2.0, &block);
        let fits = block.triplets().all(|(i, j, _)| row + i < 8 && col + j < 8) && col + n <= 8;
        prop_assert_eq!(a.stray().is_none(), fits);
        if fits {
            for i in 0..8 {
                for j in 0..8 {
                    let inside = i >= row && j >= col;
                    let v = if inside { -2.0 * block.get(i - row, j - col) } else { 0.0 };
                    prop_assert_eq!(a.get(i, j), v);
                }
            }
        }
        a.clear();
        prop_assert!(a.stray().is_none() && a.values().iter().all(|v| *v == 0.0));
    }

    #[test]
    fn text_of_any_kind_does_not_panic(text in "\\PC{0,80}", head in 0_usize..5) {
        let heads = [
            "",
            "%%MatrixMarket matrix coordinate real general\n",
            "%%MatrixMarket matrix array real symmetric\n2 2\n",
            "%%MatrixMarket matrix coordinate integer skew-symmetric\n3 3 2\n",
            "%%MatrixMarket matrix array real general\n",
        ];
        let _ = parse_matrix_market(&format!("{}{text}", heads[head]));
        let _ = parse_vector(&text);
    }

    #[test]
    fn numbers_of_any_kind_do_not_panic(
        head in 0_usize..4,
        words in prop::collection::vec(0_usize..5, 0..24),
    ) {
        let heads = ["coordinate real general", "array real general", "array real symmetric",
            "array integer skew-symmetric"];
        let mut text = format!("%%MatrixMarket matrix {}\n", heads[head]);
        for (k, w) in words.iter().enumerate() {
            text.push_str(&w.to_string());
            text.push(if k % 3 == 2 { '\n' } else { ' ' });
        }
        if let Ok(a) = parse_matrix_market(&text) {
            prop_assert!(a.check_finite().is_ok());
        }
    }
}

#[test]
fn written_matrices_are_read_back_exactly() {
    let path = scratch_file("round-trip");
    let config = ProptestConfig::with_cases(32);
    proptest!(config, |((m, n, t) in triplets(12), tiny in prop::num::f64::NORMAL)| {
        let mut a = Matrix::from_triplets(m, n, &t).unwrap();
        if let Some(v) = a.values_mut().first_mut() {
            *v = tiny;
        }
        write_matrix_market(&path, &a).unwrap();
        prop_assert_eq!(read_matrix_market(&path).unwrap(), a);
    });
    std::fs::remove_file(path).unwrap();
}

#[test]
fn formats_and_symmetries() {
    let rows = |text: &str| {
        let a = parse_matrix_market(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        (0..a.nrows())
            .map(|i| (0..a.ncols()).map(|j| a.get(i, j)).collect())
            .collect::<Vec<Vec<f64>>>()
    };
    let cases = [
        (
            "%%MatrixMarket matrix array real general\n% rows run first\n2 3\n1 2\n3\n\n4\n5\n6\n",
            vec![vec![1.0, 3.0, 5.0], vec![2.0, 4.0, 6.0]],
        ),
        (
            "%%matrixmarket MATRIX Array Integer Symmetric\n2 2\n1\n2\n3\n",
            vec![vec![1.0, 2.0], vec![2.0, 3.0]],
        ),
        (
            "%%MatrixMarket matrix array real skew-symmetric\n3 3\n1\n2\n3\n",
            vec![vec![0.0, -1.0, -2.0], vec![1.0, 0.0, -3.0], vec![2.0, 3.0, 0.0]],
        ),
        (
            "%%MatrixMarket matrix coordinate real general\r\n%\r\n\r\n2 2 3\r\n1 2 1e1\r\n1 2 -0.5\r\n2 1 +7\r\n",
            vec![vec![0.0, 9.5], vec![7.0, 0.0]],
        ),
        (
            "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n2 1 3\n",
            vec![vec![0.0, -3.0], vec![3.0, 0.0]],
        ),
        (
            "%%MatrixMarket matrix array real skew-symmetric\n1 1\n",
            vec![vec![0.0]],
        ),
        ("%%MatrixMarket matrix coordinate real general\n0 0 0\n", vec![]),
    ];
    for (text, expected) in cases {
        assert_eq!(rows(text), expected, "{text}");
    }
    let full = parse_matrix_market("%%MatrixMarket matrix array real general\n1 2\n0\n0\n");
    assert!(full.unwrap().pattern().is_full());
}

#[test]
fn broken_files_are_named_with_their_line() {
    let general = "%%MatrixMarket matrix coordinate real general\n";
    let cases = [
        ("", 1, "empty"),
        ("1 1 1\n", 1, "%%MatrixMarket"),
        ("%%MatrixMarket vector coordinate real general\n", 1, "vector"),
        ("%%MatrixMarket matrix coordinate complex general\n", 1, "complex"),
        ("%%MatrixMarket matrix coordinate pattern general\n", 1, "pattern"),
        (
            "%%MatrixMarket matrix coordinate real hermitian\n",
            1,
            "hermitian",
        ),
        ("%%MatrixMarket matrix skyline real general\n", 1, "skyline"),
        (&format!("{general}% no more\n"), 2, "sizes is missing"),
        (&format!("{general}2 2\n"), 2, "expected 3 sizes"),
        (&format!("{general}2 -2 1\n"), 2, "expected 3 sizes"),
        (
            &format!("{general}2 2 1\n% a\n0 1 3\n"),
            4,
            "row 0 is outside 1..=2",
        ),
        (
            &format!("{general}2 2 1\n1 3 3\n"),
            3,
            "column 3 is outside 1..=2",
        ),
        (
            &format!("{general}2 2 1\n1 1\n"),
            3,
            "expected `row column value`",
        ),
        (
            &format!("{general}2 2 1\n1 1 1 0\n"),
            3,
            "expected `row column value`",
        ),
        (&format!("{general}2 2 1\n1 1 x\n"), 3, "`x` is not a number"),
        (&format!("{general}2 2 1\n1 1 nan\n"), 3, "not a finite number"),
        (&format!("{general}2 2 1\n1 1 1e999\n"), 3, "not a finite number"),
        (
            &format!("{general}2 2 2\n1 1 1\n"),
            3,
            "1 entries found, 2 announced",
        ),
        (
            &format!("{general}2 2 1\n1 1 1\n1 2 1\n"),
            4,
            "more than the 1 entries",
        ),
        (
            &format!("{general}1 1 2\n1 1 1e308\n1 1 1e308\n"),
            4,
            "sum up to infinity",
        ),
        (&format!("{general}99999999999 1 1\n1 1 1\n"), 2, "larger than"),
        (&format!("{general}1 2000000000 1\n1 1 1\n"), 2, "cannot be meant"),
        (
            &format!("{general}2 2 18446744073709551615\n1 1 1\n"),
            3,
            "announced",
        ),
        (
            "%%MatrixMarket matrix array real general\n100000 100000\n1\n",
            3,
            "announced",
        ),
        (
            "%%MatrixMarket matrix array real symmetric\n2 3\n1\n",
            2,
            "cannot be 2 x 3",
        ),
        (
            "%%MatrixMarket matrix coordinate real symmetric\n2 2 1\n1 2 1\n",
            3,
            "lower triangle",
        ),
        (
            "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n1 1 1\n",
            3,
            "diagonal",
        ),
    ];
    for (text, at, words) in cases {
        let e = parse_matrix_market(text).unwrap_err();
        let InputError::Parse { line, what, .. } = &e else {
            panic!("{text}: {e}");
        };
        assert!(*line == at && what.contains(words), "{text:?}: {e}");
        assert!(e.to_string().starts_with("<text>, line "));
    }
    let missing = scratch_file("missing");
    let e = read_matrix_market(&missing).unwrap_err();
    assert!(
        matches!(&e, InputError::Io { path, .. } if *path == missing),
        "{e}"
    );
    let nan = Matrix::from_triplets(1, 1, &[(0, 0, f64::NAN)]).unwrap();
    let e = write_matrix_market(&missing, &nan).unwrap_err();
    assert!(matches!(e, InputError::Entry { .. }) && !missing.exists());
    let nowhere = missing.join("file");
    let e = write_matrix_market(&nowhere, &Matrix::identity(1)).unwrap_err();
    assert!(matches!(e, InputError::Io { .. }), "{e}");
}

#[test]
fn vectors() {
    let path = scratch_file("vector");
    std::fs::write(&path, "# head\n1.5\n\n% more\n-2 3e-3 # two\n4").unwrap();
    assert_eq!(read_vector(&path).unwrap(), [1.5, -2.0, 3e-3, 4.0]);
    std::fs::write(&path, "1\n2 inf\n").unwrap();
    let e = read_vector(&path).unwrap_err();
    let named = matches!(&e, InputError::Parse { line: 2, path: p, .. } if *p == path);
    assert!(named, "{e}");
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(read_vector(&path), Err(InputError::Io { .. })));
    assert_eq!(parse_vector("").unwrap(), [0.0; 0]);
}

#[test]
fn patterns_and_matrices_refuse_what_does_not_fit() {
    let entry = InputError::OutOfBounds {
        row: 2,
        col: 0,
        nrows: 2,
        ncols: 3,
    };
    assert_eq!(Pattern::from_entries(2, 3, [(2, 0)]), Err(entry.clone()));
    assert_eq!(Matrix::from_triplets(2, 3, &[(2, 0, 1.0)]), Err(entry));
    for (col_ptr, row_idx) in [
        (vec![0, 1], vec![0]),
        (vec![0, 1, 3], vec![0]),
        (vec![1, 1, 1], vec![0]),
        (vec![0, 2, 1], vec![0]),
        (vec![0, 2, 2], vec![1, 0]),
        (vec![0, 2, 2], vec![1, 1]),
    ] {
        let e = Pattern::from_csc(2, 2, col_ptr, row_idx).unwrap_err();
        assert!(matches!(e, InputError::Malformed { .. }), "{e}");
    }
    let e = Pattern::from_csc(2, 1, vec![0, 1], vec![2]).unwrap_err();
    assert!(matches!(e, InputError::OutOfBounds { row: 2, .. }), "{e}");
    let e = Matrix::from_values(Pattern::full(1, 2), vec![1.0]).unwrap_err();
    assert!(
        matches!(
            e,
            InputError::Length {
                expected: 2,
                found: 1,
                ..
            }
        ),
        "{e}"
    );
    let ragged: [&[f64]; 2] = [&[1.0], &[1.0, 2.0]];
    assert!(matches!(
        Matrix::from_rows(&ragged),
        Err(InputError::Length { .. })
    ));
    let mut a = Matrix::identity(2);
    a.add(0, 1, 1.0);
    assert_eq!(a.stray(), Some((0, 1)));
    a.values_mut()[1] = f64::NAN;
    let e = a.check_finite().unwrap_err();
    assert!(matches!(e, InputError::Entry { row: 1, col: 1, .. }), "{e}");
}
