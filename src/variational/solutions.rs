use super::polyhedron::Rows;
use super::{Polyhedron, Vi};
use crate::complementarity::{AffineFunction, ComplementarityError, McpFunction};
use crate::enumeration::{Completeness, Continuum, EnumerationOptions, all_solutions};
use crate::exact::{Dictionary, Exact, quotient};
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use crate::sparse::{Matrix, max_abs};
use crate::tolerances::SAME;
use num_traits::Zero;

/// Part of the least length among the data below which x counts as rounding error.
const ROUNDING: f64 = 1e-15;

/// A problem in other units, and what its multipliers are to be multiplied by.
type Scaled = (Vi<AffineFunction>, Vec<f64>);

/// All solutions of an affine variational inequality.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ViSolutions {
    /// The isolated x, whether their multipliers are unique or not. (An end of a continuum may be among them where its multipliers are not
    /// unique.)
    pub solutions: Vec<Vec<f64>>,
    /// Continua along which x changes, in the variables (x, λ, μ).
    pub continua: Vec<Continuum>,
    /// Whether all selections of the Karush–Kuhn–Tucker conditions were examined, and with what certainty. One decision is made in
    /// floating-point numbers: two x whose multipliers are not unique count as one if no component differs by more than 1e-9 of the larger.
    pub completeness: Completeness,
}

impl<F: McpFunction> Vi<F> {
    /// All solutions of the problem with affine F, by [`all_solutions`] of the conditions [`Vi::kkt`].
    ///
    /// # Complexity
    /// Exponential in the number of inequalities and bounds in the worst case; the search is pruned and observes the limits of its options.
    ///
    /// # Errors
    /// As [`all_solutions`]: F that is not affine, a parametric problem, options out of range.
    pub fn all_solutions(&self, options: &EnumerationOptions) -> Result<ViSolutions, ComplementarityError> {
        let (vars, values) = (self.function().num_vars(), self.set().dimension());
        if vars != values {
            return Err(ComplementarityError::Dimensions {
                vars,
                values,
                expected: "fix the parameter first",
            });
        }
        let Some((same, units)) = self.in_units_of_rows()? else {
            return self.list(options);
        };
        let mut all = same.list(options)?;
        for continuum in &mut all.continua {
            let vectors = continuum.ends.iter_mut().chain(&mut continuum.directions);
            for vector in vectors.chain([&mut continuum.point]) {
                let multipliers = vector.iter_mut().skip(self.set().dimension());
                multipliers.zip(&units).for_each(|(v, unit)| *v *= unit);
            }
            for direction in &mut continuum.directions {
                let largest = max_abs(direction);
                direction.iter_mut().for_each(|v| *v /= largest);
            }
        }
        Ok(all)
    }

    /// The same problem with F and each row of A and E multiplied by powers of two, after which their largest coefficients are near 1, and
    /// what its multipliers λ and μ are to be multiplied by. `None` where F gives no coefficients, or the scaling is not exact.
    fn in_units_of_rows(&self) -> Result<Option<Scaled>, ComplementarityError> {
        let conditions = self.kkt()?;
        let Some((f, _)) = conditions.function().coefficients() else {
            return Ok(None);
        };
        let (set, n) = (self.set(), self.set().dimension());
        let power = |largest: f64| match largest > 0.0 {
            true => (-largest.log2().round()).exp2(),
            false => 1.0,
        };
        let mut exact = true;
        let mut times = |v: f64, by: f64| {
            exact &= v * by / by == v;
            v * by
        };
        let of_f: Vec<_> = f.matrix().triplets().filter(|e| e.0 < n && e.1 < n).collect();
        let slope = of_f.iter().fold(0.0_f64, |m, e| m.max(e.2.abs()));
        let by_f = power(if slope > 0.0 { slope } else { max_abs(&f.q()[..n]) });
        let entries: Vec<_> = of_f.iter().map(|&(i, j, v)| (i, j, times(v, by_f))).collect();
        let q = f.q()[..n].iter().map(|v| times(*v, by_f)).collect();
        let function = AffineFunction::new(Matrix::from_triplets(n, n, &entries)?, q)?;
        let mut units = Vec::new();
        let mut scaled = |rows: &Rows| -> Result<(Matrix, Vec<f64>), ComplementarityError> {
            let (mut entries, mut right) = (Vec::new(), Vec::new());
            for i in 0..rows.len() {
                let by = power(rows.row(i).fold(0.0_f64, |m, (_, v)| m.max(v.abs())));
                entries.extend(rows.row(i).map(|(j, v)| (i, j, times(v, by))));
                right.push(times(rows.right[i], by));
                units.push(by / by_f);
            }
            Ok((Matrix::from_triplets(rows.len(), n, &entries)?, right))
        };
        let ((a, b), (e, d)) = (scaled(&set.a)?, scaled(&set.e)?);
        let set = Polyhedron::boxed(set.lower.clone(), set.upper.clone())?
            .with_inequalities(a, b)?
            .with_equations(e, d)?;
        Ok(exact.then_some((Vi::new(function, set)?, units)))
    }

