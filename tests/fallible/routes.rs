//! Operators, correctors, lists, sets in two parameters, contact, monitors, nonlinear programs and formulas.

use std::sync::Arc;

use semismooth::complementarity::{ConstraintKind, McpSolver, Program, kkt};
use semismooth::contact::{
    ContactError, EvolutionOptions, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb, evolve,
};
use semismooth::continuation::{
    Branch, Continuation, ContinuationOptions, Direction, FoldSet, TransitionSet,
};
use semismooth::enumeration::{EnumerationOptions, all_arms, all_solutions};
use semismooth::linear::{DenseLu, LinearError, LinearOperator};
use semismooth::newton::{MoorePenrose, NewtonKrylov};
use semismooth::piecewise::{MatrixFree, PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

use super::maps::two_pieces;
use super::{Counted, Curve, with_each_failing};

/// 2 xᵢ + xᵢ³ = 1 with products of its Jacobian only.
struct Cubes<'c> {
    counted: &'c Counted,
    slopes: Vec<f64>,
}

impl LinearOperator for Cubes<'_> {
    fn order(&self) -> usize {
        self.slopes.len()
    }
    fn product(&mut self, v: &[f64], y: &mut [f64]) {
        self.counted.errors.values(y, |y| {
            y.iter_mut()
                .zip(v.iter().zip(&self.slopes))
                .for_each(|(y, (v, s))| *y = v * s);
            self.counted.count()
        });
    }
}

impl MatrixFree for Cubes<'_> {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        self.counted.errors.values(out, |out| {
            out.iter_mut()
                .zip(x)
                .for_each(|(o, x)| *o = 2.0 * x + x.powi(3) - 1.0);
            self.counted.count()
        });
    }
    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError> {
        let counted = self.counted;
        self.slopes
            .iter_mut()
            .zip(x)
            .for_each(|(s, x)| *s = 2.0 + 3.0 * x * x);
        let failed = || LinearError::Solver {
            what: "no derivative".to_owned(),
        };
        counted.errors.attempt(|| counted.count()).ok_or_else(failed)
    }
}

#[test]
fn operators() {
    let solve = |counted: &Arc<Counted>| {
        let mut map = Cubes {
            counted,
            slopes: vec![1.0; 3],
        };
        let mut x = [3.0, -1.0, 0.5];
        let result = NewtonKrylov::default().solve(&mut map, &mut x).map(|_| ());
        (result, x)
    };
    with_each_failing(solve, |(result, x), (reference, solution)| {
        assert!(reference.is_ok() && x.iter().all(|v| v.is_finite()));
        assert!(result.is_err() || x == solution, "{x:?}");
    });
}

#[test]
fn corrections_and_lists() {
    let correct = |counted: &Arc<Counted>| {
        let map = Curve(counted);
        let mut corrector = MoorePenrose::new(&map, DenseLu::new())?;
        let (mut x, mut t) = ([0.2, 0.3], [0.7, 0.7]);
        let mut selection = Selection::uniform(1, 1);
        let found = corrector.correct(
            &map,
            &mut selection,
            |_, _| {},
            &mut x,
            &mut t,
            (1e-12, 1e-12),
            20,
        );
        found.map(|(correction, _)| correction)
    };
    with_each_failing(correct, |_, whole| assert!(whole.is_ok()));
    let options = EnumerationOptions::default();
    let list = |counted: &Arc<Counted>| {
        all_solutions(&Lines(counted), 0.25, &options).map(|set| (set.solutions.len(), set.completeness))
    };
    with_each_failing(list, |partial, whole| {
        // A failed evaluation never makes the list longer.
        let (found, all) = (partial.as_ref().map_or(0, |s| s.0), whole.as_ref().unwrap().0);
        assert!(all == 2 && found <= all);
    });
    let arms =
        |counted: &Arc<Counted>| all_arms(&Lines(counted), &[0.0, 0.0], &options).map(|set| set.arms.len());
    with_each_failing(arms, |partial, whole| {
        assert!(*whole == Ok(2) && partial.as_ref().map_or(0, |n| *n) <= 2);
    });
}

/// α = |y|.
struct Lines<'c>(&'c Counted);

impl PiecewiseSmooth for Lines<'_> {
    two_pieces!(self, [negative, positive], 2, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            out[0] = x[0];
            self.0.count()
        });
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            out[0] = x[1] - [-x[0], x[0]][s.piece(0)];
            self.0.count()
        });
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        self.0.errors.matrix(jac, |jac| {
            jac.add(0, 0, [1.0, -1.0][s.piece(0)]);
            jac.add(0, 1, 1.0);
            self.0.count()
        });
    }
}

/// y³ − β y = α, with an additional slope of 2 for y < −9.
struct Family<'c>(&'c Counted);

