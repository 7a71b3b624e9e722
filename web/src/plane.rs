//! Where the solutions of a friction problem change, in the plane of a load and the coefficient of friction.

use semismooth::contact::{FrictionCoefficient, LoadPath, PlanarCoulomb};
use semismooth::continuation::{Branch, Continuation, Direction, TransitionSet};
use semismooth::piecewise::select;
use serde::{Deserialize, Serialize};

use crate::error::{Error, interval};
use crate::friction::{Map, Problem, options};

/// Numbers of loads and of coefficients of friction at which transitions are computed.
const COLUMNS: usize = 7;
const ROWS: usize = 3;
/// Test functions below this value vanish at a transition.
const VANISHED: f64 = 1e-8;
/// Relative distance up to which a transition lies on a line found before.
const SAME: f64 = 1e-6;

/// Loads base + β direction, coefficients of friction α weights, and the window of both.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Plane {
    lambda: f64,
    mu: f64,
    base: Vec<f64>,
    direction: Vec<f64>,
    weights: Vec<f64>,
    /// The range of β.
    load: [f64; 2],
    /// The range of α.
    friction: [f64; 2],
}

/// The lines of the transition set.
#[derive(Debug, Serialize)]
pub(crate) struct Lines {
    lines: Vec<Line>,
    /// Reasons for lines that end inside the window.
    notes: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Line {
    /// Contact node, from 0.
    node: usize,
    /// θ¹, θ² or θ³: 0, 1, 2.
    test: usize,
    /// (β, α) of each point.
    points: Vec<[f64; 2]>,
    /// Whether solutions fold there, between each point and the next, where it is known.
    folds: Vec<Option<bool>>,
}

/// A transition at a fixed load or at a fixed coefficient of friction.
struct Seed {
    node: usize,
    test: usize,
    /// (u, λν, λt, α, β).
    x: Vec<f64>,
}

impl Plane {
    pub(crate) fn lines(&self) -> Result<Lines, Error> {
        interval("the range of the load", self.load)?;
        let middle = self.problem(0.5 * (self.load[0] + self.load[1]))?.map()?;
        let unloaded = middle.with_load(LoadPath::constant(self.base.clone()))?;
        let law = FrictionCoefficient::affine(vec![0.0; self.weights.len()], self.weights.clone())?;
        let family = unloaded.with_second_parameter(self.direction.clone(), PlanarCoulomb::new(law))?;
        let mut found: Vec<(Seed, Branch)> = Vec::new();
        let mut lines = Lines {
            lines: Vec::new(),
            notes: Vec::new(),
        };
        for seed in self.seeds()? {
            let known = |(s, branch): &(Seed, Branch)| {
                (s.node, s.test) == (seed.node, seed.test) && passes(branch, &seed.x)
            };
            if found.iter().any(known) {
                continue;
            }
            for sign in [-1.0, 1.0] {
                match self.follow(&family, &seed, sign) {
                    Ok((line, branch)) => {
                        lines.lines.push(line);
                        let Seed { node, test, ref x } = seed;
                        found.push((
                            Seed {
                                node,
                                test,
                                x: x.clone(),
                            },
                            branch,
                        ));
                    }
                    Err(e) => lines.notes.push(e.to_string()),
                }
            }
        }
        lines.notes.sort();
        lines.notes.dedup();
        Ok(lines)
    }

    fn problem(&self, beta: f64) -> Result<Problem, Error> {
        let load = self.base.iter().zip(&self.direction).map(|(b, d)| b + beta * d);
        Ok(Problem {
            lambda: self.lambda,
            mu: self.mu,
            load: load.collect(),
            rate: vec![0.0; self.base.len()],
            friction: vec![0.0; self.weights.len()],
            friction_rate: self.weights.clone(),
            range: self.friction,
        })
    }

    fn columns(&self) -> Vec<f64> {
        spread(self.load, COLUMNS)
    }

    fn rows(&self) -> Vec<f64> {
        spread(self.friction, ROWS)
    }

