use super::error::check_length;
use super::{ContactError, LoadPath};
use crate::sparse::Matrix;

/// A discrete elastic body with contact nodes, without a law of friction: A u = f(α) − Bνᵀ λν − Σ Btᵀ λt, u_ν = Bν u ≤ gap.
///
/// One tangential trace in the plane, two in space. Matrices as in [`FrictionProblem`](super::FrictionProblem), for instance from
/// [`fem`](crate::fem).
#[derive(Debug, Clone)]
pub struct ContactBody {
    pub(super) a: Matrix,
    /// Bν, Bt₁ and, in space, Bt₂: p × n each.
    pub(super) traces: Vec<Matrix>,
    pub(super) gap: Vec<f64>,
    pub(super) load: LoadPath,
}

impl ContactBody {
    /// A body with its normal trace, one or two tangential traces, and a load; gap 0.
    ///
    /// # Errors
    /// Empty problems, wrong shapes, entries that are not finite.
    pub fn new(
        a: Matrix,
        normal: Matrix,
        tangential: Vec<Matrix>,
        load: LoadPath,
    ) -> Result<Self, ContactError> {
        let (n, p) = (a.nrows(), normal.nrows());
        if n == 0 {
            return Err(ContactError::Empty {
                what: "there are no displacements",
            });
        }
        if p == 0 {
            return Err(ContactError::Empty {
                what: "there are no contact nodes",
            });
        }
        if tangential.is_empty() || tangential.len() > 2 {
            return Err(ContactError::Tangents {
                law: 1,
                body: tangential.len(),
            });
        }
        let mut traces = vec![normal];
        traces.extend(tangential);
        let names = [
            "the normal trace",
            "the tangential trace",
            "the second tangential trace",
        ];
        for (what, matrix, rows) in std::iter::once(("the stiffness matrix A", &a, n))
            .chain(names.into_iter().zip(&traces).map(|(what, m)| (what, m, p)))
        {
            if matrix.nrows() != rows || matrix.ncols() != n {
                return Err(ContactError::Shape {
                    what,
                    rows,
                    cols: n,
                    found_rows: matrix.nrows(),
                    found_cols: matrix.ncols(),
                });
            }
            matrix
                .check_finite()
                .map_err(|source| ContactError::Matrix { what, source })?;
        }
        load.0.check("the load", n)?;
        Ok(Self {
            a,
            traces,
            gap: vec![0.0; p],
            load,
        })
    }

    /// Sets the initial gap of each contact node: u_ν ≤ gap.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn with_gap(mut self, gap: Vec<f64>) -> Result<Self, ContactError> {
        check_length("the gap", &gap, self.num_contacts())?;
        self.gap = gap;
        Ok(self)
    }

    /// The load f(α).
    #[must_use]
    pub fn load_at(&self, alpha: f64) -> Vec<f64> {
        let n = self.num_displacements();
        let (mut f, mut rate) = (vec![0.0; n], vec![0.0; n]);
        self.load.0.value(alpha, &mut f, &mut rate);
        f
    }

    /// Number n of displacements.
    #[must_use]
    pub fn num_displacements(&self) -> usize {
        self.a.nrows()
    }

    /// Number p of contact nodes.
    #[must_use]
    pub fn num_contacts(&self) -> usize {
        self.gap.len()
    }

    /// 1 in the plane, 2 in space.
    #[must_use]
    pub fn num_tangents(&self) -> usize {
        self.traces.len() - 1
    }

    /// The stiffness matrix A.
    #[must_use]
    pub fn stiffness(&self) -> &Matrix {
        &self.a
    }
}