impl PiecewiseSmooth for Family<'_> {
    two_pieces!(self, [negative, positive], 3, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            out[0] = x[0] + 9.0;
            self.0.count()
        });
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            let kinked = [2.0 * (x[0] + 9.0), 0.0][s.piece(0)];
            out[0] = x[0].powi(3) - x[2] * x[0] - x[1] + kinked;
            self.0.count()
        });
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        self.0.errors.matrix(jac, |jac| {
            jac.add(0, 0, 3.0 * x[0] * x[0] - x[2] + [2.0, 0.0][s.piece(0)]);
            jac.add(0, 1, -1.0);
            jac.add(0, 2, -x[0]);
            self.0.count()
        });
    }
}

#[test]
fn sets_in_two_parameters() {
    let options = || {
        ContinuationOptions::default()
            .with_parameter_range((2.0, 4.0))
            .with_max_points(40)
    };
    let folds = |counted: &Arc<Counted>| -> Result<usize, String> {
        let (set, start) = FoldSet::new(Family(counted), &[1.0, -2.0, 3.0]).map_err(|e| e.to_string())?;
        let line = Branch::follow(&set, &start, Direction::Increasing, options());
        line.map(|l| l.points.len()).map_err(|e| e.to_string())
    };
    let transitions = |counted: &Arc<Counted>| -> Result<usize, String> {
        let set = TransitionSet::new(Family(counted), 0, 0).map_err(|e| e.to_string())?;
        let start = [-9.0, -729.0 + 27.0, 3.0];
        let line = Branch::follow(&set, &start, Direction::Increasing, options());
        line.map(|l| l.points.len()).map_err(|e| e.to_string())
    };
    for follow in [
        &folds as &dyn Fn(&Arc<Counted>) -> Result<usize, String>,
        &transitions,
    ] {
        with_each_failing(follow, |partial, whole| {
            let whole = *whole.as_ref().unwrap();
            assert!(whole > 1 && partial.as_ref().map_or(0, |n| *n) <= whole);
        });
    }
}

/// One node of a body, with slip-weakening friction, or a load, that fail.
fn block(
    counted: &Arc<Counted>,
    friction_fails: bool,
    load_fails: bool,
) -> Result<FullContact<PlanarCoulomb>, ContactError> {
    let rows = |rows: &[[f64; 2]]| Matrix::from_rows(rows).unwrap();
    let (of_friction, of_load) = (counted.clone(), counted.clone());
    let coefficient = move |_: usize, slip: f64, _: f64| {
        let falling = (-slip.abs()).exp();
        [0.3 + 0.2 * falling, -0.2 * falling, 0.0]
    };
    let friction = FrictionCoefficient::function(move |node, slip, alpha| {
        let value = coefficient(node, slip, alpha);
        let attempt = of_friction.errors.attempt(|| match friction_fails {
            true => of_friction.count().map(|()| value),
            false => Ok(value),
        });
        attempt.unwrap_or([f64::NAN; 3])
    });
    let load = LoadPath::function(move |alpha, f, rate| {
        let attempt = of_load.errors.attempt(|| {
            f.copy_from_slice(&[1.0, 4.0 * alpha + 0.2 * alpha * alpha]);
            rate.copy_from_slice(&[0.0, 4.0 + 0.4 * alpha]);
            if load_fails { of_load.count() } else { Ok(()) }
        });
        if attempt.is_none() {
            f.fill(f64::NAN);
            rate.fill(f64::NAN);
        }
    });
    let normal = (rows(&[[1.0, 0.0]]), rows(&[[0.0, 1.0]]));
    FullContact::planar(
        rows(&[[2.0, -1.0], [-1.0, 2.0]]),
        normal.0,
        normal.1,
        load,
        friction,
    )
}

#[test]
fn contact_problems_and_histories() {
    for (friction_fails, load_fails) in [(true, false), (false, true)] {
        let solve = |counted: &Arc<Counted>| -> Result<Vec<f64>, ContactError> {
            block(counted, friction_fails, load_fails)?.solve(0.5, None)
        };
        with_each_failing(solve, |x, whole| {
            let whole = whole.as_ref().unwrap();
            assert!(x.as_ref().map_or(true, |x| x == whole), "{x:?} {whole:?}");
        });
        let history = |counted: &Arc<Counted>| -> Result<Vec<Vec<f64>>, ContactError> {
            let mut problem = block(counted, friction_fails, load_fails)?;
            let start = problem.solve(0.0, None)?;
            let options = EvolutionOptions::default().with_slip_increments(true);
            let steps = evolve(&mut problem, &start, &[0.3, 0.6, 0.2], &options, |_| {
                counted.errors.flow()
            })?;
            Ok(steps.into_iter().map(|s| s.x).collect())
        };
        with_each_failing(history, |steps, whole| {
            let whole = whole.as_ref().unwrap();
            assert_eq!(whole.len(), 3);
            if let Ok(steps) = steps {
                assert!(steps.len() <= whole.len());
            }
        });
    }
}