    fn list(&self, options: &EnumerationOptions) -> Result<ViSolutions, ComplementarityError> {
        let conditions = self.kkt()?;
        let n = self.set().dimension();
        let found = all_solutions(&conditions, 0.0, options)?;
        let mut all = ViSolutions {
            solutions: Vec::new(),
            continua: Vec::new(),
            completeness: found.completeness,
        };
        let Some((f, _)) = conditions.function().coefficients() else {
            all.solutions = found.solutions.into_iter().map(|s| s.x[..n].to_vec()).collect();
            all.continua = found.continua;
            return Ok(all);
        };
        // The multipliers of one x form a convex set: a solution that lies in no continuum is the only one with its x.
        let mut held = vec![false; found.solutions.len()];
        let scale = self.scale(f);
        for continuum in found.continua {
            for selection in &continuum.selections {
                let cell = self.cell(selection, f)?;
                for (held, solution) in held.iter_mut().zip(&found.solutions) {
                    *held |= cell.holds(&solution.x);
                }
            }
            // x is the same along the continuum where all of its selections determine it.
            let x = continuum.selections.iter().map(|s| determined(&conditions, s, n));
            match x
                .collect::<Option<Vec<_>>>()
                .and_then(|list| list.into_iter().next())
            {
                Some(x) => all.insert(&x, scale),
                None => all.continua.push(continuum),
            }
        }
        let alone = found.solutions.iter().zip(&held).filter(|(_, held)| !**held);
        all.solutions.extend(alone.map(|(s, _)| s.x[..n].to_vec()));
        Ok(all)
    }

    /// The least length among the data: bounds, and right-hand sides and values of F at 0 over the largest coefficients of their rows.
    fn scale(&self, f: &AffineFunction) -> f64 {
        let set = self.set();
        let bounds = set.lower.iter().chain(&set.upper).copied();
        let rows = [&set.a, &set.e].map(|rows| {
            let largest = |i| rows.row(i).fold(0.0_f64, |m, (_, v)| m.max(v.abs()));
            (0..rows.len()).map(move |i| rows.right[i] / largest(i))
        });
        let n = set.dimension();
        let mut largest = vec![0.0_f64; n];
        for (i, j, v) in f.matrix().triplets() {
            if i < n && j < n {
                largest[i] = largest[i].max(v.abs());
            }
        }
        let values = f.q().iter().zip(largest).map(|(q, m)| q / m);
        let all = bounds
            .chain(rows.into_iter().flatten())
            .chain(values)
            .map(f64::abs);
        all.filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min)
    }

    /// The polyhedron of the points (x, λ, μ) that solve the conditions in a selection.
    fn cell(&self, selection: &Selection, f: &AffineFunction) -> Result<Polyhedron, ComplementarityError> {
        let conditions = self.kkt()?;
        let (mut lower, mut upper) = (conditions.lower().to_vec(), conditions.upper().to_vec());
        let (n, mut equal, mut less) = (lower.len(), Vec::new(), Vec::new());
        for i in 0..n {
            match &*conditions.piece_name(i, selection.piece(i)) {
                "interior" => equal.push((i, 1.0)),
                "lower" => {
                    upper[i] = lower[i];
                    less.push((i, -1.0));
                }
                "upper" => {
                    lower[i] = upper[i];
                    less.push((i, 1.0));
                }
                _ => {}
            }
        }
        let rows = |list: &[(usize, f64)]| -> Result<(Matrix, Vec<f64>), ComplementarityError> {
            let mut entries = Vec::new();
            let mut place = vec![None; n];
            for (row, (i, sign)) in list.iter().enumerate() {
                place[*i] = Some((row, *sign));
            }
            for (i, j, v) in f.matrix().triplets() {
                if let Some((row, sign)) = place[i] {
                    entries.push((row, j, sign * v));
                }
            }
            let right = list.iter().map(|(i, sign)| -sign * f.q()[*i]).collect();
            Ok((Matrix::from_triplets(list.len(), n, &entries)?, right))
        };
        let ((e, d), (a, b)) = (rows(&equal)?, rows(&less)?);
        Polyhedron::boxed(lower, upper)?
            .with_equations(e, d)?
            .with_inequalities(a, b)
    }
}