    /// The transitions in all columns and rows.
    fn seeds(&self) -> Result<Vec<Seed>, Error> {
        let mut seeds = Vec::new();
        for beta in self.columns() {
            seeds.extend(transitions(&self.problem(beta)?, |x| x.push(beta))?);
        }
        for alpha in self.rows() {
            let row = Problem {
                load: self.base.clone(),
                rate: self.direction.clone(),
                friction: self.weights.iter().map(|w| w * alpha).collect(),
                friction_rate: vec![0.0; self.weights.len()],
                range: self.load,
                ..self.problem(0.0)?
            };
            seeds.extend(transitions(&row, |x| x.insert(x.len() - 1, alpha))?);
        }
        Ok(seeds)
    }

    fn follow(&self, family: &Map, seed: &Seed, sign: f64) -> Result<(Line, Branch), Error> {
        let set = TransitionSet::new(family, seed.node, seed.test)?;
        let options = options(self.load)
            .continuation
            .with_targets(self.columns())
            .with_max_points(600)
            .with_max_arclength(20.0 * (self.load[1] - self.load[0]));
        let alpha = seed.x.len() - 2;
        // Lines run roughly along one of the axes: a direction that is unlikely to be orthogonal to any of them.
        let mut along = vec![0.0; seed.x.len()];
        along[alpha] = sign;
        along[alpha + 1] = sign * std::f64::consts::SQRT_2;
        let [lowest, highest] = self.friction;
        let mut curve = Continuation::new(&set, &seed.x, Direction::Along(along), options)?
            .with_stop("least friction", move |x| x[alpha] - lowest)
            .with_stop("largest friction", move |x| highest - x[alpha]);
        for row in self.rows() {
            curve = curve.with_monitor("row", move |x| x[alpha] - row);
        }
        let branch = Branch::collect(curve, |_| std::ops::ControlFlow::Continue(()))?;
        let walk = branch.polyline();
        let folds = walk.windows(2).map(|ends| {
            let middle: Vec<f64> = ends[0]
                .1
                .iter()
                .zip(ends[1].1)
                .map(|(a, b)| 0.5 * (a + b))
                .collect();
            Ok(set.is_fold(&select(&set, &middle), &middle)?)
        });
        let line = Line {
            node: seed.node,
            test: seed.test,
            points: walk.iter().map(|(_, x)| [x[alpha + 1], x[alpha]]).collect(),
            folds: folds.collect::<Result<_, Error>>()?,
        };
        Ok((line, branch))
    }
}

/// Interior values of an interval, not at round fractions.
fn spread([lower, upper]: [f64; 2], count: usize) -> Vec<f64> {
    let at = |k: usize| lower + (upper - lower) * (k as f64 + 0.517) / count as f64;
    (0..count).map(at).collect()
}

/// The transitions of a problem; `complete` turns their x into (u, λν, λt, α, β).
fn transitions(problem: &Problem, complete: impl Fn(&mut Vec<f64>)) -> Result<Vec<Seed>, Error> {
    let map = problem.map()?;
    let diagram = problem.explore(&map)?;
    let mut seeds = Vec::new();
    for vertex in diagram.vertices().iter().filter(|v| v.arms.len() > 1) {
        for (node, theta) in map.theta(&vertex.x).iter().enumerate() {
            let open = theta[0] < -VANISHED;
            for (test, value) in theta.iter().enumerate() {
                // For an open node only θ¹ is a kink.
                if value.abs() <= VANISHED && (test == 0 || !open) {
                    let mut x = vertex.x.clone();
                    complete(&mut x);
                    seeds.push(Seed { node, test, x });
                }
            }
        }
    }
    Ok(seeds)
}

/// Whether a line passes through a transition. Lines have points exactly on the columns (their targets), and their crossings with the rows
/// are monitored.
fn passes(branch: &Branch, x: &[f64]) -> bool {
    let near = |point: &[f64]| {
        let far = point
            .iter()
            .zip(x)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        far <= SAME * (1.0 + x.iter().fold(0.0, |m: f64, v| m.max(v.abs())))
    };
    let rows = branch.monitor_crossings.iter().map(|c| c.point.x.as_slice());
    branch
        .polyline()
        .into_iter()
        .map(|(_, point)| point)
        .chain(rows)
        .any(near)
}