/// The map itself does not fail in this test.
#[test]
fn monitors() {
    let sound = Counted::new(usize::MAX);
    let map = Curve(&sound);
    let follow = |counted: &Arc<Counted>| -> Result<usize, String> {
        let options = ContinuationOptions::default()
            .with_parameter_range((-1.5, 1.0))
            .with_max_points(60);
        let curve = Continuation::new(&map, &[-0.5, -1.0], Direction::Increasing, options)
            .map_err(|e| e.to_string())?
            .with_monitor("height", |x| {
                let value = || counted.count().map(|()| x[0] - 0.25);
                counted.errors.attempt(value).unwrap_or(f64::NAN)
            });
        Ok(curve.take_while(|_| !counted.errors.is_set()).count())
    };
    with_each_failing(follow, |partial, whole| {
        assert!(partial.as_ref().map_or(0, |n| *n) <= *whole.as_ref().unwrap());
    });
}

/// Minimise (x₀ − 2)² + x₁² subject to x₁ ≥ x₀², x ≥ 0.
struct Parabola<'c>(&'c Counted);

impl Program for Parabola<'_> {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_constraints(&self) -> usize {
        1
    }
    fn gradient(&self, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            (out[0], out[1]) = (2.0 * (x[0] - 2.0), 2.0 * x[1]);
            self.0.count()
        });
    }
    fn constraints(&self, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            out[0] = x[1] - x[0] * x[0];
            self.0.count()
        });
    }
    fn constraint_jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.0.errors.matrix(jac, |jac| {
            jac.add(0, 0, -2.0 * x[0]);
            jac.add(0, 1, 1.0);
            self.0.count()
        });
    }
    fn hessian(&self, _: &[f64], y: &[f64], h: &mut Matrix) {
        self.0.errors.matrix(h, |h| {
            h.add(0, 0, 2.0 + 2.0 * y[0]);
            h.add(1, 1, 2.0);
            self.0.count()
        });
    }
}

#[test]
fn programs() {
    let solve = |counted: &Arc<Counted>| {
        let kinds = [ConstraintKind::Nonnegative];
        let problem = kkt(Parabola(counted), &kinds, vec![0.0; 2], vec![f64::INFINITY; 2])?;
        let mut xy = [1.0, 0.5, 0.0];
        let solved = McpSolver::default().solve(&problem, &mut xy)?.is_solved();
        Ok::<_, semismooth::complementarity::ComplementarityError>((solved, xy))
    };
    with_each_failing(solve, |found, whole| {
        let (solved, solution) = whole.as_ref().unwrap();
        assert!(*solved && (2.0 * solution[0].powi(3) + solution[0] - 2.0).abs() < 1e-8);
        if let Ok((solved, x)) = found {
            assert!(x.iter().all(|v| v.is_finite()) && (!solved || x == solution));
        }
    });
}

#[cfg(feature = "autodiff")]
mod formulas {
    use std::sync::Arc;

    use semismooth::complementarity::{Autodiff, Mcp, McpSolver, SmoothFunction};
    use semismooth::newton::Newton;
    use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

    use crate::{Counted, with_each_failing};

    struct Prices<'c>(&'c Counted);

    impl SmoothFunction for Prices<'_> {
        fn num_vars(&self) -> usize {
            2
        }
        fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
            self.0.errors.values(out, |out| {
                out[0] = x[0].exp() + x[1] - 3.0;
                out[1] = x[1] * x[1] + x[0] - 1.0;
                self.0.count()
            });
        }
    }

    #[test]
    fn smooth() {
        let solve = |counted: &Arc<Counted>| {
            let problem = Mcp::ncp(Autodiff::new(Prices(counted)))?;
            let mut x = [3.0, 3.0];
            let solved = McpSolver::default().solve(&problem, &mut x)?.is_solved();
            Ok::<_, semismooth::complementarity::ComplementarityError>((solved, x))
        };
        with_each_failing(solve, |found, whole| {
            let (solved, solution) = whole.as_ref().unwrap();
            assert!(*solved);
            if let Ok((solved, x)) = found {
                assert!(!solved || x == solution);
            }
        });
    }

    /// x + |x| / 2 + x³ = 3.
    struct Kinked<'c>(&'c Counted);

    impl NonsmoothFunction for Kinked<'_> {
        fn num_vars(&self) -> usize {
            1
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            self.0.errors.values(out, |out| {
                out[0] = x[0] + kinks.abs(x[0]) * 0.5 + x[0] * x[0] * x[0] - 3.0;
                self.0.count()
            });
        }
    }

    #[test]
    fn with_kinks() {
        let solve = |counted: &Arc<Counted>| {
            let mut x = [-2.0];
            let solved = Newton::default()
                .solve(&Traced::new(Kinked(counted)), &mut x)
                .is_ok();
            (solved, x)
        };
        with_each_failing(solve, |(solved, x), (whole, solution)| {
            assert!(*whole && x[0].is_finite());
            assert!(!solved || x == solution);
        });
    }
}
