//! Matrices of other crates there and back.
#![cfg(all(
    feature = "convert-faer",
    feature = "convert-nalgebra",
    feature = "convert-nalgebra-sparse",
    feature = "convert-sprs"
))]

use proptest::prelude::*;
use semismooth::sparse::Matrix;

fn dense(a: &Matrix) -> Vec<Vec<f64>> {
    (0..a.nrows())
        .map(|i| (0..a.ncols()).map(|j| a.get(i, j)).collect())
        .collect()
}

proptest! {
    #[test]
    fn every_matrix_comes_back(
        rows in 1..6usize,
        cols in 1..6usize,
        entries in prop::collection::vec((0..6usize, 0..6usize, -4.0..4.0f64), 0..20),
    ) {
        let entries: Vec<_> = entries.into_iter().map(|(i, j, v)| (i % rows, j % cols, v)).collect();
        let a = Matrix::from_triplets(rows, cols, &entries).unwrap();
        let sparse: faer::sparse::SparseColMat<usize, f64> = (&a).into();
        prop_assert_eq!(&Matrix::try_from(&sparse).unwrap(), &a);
        let sparse: nalgebra_sparse::CscMatrix<f64> = (&a).into();
        prop_assert_eq!(&Matrix::try_from(&sparse).unwrap(), &a);
        let sparse: sprs::CsMat<f64> = (&a).into();
        prop_assert_eq!(&Matrix::try_from(&sparse).unwrap(), &a);
        prop_assert_eq!(&Matrix::try_from(&sparse.to_csr()).unwrap(), &a);
        let full: nalgebra::DMatrix<f64> = (&a).into();
        prop_assert_eq!(dense(&Matrix::from(&full)), dense(&a));
        let full: faer::Mat<f64> = (&a).into();
        prop_assert_eq!(dense(&Matrix::from(&full)), dense(&a));
    }
}
