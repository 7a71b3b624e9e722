use std::borrow::Cow;

use num_dual::{Dual64, DualNum};

use super::{Facet, PiecewiseSmooth, Real, Selection};
use crate::sparse::{Matrix, Pattern};

impl Real for Dual64 {
    fn value(&self) -> f64 {
        self.re
    }
    fn sqrt(self) -> Self {
        DualNum::sqrt(&self)
    }
    fn exp(self) -> Self {
        DualNum::exp(&self)
    }
    fn ln(self) -> Self {
        DualNum::ln(&self)
    }
    fn sin(self) -> Self {
        DualNum::sin(&self)
    }
    fn cos(self) -> Self {
        DualNum::cos(&self)
    }
    fn tanh(self) -> Self {
        DualNum::tanh(&self)
    }
    fn powi(self, n: i32) -> Self {
        DualNum::powi(&self, n)
    }
    fn powf(self, p: f64) -> Self {
        DualNum::powf(&self, p)
    }
}

/// A nonsmooth function written once over [`Real`], its kinks said through [`Kinks`]. [`Traced`] turns it into a
/// [`PiecewiseSmooth`] map with exact Jacobians (forward-mode dual numbers).
pub trait NonsmoothFunction {
    /// Number m of variables.
    fn num_vars(&self) -> usize;

    /// Number n of residuals.
    fn num_residuals(&self) -> usize;

    /// Computes H(x) into `out` (length n). Each call on `kinks` is a site; the same calls must be made in the same order at
    /// every x (where their number differs, [`Traced`] gives NaN), and the arguments of one kink should not depend on another for test
    /// functions to be smooth.
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]);

    /// Where Jacobians have entries. Default: everywhere.
    fn pattern(&self) -> Pattern {
        Pattern::full(self.num_residuals(), self.num_vars())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Max,
    Min,
    Abs,
    Mid,
}

impl Kind {
    const fn tests(self) -> usize {
        match self {
            Kind::Mid => 2,
            _ => 1,
        }
    }
}

#[derive(Debug)]
enum Mode<'a> {
    Record(&'a mut Vec<Kind>),
    Frozen(&'a Selection),
    Natural(&'a mut [f64]),
}

/// The kinks of a [`NonsmoothFunction`], in the order in which they are called.
#[derive(Debug)]
pub struct Kinks<'a, T> {
    mode: Mode<'a>,
    site: usize,
    test: usize,
    scalar: std::marker::PhantomData<T>,
}

impl<'a, T: Real> Kinks<'a, T> {
    fn new(mode: Mode<'a>) -> Self {
        Self {
            mode,
            site: 0,
            test: 0,
            scalar: std::marker::PhantomData,
        }
    }

    fn kink(&mut self, kind: Kind, theta: [f64; 2], natural: usize) -> usize {
        let piece = match &mut self.mode {
            Mode::Record(kinds) => {
                kinds.push(kind);
                natural
            }
            Mode::Frozen(selection) => selection.piece(self.site),
            Mode::Natural(out) => {
                for (o, t) in out.iter_mut().skip(self.test).zip(&theta[..kind.tests()]) {
                    *o = *t;
                }
                natural
            }
        };
        self.site += 1;
        self.test += kind.tests();
        piece
    }

    /// max(a, b); pieces "first", "second"; test function a − b.
    pub fn max(&mut self, a: T, b: T) -> T {
        let theta = a.value() - b.value();
        [a, b][self
            .kink(Kind::Max, [theta, 0.0], usize::from(theta < 0.0))
            .min(1)]
    }

    /// min(a, b); pieces "first", "second"; test function b − a.
    pub fn min(&mut self, a: T, b: T) -> T {
        let theta = b.value() - a.value();
        [a, b][self
            .kink(Kind::Min, [theta, 0.0], usize::from(theta < 0.0))
            .min(1)]
    }

    /// |a|; pieces "positive", "negative"; test function a.
    pub fn abs(&mut self, a: T) -> T {
        let theta = a.value();
        [a, -a][self
            .kink(Kind::Abs, [theta, 0.0], usize::from(theta < 0.0))
            .min(1)]
    }

    /// max(a, 0).
    pub fn positive_part(&mut self, a: T) -> T {
        self.max(a, T::from(0.0))
    }

    /// The projection of z on [lower, upper] (lower ≤ upper); pieces "lower", "interior", "upper"; test functions z − lower and
    /// z − upper.
    pub fn project(&mut self, lower: T, z: T, upper: T) -> T {
        let theta = [z.value() - lower.value(), z.value() - upper.value()];
        let natural = if theta[0] < 0.0 {
            0
        } else {
            1 + usize::from(theta[1] > 0.0)
        };
        [lower, z, upper][self.kink(Kind::Mid, theta, natural).min(2)]
    }
}

/// A [`NonsmoothFunction`] as a [`PiecewiseSmooth`] map.
///
/// ```
/// use semismooth::newton::Newton;
/// use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
///
/// /// |x| + x/2 = 3 and y = max(x, 1).
/// struct Example;
/// impl NonsmoothFunction for Example {
///     fn num_vars(&self) -> usize { 2 }
///     fn num_residuals(&self) -> usize { 2 }
///     fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
///         out[0] = kinks.abs(x[0]) + x[0] * 0.5 - 3.0;
///         out[1] = x[1] - kinks.max(x[0], T::from(1.0));
///     }
/// }
/// let map = Traced::new(Example);
/// let mut x = [0.3, 0.0];
/// Newton::default().solve(&map, &mut x)?;
/// assert_eq!(x, [2.0, 2.0]);
/// # Ok::<(), semismooth::newton::NewtonError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Traced<F> {
    function: F,
    kinds: Vec<Kind>,
}

