//! Units of parameters.

use crate::complementarity::ComplementarityError;
use crate::sparse::Matrix;
use crate::variational::Polyhedron;

/// Units in proportion to the widths of bounds, the widest having 1, as those without a finite one: powers of two, so that they round nothing.
/// Steps, and the first metric, are those of parameters in these units: Young's modulus may stand beside a coefficient of friction.
pub(super) fn of(set: &Polyhedron) -> Vec<f64> {
    let widths: Vec<f64> = (set.lower().iter().zip(set.upper()))
        .map(|(l, u)| u - l)
        .collect();
    let is_known = |w: &f64| *w > 0.0 && w.is_finite();
    let widest = widths.iter().copied().filter(is_known).fold(0.0, f64::max);
    let unit = |w: &f64| match is_known(w) {
        true => (w / widest).log2().round().exp2(),
        false => 1.0,
    };
    widths.iter().map(unit).collect()
}

/// The set in these units.
pub(super) fn scaled(set: &Polyhedron, units: &[f64]) -> Result<Polyhedron, ComplementarityError> {
    let [lower, upper] =
        [set.lower(), set.upper()].map(|b| b.iter().zip(units).map(|(b, s)| b / s).collect());
    let mut made = Polyhedron::boxed(lower, upper)?;
    for (kind, rows) in set.rows().into_iter().enumerate() {
        let mut entries = Vec::new();
        for (i, (row, _)) in rows.iter().enumerate() {
            entries.extend(row.iter().map(|(j, v)| (i, *j, v * units[*j])));
        }
        let matrix = Matrix::from_triplets(rows.len(), units.len(), &entries)?;
        let right = rows.iter().map(|row| row.1).collect();
        made = match kind {
            0 => made.with_inequalities(matrix, right)?,
            _ => made.with_equations(matrix, right)?,
        };
    }
    Ok(made)
}