/// The first n unknowns where the affine equations of a selection determine them, in exact arithmetic.
fn determined(conditions: &impl PiecewiseSmooth, selection: &Selection, n: usize) -> Option<Vec<f64>> {
    let (count, unknowns) = (conditions.num_residuals(), conditions.num_vars());
    let origin = vec![0.0; unknowns];
    let (mut jac, mut constants) = (Matrix::zeros(conditions.pattern()), vec![0.0; count]);
    conditions.jacobian(selection, &origin, &mut jac);
    conditions.residual(selection, &origin, &mut constants);
    let mut forms = Vec::with_capacity(count);
    for constant in constants {
        forms.push((Exact::new(constant)?, vec![Exact::default(); unknowns]));
    }
    for (i, j, v) in jac.triplets() {
        forms[i].1[j] = Exact::new(v)?;
    }
    let mut table = Dictionary::new(unknowns, forms.iter().map(|(c, row)| (c, row.as_slice())));
    for row in 0..count {
        table.fix(row).ok()?;
    }
    let value = |j: usize| {
        let entries = table.entries(count + j);
        let is_fixed = entries[1..].iter().all(Zero::is_zero);
        is_fixed.then(|| quotient(&entries[0], table.denominator(), 0))
    };
    (0..n).map(value).collect()
}

impl Polyhedron {
    /// Whether x lies in the polyhedron, relative to the terms of each row.
    fn holds(&self, x: &[f64]) -> bool {
        let off = |rows: &Rows, i: usize| {
            let size: f64 = rows.row(i).map(|(j, v)| (v * x[j]).abs()).sum();
            (rows.at(i, x) - rows.right[i], SAME * (size + rows.right[i].abs()))
        };
        let between =
            |((x, l), u): ((&f64, &f64), &f64)| *x >= l - SAME * l.abs() && *x <= u + SAME * u.abs();
        x.iter().zip(&self.lower).zip(&self.upper).all(between)
            && (0..self.a.len()).all(|i| matches!(off(&self.a, i), (off, size) if off <= size))
            && (0..self.e.len()).all(|i| matches!(off(&self.e, i), (off, size) if off.abs() <= size))
    }
}

impl ViSolutions {
    /// Adds x, whose multipliers are not unique, unless it is listed already.
    fn insert(&mut self, x: &[f64], scale: f64) {
        // Components may have different units.
        let near =
            |(a, b): (&f64, &f64)| (a - b).abs() <= (SAME * a.abs().max(b.abs())).max(ROUNDING * scale);
        let same = |y: &Vec<f64>| y.iter().zip(x).all(near);
        if !self.solutions.iter().any(same) {
            self.solutions.push(x.to_vec());
        }
    }
}
