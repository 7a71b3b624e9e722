//! The kinks of a formula: what its evaluation does at each of them.

use crate::piecewise::trace::{LABELS, Labels};
use crate::piecewise::{Real, Selection};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Max,
    Min,
    Abs,
    Mid,
    Switch,
}

impl Kind {
    pub(super) const fn tests(self) -> usize {
        match self {
            Kind::Mid => 2,
            _ => 1,
        }
    }

    /// Whether the value is undefined, whichever piece is selected.
    fn is_undefined<T: Real>(self, pieces: &[T], tests: &[T]) -> bool {
        let is_nan = |v: &T| v.single().is_some_and(f64::is_nan);
        match (self, tests) {
            (Kind::Switch, [test, ..]) => {
                let is_infinite = |p: &T| p.single().is_some_and(|v| !v.is_finite());
                is_nan(test) || (test.single() == Some(0.0) && pieces.iter().any(is_infinite))
            }
            _ => pieces.iter().any(is_nan),
        }
    }
}

#[derive(Debug)]
pub(super) enum Mode<'a, T> {
    Record(&'a mut Vec<Kind>),
    /// The pieces of a selection, or where there is none those that the test functions choose. As many test
    /// functions are written down as there is room for.
    Pieces(Option<&'a Selection>, &'a mut [T]),
    /// All pieces at once.
    Joined,
    /// Every kink as an unknown, or as what is true of all its pieces.
    Switched,
    /// All pieces at once; sites are indexed after the variables, labels begin at the index `first`, and the labels of the test functions
    /// go to the list.
    Labelled {
        behind: usize,
        first: usize,
        tests: &'a mut Vec<Labels>,
    },
}

/// The kinks of a [`NonsmoothFunction`](super::NonsmoothFunction), in the order in which they are called.
///
/// What is undefined stays so: `max`, `min`, `abs` and `project` are NaN, with all their derivatives, where any of their operands is,
/// whichever piece is selected. [`switch`](Self::switch) is NaN where its test is and where the formula it selects is; where its test
/// vanishes, where either formula is not finite.
#[derive(Debug)]
pub struct Kinks<'a, T> {
    mode: Mode<'a, T>,
    pub(super) site: usize,
    test: usize,
}

impl<'a, T: Real> Kinks<'a, T> {
    pub(super) fn new(mode: Mode<'a, T>) -> Self {
        Self {
            mode,
            site: 0,
            test: 0,
        }
    }

    /// Kinks that take the pieces which their test functions choose.
    pub(crate) fn chosen() -> Self {
        Self::new(Mode::Pieces(None, &mut []))
    }

    /// The value of a kink with the given pieces; `tests` are its test functions and `natural` the piece that they choose.
    fn kink<const N: usize>(
        &mut self,
        kind: Kind,
        pieces: [T; N],
        tests: [T; 2],
        natural: impl Fn() -> usize,
    ) -> T {
        let (site, test) = (self.site, self.test);
        self.site += 1;
        self.test += kind.tests();
        let tests = &tests[..kind.tests()];
        let piece = match &mut self.mode {
            Mode::Record(kinds) => {
                kinds.push(kind);
                natural()
            }
            Mode::Pieces(selection, out) => {
                out.iter_mut().skip(test).zip(tests).for_each(|(o, t)| *o = *t);
                selection.map_or_else(natural, |s| s.piece(site))
            }
            Mode::Joined => return pieces[0].joined(&pieces, None),
            Mode::Switched => return T::switched(tests, &pieces, natural),
            Mode::Labelled {
                behind,
                first,
                tests: list,
            } => {
                list.extend(tests.iter().map(T::labels));
                // Sites are indexed after the variables; those before the window have no label.
                let label = (*behind + site).checked_sub(*first);
                return pieces[0].joined(&pieces, label.filter(|l| *l < LABELS));
            }
        };
        let chosen = pieces[piece.min(N - 1)];
        match kind.is_undefined(&pieces, tests) {
            true => chosen * f64::NAN,
            false => chosen,
        }
    }

    /// max(a, b); pieces "first", "second"; test function a − b.
    pub fn max(&mut self, a: T, b: T) -> T {
        let theta = a - b;
        let natural = || usize::from(theta.value() < 0.0);
        self.kink(Kind::Max, [a, b], [theta, theta], natural)
    }

    /// min(a, b); pieces "first", "second"; test function b − a.
    pub fn min(&mut self, a: T, b: T) -> T {
        let theta = b - a;
        let natural = || usize::from(theta.value() < 0.0);
        self.kink(Kind::Min, [a, b], [theta, theta], natural)
    }

    /// |a|; pieces "positive", "negative"; test function a.
    pub fn abs(&mut self, a: T) -> T {
        let natural = || usize::from(a.value() < 0.0);
        self.kink(Kind::Abs, [a, -a], [a, a], natural)
    }

    /// max(a, 0).
    pub fn positive_part(&mut self, a: T) -> T {
        self.max(a, T::from(0.0))
    }

    /// `first` where test ≥ 0 and `second` where test < 0, for formulas that are no maximum: the two must agree wherever `test` vanishes,
    /// else the map is not continuous. Pieces "first", "second".
    ///
    /// ```
    /// use semismooth::newton::Newton;
    /// use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
    /// /// A spring with the force y² up to y = 1 and 3 y − 2 beyond, under the load 7.
    /// struct Spring;
    /// impl NonsmoothFunction for Spring {
    ///     fn num_vars(&self) -> usize { 1 }
    ///     fn num_residuals(&self) -> usize { 1 }
    ///     fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
    ///         let y = x[0];
    ///         out[0] = kinks.switch(y - 1.0, y * 3.0 - 2.0, y * y) - 7.0;
    ///     }
    /// }
    /// let mut y = [0.5];
    /// Newton::default().solve(&Traced::new(Spring), &mut y)?;
    /// assert_eq!(y, [3.0]);
    /// # Ok::<(), semismooth::newton::NewtonError>(())
    /// ```
    pub fn switch(&mut self, test: T, first: T, second: T) -> T {
        let natural = || usize::from(test.value() < 0.0);
        self.kink(Kind::Switch, [first, second], [test, test], natural)
    }

    /// The projection of z on [lower, upper]; pieces "lower", "interior", "upper"; test functions z − lower and z − upper.
    ///
    /// lower ≤ upper must hold at every x of an evaluation, not only at solutions: where bounds cross, the cells of "lower" and
    /// "upper" overlap and [`check`](crate::piecewise::check) refuses the map. A bound that may become negative, F θ of Coulomb friction with
    /// the pressure θ, must be cut off at 0: `let g = kinks.positive_part(theta) * f; kinks.project(-g, z, g)`. The
    /// [guide](crate::guide::your_own_map) has the whole law.
    pub fn project(&mut self, lower: T, z: T, upper: T) -> T {
        let tests = [z - lower, z - upper];
        let natural = || {
            if tests[0].value() < 0.0 {
                0
            } else {
                1 + usize::from(tests[1].value() > 0.0)
            }
        };
        self.kink(Kind::Mid, [lower, z, upper], tests, natural)
    }
}