impl<F: NonsmoothFunction> Traced<F> {
    /// Finds the kinks of `function` by one evaluation at x = 0.
    pub fn new(function: F) -> Self {
        let mut kinds = Vec::new();
        let x = vec![0.0; function.num_vars()];
        let mut out = vec![0.0; function.num_residuals()];
        function.eval(&x, &mut Kinks::new(Mode::Record(&mut kinds)), &mut out);
        Self { function, kinds }
    }

    /// The function.
    pub fn function(&self) -> &F {
        &self.function
    }
}

impl<F: NonsmoothFunction> PiecewiseSmooth for Traced<F> {
    fn num_vars(&self) -> usize {
        self.function.num_vars()
    }

    fn num_residuals(&self) -> usize {
        self.function.num_residuals()
    }

    fn num_sites(&self) -> usize {
        self.kinds.len()
    }

    fn num_pieces(&self, site: usize) -> usize {
        self.num_tests(site) + 1
    }

    fn num_tests(&self, site: usize) -> usize {
        self.kinds[site].tests()
    }

    fn cell(&self, site: usize, piece: usize) -> &[Facet] {
        const MID: [&[Facet]; 3] = [
            &[Facet::negative(0)],
            &[Facet::positive(0), Facet::negative(1)],
            &[Facet::positive(1)],
        ];
        const TWO: [&[Facet]; 2] = [&[Facet::positive(0)], &[Facet::negative(0)]];
        match self.kinds[site] {
            Kind::Mid => MID[piece.min(2)],
            _ => TWO[piece.min(1)],
        }
    }

    fn piece_name(&self, site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(match self.kinds[site] {
            Kind::Mid => ["lower", "interior", "upper"][piece.min(2)],
            Kind::Abs => ["positive", "negative"][piece.min(1)],
            Kind::Max | Kind::Min => ["first", "second"][piece.min(1)],
        })
    }

    fn pattern(&self) -> Pattern {
        self.function.pattern()
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let mut residual = vec![0.0; self.num_residuals()];
        let mut kinks = Kinks::new(Mode::Natural(out));
        self.function.eval(x, &mut kinks, &mut residual);
        if kinks.site != self.kinds.len() {
            out.fill(f64::NAN);
        }
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let mut kinks = Kinks::new(Mode::Frozen(selection));
        self.function.eval(x, &mut kinks, out);
        if kinks.site != self.kinds.len() {
            out.fill(f64::NAN);
        }
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let (m, n) = (self.num_vars(), self.num_residuals());
        let mut seeded: Vec<Dual64> = x.iter().map(|&v| Dual64::from(v)).collect();
        let mut out = vec![Dual64::from(0.0); n];
        for j in 0..m {
            seeded[j].eps = 1.0;
            self.function
                .eval(&seeded, &mut Kinks::new(Mode::Frozen(selection)), &mut out);
            seeded[j].eps = 0.0;
            for (i, value) in out.iter().enumerate() {
                if value.eps != 0.0 {
                    jac.add(i, j, value.eps);
                }
            }
        }
    }
}
