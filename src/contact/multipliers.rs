//! Stability of a space of multipliers: full rank of the pairing with the displacements, and the discrete inf-sup constant.

use super::ContactError;
use crate::linear::{Condensation, dense_zeros, generalized_eigenvalues, symmetric_eigenvalues};
use crate::sparse::{Matrix, Pattern};
use crate::tolerances::HALF_DIGITS;

/// Checks that the pairing (multipliers × displacements) has full row rank: no non-zero multiplier is orthogonal to all displacements.
///
/// # Complexity
/// Dense: O(k³) operations and 8 k² bytes, k the shorter side of the pairing.
///
/// # Errors
/// [`ContactError::InvisibleMultiplier`] with the rank; entries that are not finite; more than 50 000 rows and columns that are not
/// zero ([`LinearError::TooLarge`](crate::linear::LinearError::TooLarge)).
pub fn check_multipliers(pairing: &Matrix) -> Result<(), ContactError> {
    pairing.check_finite()?;
    let (q, n) = (pairing.nrows(), pairing.ncols());
    let mut squares = vec![0.0; q];
    for (k, _, v) in pairing.triplets() {
        squares[k] += v * v;
    }
    // Rows are scaled to norm 1, so that small faces count like large ones; zero rows do not contribute to the rank.
    let mut seen = 0;
    let rows: Vec<(usize, f64)> = squares
        .iter()
        .map(|s| {
            let place = seen;
            seen += usize::from(*s > 0.0);
            (place, s.sqrt().recip())
        })
        .collect();
    let entries: Vec<(usize, usize, f64)> = (pairing.triplets())
        .filter(|(k, _, _)| squares[*k] > 0.0)
        .map(|(k, j, v)| (rows[k].0, j, v * rows[k].1))
        .collect();
    let mut factor = Matrix::from_triplets(seen, n, &entries)?;
    // B Bᵀ and Bᵀ B have the same rank: the smaller one is formed.
    if seen <= n {
        factor = factor.transpose();
    }
    let order = factor.ncols();
    let (mut column, mut gram) = (vec![0.0; factor.nrows()], dense_zeros(order, order)?);
    for (k, product) in gram.chunks_exact_mut(order.max(1)).enumerate() {
        column.fill(0.0);
        for e in factor.pattern().col_ptr()[k]..factor.pattern().col_ptr()[k + 1] {
            column[factor.pattern().row_idx()[e]] = factor.values()[e];
        }
        factor.mul_transpose_vec(&column, product);
    }
    let gram = Matrix::from_values(Pattern::full(order, order), gram)?;
    let values = symmetric_eigenvalues(&gram)?;
    let largest = values.last().copied().unwrap_or(0.0);
    let rank = values
        .iter()
        .filter(|v| **v > 1e-12 * largest && **v > 0.0)
        .count();
    if rank < q {
        return Err(ContactError::InvisibleMultiplier { expected: q, rank });
    }
    Ok(())
}

/// The discrete inf-sup constant β of a space of multipliers: β² = λmin(S, S_ref), where S = Q K⁻¹ Qᵀ with the pairing Q and the metric K
/// of the displacements, and S_ref the same on a mesh fine enough to represent all displacements. Each argument is (K, Q).
///
/// Qᵀ must pair the same multipliers in the same way with displacements of the space and of one that contains it (the integral
/// itself, not a lumped rule of either mesh). Then μᵀ S μ = sup (μ, v)²/‖v‖² does not exceed μᵀ S_ref μ, and β ≤ 1.
///
/// # Complexity
/// Two condensations ([`Condensation::new`]) and a dense eigenproblem: O(q³) operations for q multipliers.
///
/// # Errors
/// Shapes that do not fit, metrics that are not positive definite, pairings without full row rank; pairings that do not belong together,
/// shown by a generalised eigenvalue above 1 ([`ContactError::Invalid`]).
pub fn inf_sup_constant(
    coarse: (&Matrix, &Matrix),
    reference: (&Matrix, &Matrix),
) -> Result<f64, ContactError> {
    check_multipliers(coarse.1)?;
    let s = Condensation::new(coarse.0, coarse.1)?;
    let s_ref = Condensation::new(reference.0, reference.1)?;
    let values = generalized_eigenvalues(s.compliance(), s_ref.compliance())?;
    let largest = values.last().copied().unwrap_or(0.0);
    if largest > 1.0 + HALF_DIGITS {
        return Err(ContactError::Invalid {
            what: format!(
                "the pairings or spaces do not belong together: a multiplier is seen {:.6} times better by the space than by its \
                 reference; pair both exactly (TraceSpace::pairing) and refine the mesh for the reference",
                largest.sqrt()
            ),
        });
    }
    Ok(values.first().copied().unwrap_or(0.0).clamp(0.0, 1.0).sqrt())
}
