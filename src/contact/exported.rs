//! Bodies whose matrices another program has written.

use super::{ContactBody, ContactError, LoadPath};
use crate::sparse::Matrix;
use crate::tolerances::{CHECKED, SIX_DIGITS};

impl ContactBody {
    /// As [`new`](Self::new), for matrices that another program has written, such as a statically condensed substructure: where rounding
    /// of a file has made A unsymmetric, by more than 1e-10 and at most 1e-6 of its largest entry, (A + Aᵀ)/2 is taken, and a sentence
    /// says so and where they differ most. With larger differences A is kept, as the full form takes it.
    ///
    /// ```
    /// use semismooth::contact::{ContactBody, LoadPath};
    /// use semismooth::sparse::Matrix;
    /// let a = Matrix::from_rows(&[[2.0, 0.50000002], [0.5, 2.0]])?;
    /// let traces = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]));
    /// let [normal, tangential] = traces;
    /// let load = LoadPath::constant(vec![1.0, 0.0]);
    /// let (body, note) = ContactBody::exported(a, normal?, vec![tangential?], load)?;
    /// assert!(note.unwrap().contains("entries (1, 0) and (0, 1) differ by 2.0e-8"));
    /// assert_eq!(body.stiffness().get(0, 1), body.stiffness().get(1, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn exported(
        a: Matrix,
        normal: Matrix,
        tangential: Vec<Matrix>,
        load: LoadPath,
    ) -> Result<(Self, Option<String>), ContactError> {
        super::body::check_matrices(&a, &[&normal])?;
        // Differences of a_ij and a_ji are rounding of 64-bit numbers (as in the condensed form), or of files
        // with seven digits or more; larger ones are meant.
        let found = a.asymmetry(CHECKED);
        let (Some((row, col, difference)), None) = (found, a.asymmetry(SIX_DIGITS)) else {
            return Ok((Self::new(a, normal, tangential, load)?, None));
        };
        let halves = a
            .triplets()
            .flat_map(|(i, j, v)| [(i, j, 0.5 * v), (j, i, 0.5 * v)]);
        let halves: Vec<_> = halves.collect();
        let symmetric = Matrix::from_triplets(a.nrows(), a.nrows(), &halves)?;
        let note = format!(
            "the stiffness matrix is not symmetric: entries ({row}, {col}) and ({col}, {row}) differ by {difference:.1e}; its symmetric \
             part is taken"
        );
        Ok((Self::new(symmetric, normal, tangential, load)?, Some(note)))
    }
}
