//! Angles and distances to facets, independent of the units of the variables.

use crate::judge::equilibrate;
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout, Vanishing};
use crate::sparse::{Matrix, norm};
use crate::tolerances::{LEFT, ROUNDING, TANGENTIAL};

/// Share of the balanced size of a variable below which its value is a rounding error of 0: 2⁻³⁰ leaves room for units that are 10⁸ apart,
/// and is far above rounding of points of ordinary size.
const NOTHING: f64 = 1.0 / 1_073_741_824.0;

/// Lengths of vectors depend on the units of the variables: what is small in badly scaled units need not be small. Rates and values of test
/// functions that count as zero have to be small in the units of ∇H^(σ), too, in which the entries of its columns are of one size.
pub(in crate::continuation) struct Units<'a, P: ?Sized> {
    map: &'a P,
    selection: &'a Selection,
    x: &'a [f64],
    /// Computed once a small value occurs; empty until then.
    units: Vec<f64>,
    /// Whether their columns of ∇H are 0.
    unseen: Vec<bool>,
    /// Sizes of the variables themselves.
    sizes: Vec<f64>,
}

impl<'a, P: PiecewiseSmooth + ?Sized> Units<'a, P> {
    pub(in crate::continuation) fn new(map: &'a P, selection: &'a Selection, x: &'a [f64]) -> Self {
        Self {
            map,
            selection,
            x,
            units: Vec::new(),
            unseen: Vec::new(),
            sizes: Vec::new(),
        }
    }

    /// The largest rate along a unit vector that counts as zero; `size` is the norm of the gradient of the test function.
    pub(in crate::continuation) fn least_rate(
        &mut self,
        v: &Vanishing,
        rate: f64,
        size: f64,
        t: &[f64],
    ) -> f64 {
        let bound = TANGENTIAL * size;
        if rate == 0.0 || rate.abs() > bound || rate.is_nan() {
            return bound;
        }
        let gradient = self.gradient_norm(v);
        bound.min(TANGENTIAL * gradient * self.length(t))
    }

    /// The sign of α̇ along a unit vector; 0 where it is rounding, in these units, too.
    pub(in crate::continuation) fn direction(&mut self, t: &[f64]) -> i8 {
        let Some(&rate) = t.last() else { return 0 };
        let small = rate.abs() <= TANGENTIAL;
        if small && self.units.is_empty() {
            self.find();
        }
        let unit = self.units.last().copied().unwrap_or(1.0);
        if rate == 0.0 || (small && rate.abs() / unit <= TANGENTIAL * self.length(t)) {
            0
        } else {
            rate.signum() as i8
        }
    }

    /// The length of a unit vector whose length in these units is one.
    pub(in crate::continuation) fn unit_along(&mut self, t: &[f64]) -> f64 {
        if self.units.is_empty() {
            self.find();
        }
        self.length(t).recip()
    }

    /// Whether a value θ is within `distance` of the facet, in multiples of the sizes of the variables.
    pub(in crate::continuation) fn is_near(&mut self, v: &Vanishing, theta: f64, distance: f64) -> bool {
        if theta == 0.0 {
            return true;
        }
        if self.units.is_empty() {
            self.find();
        }
        let own = self.own_gradient(v);
        let gradient = own.as_ref().unwrap_or(v).gradient.iter();
        let scaled: Vec<f64> = gradient.zip(&self.sizes).map(|(g, size)| g * size).collect();
        theta.abs() <= distance * norm(&scaled)
    }

    /// The gradient in the selection, where that matters.
    fn own_gradient(&self, v: &Vanishing) -> Option<Vanishing> {
        (self.map.has_nested_kinks())
            .then(|| v.of_selection(self.map, &TestLayout::new(self.map), self.selection, self.x))
    }

    /// The units as divisors of the unknowns, powers of two.
    pub(in crate::continuation) fn divisors(mut self) -> Vec<f64> {
        self.find();
        let mut units = self.units;
        (units.iter_mut()).for_each(|unit| *unit = unit.log2().round().exp2());
        if units.iter().all(|unit| *unit == 1.0) {
            units.clear();
        }
        units
    }

    fn length(&self, vector: &[f64]) -> f64 {
        let scaled: Vec<f64> = vector.iter().zip(&self.units).map(|(v, d)| v / d).collect();
        norm(&scaled)
    }

    fn gradient_norm(&mut self, v: &Vanishing) -> f64 {
        if self.units.is_empty() {
            self.find();
        }
        let own = self.own_gradient(v);
        let gradient = &own.as_ref().unwrap_or(v).gradient;
        // Unknowns whose columns of ∇H vanish: their units come from ∇θ.
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let entries = gradient.iter().zip(&self.units).zip(&self.unseen);
        let known = largest(&mut entries.filter(|e| !e.1).map(|((g, d), _)| (g * d).abs()));
        let rounding = LEFT * largest(&mut gradient.iter().map(|g| g.abs()));
        for ((g, d), _) in gradient
            .iter()
            .zip(&mut self.units)
            .zip(&self.unseen)
            .filter(|e| *e.1)
        {
            *d = if known > 0.0 && g.abs() > rounding {
                known / g.abs()
            } else {
                1.0
            };
        }
        let scaled: Vec<f64> = gradient.iter().zip(&self.units).map(|(g, d)| g * d).collect();
        norm(&scaled)
    }

