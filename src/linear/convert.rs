//! Conversions to and from the matrices of other crates, each behind its feature; no other signature has foreign types.

#[cfg(feature = "convert-nalgebra")]
mod nalgebra_dense {
    use nalgebra::DMatrix;

    use crate::sparse::Matrix;

    /// A matrix with a full pattern.
    impl From<&DMatrix<f64>> for Matrix {
        fn from(a: &DMatrix<f64>) -> Self {
            super::full(a.nrows(), a.ncols(), |i, j| a[(i, j)])
        }
    }

    impl From<&Matrix> for DMatrix<f64> {
        fn from(a: &Matrix) -> Self {
            let mut dense = Self::zeros(a.nrows(), a.ncols());
            a.triplets().for_each(|(i, j, v)| dense[(i, j)] = v);
            dense
        }
    }
}

#[cfg(feature = "convert-faer")]
mod faer_matrices {
    use faer::Mat;
    use faer::sparse::{SparseColMat, SymbolicSparseColMat};

    use crate::InputError;
    use crate::sparse::Matrix;

    /// A matrix with a full pattern.
    impl From<&Mat<f64>> for Matrix {
        fn from(a: &Mat<f64>) -> Self {
            super::full(a.nrows(), a.ncols(), |i, j| a[(i, j)])
        }
    }

    impl From<&Matrix> for Mat<f64> {
        fn from(a: &Matrix) -> Self {
            Self::from_fn(a.nrows(), a.ncols(), |i, j| a.get(i, j))
        }
    }

    /// Entries given twice are added.
    impl TryFrom<&SparseColMat<usize, f64>> for Matrix {
        type Error = InputError;

        fn try_from(a: &SparseColMat<usize, f64>) -> Result<Self, InputError> {
            let entries: Vec<_> = a.triplet_iter().map(|t| (t.row, t.col, *t.val)).collect();
            Self::from_triplets(a.nrows(), a.ncols(), &entries)
        }
    }

    impl From<&Matrix> for SparseColMat<usize, f64> {
        fn from(a: &Matrix) -> Self {
            let pattern = a.pattern();
            let (col_ptr, row_idx) = (pattern.col_ptr().to_vec(), pattern.row_idx().to_vec());
            let symbolic = SymbolicSparseColMat::new_checked(a.nrows(), a.ncols(), col_ptr, None, row_idx);
            Self::new(symbolic, a.values().to_vec())
        }
    }
}

#[cfg(feature = "convert-nalgebra-sparse")]
mod nalgebra_sparse_matrices {
    use nalgebra_sparse::{CooMatrix, CscMatrix};

    use crate::InputError;
    use crate::sparse::Matrix;

    impl TryFrom<&CscMatrix<f64>> for Matrix {
        type Error = InputError;

        fn try_from(a: &CscMatrix<f64>) -> Result<Self, InputError> {
            let entries: Vec<_> = a.triplet_iter().map(|(i, j, v)| (i, j, *v)).collect();
            Self::from_triplets(a.nrows(), a.ncols(), &entries)
        }
    }

    impl From<&Matrix> for CscMatrix<f64> {
        fn from(a: &Matrix) -> Self {
            let mut entries = CooMatrix::zeros(a.nrows(), a.ncols());
            a.triplets().for_each(|(i, j, v)| entries.push(i, j, v));
            Self::from(&entries)
        }
    }
}

#[cfg(feature = "convert-sprs")]
mod sprs_matrices {
    use sprs::CsMat;

    use crate::InputError;
    use crate::sparse::Matrix;

    /// Stored by rows or by columns.
    impl TryFrom<&CsMat<f64>> for Matrix {
        type Error = InputError;

        fn try_from(a: &CsMat<f64>) -> Result<Self, InputError> {
            let entries: Vec<_> = a.iter().map(|(v, (i, j))| (i, j, *v)).collect();
            Self::from_triplets(a.rows(), a.cols(), &entries)
        }
    }

    /// Stored by columns.
    impl From<&Matrix> for CsMat<f64> {
        fn from(a: &Matrix) -> Self {
            let pattern = a.pattern();
            let (col_ptr, row_idx) = (pattern.col_ptr().to_vec(), pattern.row_idx().to_vec());
            Self::new_csc((a.nrows(), a.ncols()), col_ptr, row_idx, a.values().to_vec())
        }
    }
}

#[cfg(any(feature = "convert-nalgebra", feature = "convert-faer"))]
fn full(rows: usize, cols: usize, entry: impl Fn(usize, usize) -> f64) -> crate::sparse::Matrix {
    use crate::sparse::{Matrix, Pattern};

    let mut a = Matrix::zeros(Pattern::full(rows, cols));
    for (j, column) in a.values_mut().chunks_exact_mut(rows.max(1)).enumerate() {
        for (i, v) in column.iter_mut().enumerate() {
            *v = entry(i, j);
        }
    }
    a
}