    fn find(&mut self) {
        let mut jac = Matrix::zeros(self.map.pattern());
        self.map.jacobian(self.selection, self.x, &mut jac);
        let still = changes(&jac, [&jac, &jac], 0.0);
        let before = own_sizes(self.x);
        self.sizes = sizes(&jac, still, (self.x, &before), &mut vec![false; self.x.len()]);
        let (mut row, mut largest) = (vec![1.0; jac.nrows()], vec![0.0f64; jac.nrows()]);
        (jac.triplets()).for_each(|(i, _, v)| largest[i] = largest[i].max(v.abs()));
        let kept = |(i, _, v): (usize, usize, f64)| if v.abs() < LEFT * largest[i] { 0.0 } else { v };
        let values: Vec<f64> = jac.triplets().map(kept).collect();
        jac.values_mut().copy_from_slice(&values);
        self.units.resize(jac.ncols(), 1.0);
        self.unseen.resize(jac.ncols(), true);
        (jac.triplets().filter(|t| t.2 != 0.0)).for_each(|(_, j, _)| self.unseen[j] = false);
        equilibrate(jac.as_ref(), &mut row, &mut self.units, &mut largest);
    }
}

/// The larger of each entry of a Jacobian and of its change between two others of the same pattern, times a factor.
pub(super) fn changes(jac: &Matrix, [from, to]: [&Matrix; 2], factor: f64) -> Matrix {
    let mut larger = jac.clone();
    let pairs = from.values().iter().zip(to.values());
    for (v, (from, to)) in larger.values_mut().iter_mut().zip(pairs) {
        *v = v.abs().max(factor * (to - from).abs());
    }
    larger
}

/// The largest entry of each row; 1 where there is none.
pub(super) fn row_sizes(jac: &Matrix) -> Vec<f64> {
    let mut sizes = vec![0.0_f64; jac.nrows()];
    jac.triplets()
        .for_each(|(i, _, v)| sizes[i] = sizes[i].max(v.abs()));
    let unknown = |size: &&mut f64| !(**size > 0.0 && size.is_finite());
    sizes.iter_mut().filter(unknown).for_each(|size| *size = 1.0);
    sizes
}

/// The power of two nearest to the magnitude of each variable; 1 where that is below what sizes of variables may be.
pub(super) fn own_sizes(x: &[f64]) -> Vec<f64> {
    let size = |x: &f64| power(if x.abs() > NOTHING { x.abs() } else { 1.0 });
    x.iter().map(size).collect()
}

/// The size of each variable, a power of two: its own, the change that rounding of the terms of a row cannot tell from it, or the size in
/// which columns of the Jacobian, or of its changes over the sizes `before`, are balanced, whichever is largest. Balanced sizes are known
/// up to a common factor: it is that of the variables that are no rounding errors of 0, and their geometric mean is 1 where all are.
/// `nothing` marks the variables that counted as such errors in an earlier pass. They go on doing so, as sizes would else swing.
pub(super) fn sizes(
    jac: &Matrix,
    mut changes: Matrix,
    (x, before): (&[f64], &[f64]),
    nothing: &mut [bool],
) -> Vec<f64> {
    // Only of variables that are not 0: the sizes of others are not known before.
    let known = |j: usize| x[j].abs() > NOTHING;
    drop_rounding(&mut changes, before, known);
    let mut told = vec![false; x.len()];
    (changes.triplets()).for_each(|(_, j, v)| told[j] |= v > 0.0);
    let own = own_changes(jac, &changes, x);
    let balanced = balanced_columns(&changes);
    let ratio = |j: &usize| own[*j] / balanced[*j];
    let all = || (0..x.len()).filter(|j| told[*j]);
    let most = all().map(|j| ratio(&j)).fold(1.0, f64::max);
    all().for_each(|j| nothing[j] |= ratio(&j) <= NOTHING * most);
    let common = geometric_mean(all().filter(|j| !nothing[*j]).map(|j| ratio(&j)));
    let size = |j: usize| match told[j] || !known(j) {
        true => own[j].max(common * balanced[j]),
        false => own[j],
    };
    (0..x.len()).map(|j| power(size(j))).collect()
}

/// Sets entries to 0 that are rounding errors of their row over the sizes of the variables: they say nothing of these.
fn drop_rounding(entries: &mut Matrix, sizes: &[f64], known: impl Fn(usize) -> bool) {
    let mut largest = vec![0.0_f64; entries.nrows()];
    (entries.triplets().filter(|e| known(e.1)))
        .for_each(|(i, j, v)| largest[i] = largest[i].max(v * sizes[j]));
    let rounding = |(i, j, v): (usize, usize, f64)| known(j) && v * sizes[j] <= ROUNDING * largest[i];
    let kept: Vec<f64> = (entries.triplets())
        .map(|e| if rounding(e) { 0.0 } else { e.2 })
        .collect();
    entries.values_mut().copy_from_slice(&kept);
}

/// The modulus of each variable or, where that is larger, the least change of it that the terms of a row notice.
fn own_changes(jac: &Matrix, changes: &Matrix, x: &[f64]) -> Vec<f64> {
    let mut own: Vec<f64> = x.iter().map(|x| x.abs()).collect();
    let mut terms = vec![0.0_f64; jac.nrows()];
    jac.as_ref().add_term_sizes(&own, &mut terms);
    let mut least = vec![f64::INFINITY; x.len()];
    // Entries that are far smaller than nearby are rounding errors of 0.
    for ((i, j, v), (.., near)) in jac.triplets().zip(changes.triplets()) {
        if near > 0.0 && v.abs() > NOTHING * near && terms[i] > 0.0 {
            least[j] = least[j].min(terms[i] / v.abs());
        }
    }
    let noticed = own.iter_mut().zip(least).filter(|(_, least)| least.is_finite());
    noticed.for_each(|(own, least)| *own = own.max(least));
    own
}

/// Factors that balance the columns of a matrix, with the geometric mean 1.
fn balanced_columns(a: &Matrix) -> Vec<f64> {
    let (mut rows, mut columns) = (vec![1.0; a.nrows()], vec![1.0; a.ncols()]);
    equilibrate(a.as_ref(), &mut rows, &mut columns, &mut vec![0.0; a.nrows()]);
    let mean = geometric_mean(columns.iter().copied());
    columns.iter_mut().for_each(|c| *c /= mean);
    columns
}

/// 1 where there are no numbers.
fn geometric_mean(numbers: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = numbers.fold((0.0_f64, 0.0), |(count, sum), v| (count + 1.0, sum + v.log2()));
    (sum / count.max(1.0)).exp2()
}

/// The power of two nearest to a size; 1 for none.
pub(super) fn power(size: f64) -> f64 {
    match size > 0.0 && size.is_finite() {
        true => size.log2().round().exp2(),
        false => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::{changes, own_sizes, sizes};
    use crate::continuation::point::units::Units;
    use crate::continuation::testing::Plane;
    use crate::piecewise::Selection;
    use crate::sparse::Matrix;

    fn sizes_of(rows: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
        let jac = Matrix::from_rows(rows).unwrap();
        let before = own_sizes(x);
        sizes(
            &jac,
            changes(&jac, [&jac, &jac], 0.0),
            (x, &before),
            &mut vec![false; x.len()],
        )
    }

    /// Values tell sizes; of variables that are 0 the rows do, relative to the others, or to 1 where all are 0.
    #[test]
    fn sizes_are_told_by_values_and_rows() {
        // The terms of the row are 2e8 together.
        assert_eq!(sizes_of(&[vec![1.0, -1.0]], &[1e8, 1e8]), [2.0_f64.powi(28); 2]);
        // y = 2²⁰ α: α is 2²⁰ times smaller than y.
        let row = [vec![1.0, -2.0_f64.powi(20)]];
        for (x, expected) in [
            ([1024.0, 0.0], [1024.0, 2.0_f64.powi(-10)]),
            ([0.0, 1.0], [2.0_f64.powi(20), 1.0]),
            ([0.0, 0.0], [1024.0, 2.0_f64.powi(-10)]),
        ] {
            assert_eq!(sizes_of(&row, &x), expected, "{x:?}");
        }
        // No size is smaller than its variable, and those of rows that are not coupled are of the size of all.
        let rows = [vec![1.0, 0.0, 0.0], vec![0.0, 1.0, -1.0]];
        assert_eq!(sizes_of(&rows, &[1024.0, 1.0, 1.0]), [1024.0, 16.0, 16.0]);
        // An entry that is rounding of its row over these values says nothing.
        assert_eq!(sizes_of(&[vec![1e-17, 1.0]], &[1.0, 1.0]), [1.0, 1.0]);
    }

    /// A size is a value above 2⁻³⁰, to the next power of two; other values may be 0 up to rounding.
    #[test]
    fn values_above_rounding_are_sizes() {
        let power = |k: i32| 2.0_f64.powi(k);
        assert_eq!(
            own_sizes(&[0.0, -3.0, 1e8, 1.1 * power(-30)]),
            [1.0, 4.0, power(27), power(-30)]
        );
        assert_eq!(own_sizes(&[power(-30), f64::MIN_POSITIVE]), [1.0, 1.0]);
    }

    /// Rates of α up to 1e-9 of a tangent are rounding where columns are balanced, within a factor of two.
    #[test]
    fn directions_are_known_above_rounding() {
        let map = Plane::within(|y, a| [y - 1024.0 * a, 1.0, -1024.0], &[]);
        let selection = Selection::uniform(1, 0);
        for (rate, expected) in [(3e-12, 1), (-3e-12, -1), (3e-13, 0), (-3e-13, 0), (0.0, 0)] {
            let mut units = Units::new(&map, &selection, &[1024.0, 1.0]);
            assert_eq!(units.direction(&[1.0, rate]), expected, "{rate}");
        }
    }
}
