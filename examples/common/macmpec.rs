//! Mathematical programs with equilibrium constraints of the collection MacMPEC (S. Leyffer, 2000), whose lower level is a complementarity
//! problem for given upper-level variables, with the optimal values of its list.

use semismooth::optimise::{Bundle, BundleReport, OptimiseError};
use semismooth::piecewise::Expression;
use semismooth::variational::Polyhedron;

/// The best upper-level variables found from a start.
type Found = Result<(Vec<f64>, BundleReport), OptimiseError>;

/// Solves a problem from a start.
type Solve = dyn Fn(&Bundle, &[f64]) -> Found;

pub struct Problem {
    pub name: &'static str,
    /// The value of the list.
    pub published: f64,
    /// Digits after the point of that value.
    pub digits: usize,
    /// Starts: upper-level variables.
    pub starts: Vec<Vec<f64>>,
    pub solve: Box<Solve>,
}

type Objective = for<'a> fn(&[Expression<'a>], &[Expression<'a>]) -> Expression<'a>;
type Function = for<'a> fn(&[Expression<'a>], &[Expression<'a>]) -> Vec<Expression<'a>>;

/// A problem with the lower level 0 ≤ y ⟂ F(y, x) ≥ 0, its solver starting from ones.
fn problem(
    name: &'static str,
    (published, digits): (f64, usize),
    (objective, function, unknowns): (Objective, Function, usize),
    bounds: &[[f64; 2]],
    starts: &[&[f64]],
) -> Problem {
    let [lower, upper] = [0, 1].map(|side| bounds.iter().map(|b| b[side]).collect::<Vec<f64>>());
    Problem {
        name,
        published,
        digits,
        starts: starts.iter().map(|s| s.to_vec()).collect(),
        solve: Box::new(move |bundle, start| {
            let set = Polyhedron::boxed(lower.clone(), upper.clone())?;
            let (zero, free) = (vec![0.0; unknowns], vec![f64::INFINITY; unknowns]);
            let ones = vec![1.0; unknowns];
            let mut f = semismooth::implicit(objective, function, [&zero, &free], &ones, start.len())?;
            bundle.minimise(&set, start, &mut f)
        }),
    }
}

/// The oligopolistic market of F. Facchinei, H. Jiang and L. Qi (1996), after F. H. Murphy, H. D. Sherali and A. L. Soyster (1982): a leader
/// and four followers, who produce at most `most` each; the elasticity of demand is −γ. The data files of gnash10 to gnash18 were not at hand:
/// their γ and `most` are those with which all values of the list come out.
fn gnash(name: &'static str, published: (f64, usize), gamma: f64, most: f64) -> Problem {
    const COST: [f64; 5] = [10.0, 8.0, 6.0, 4.0, 2.0];
    const SLOPE: [f64; 5] = [1.2, 1.1, 1.0, 0.9, 0.8];
    let slope = |i: usize| 5.0_f64.powf(-1.0 / SLOPE[i]);
    let scale = 5000.0_f64.powf(1.0 / gamma);
    let solve = move |bundle: &Bundle, start: &[f64]| {
        let set = Polyhedron::boxed(vec![0.0], vec![most])?;
        let (lower, upper, y0) = ([0.0; 4], [most; 4], [most.min(15.0); 4]);
        let mut f = semismooth::implicit(
            |y, x| {
                let total = x[0] + y[0] + y[1] + y[2] + y[3];
                let power = (1.0 + SLOPE[0]) / SLOPE[0];
                COST[0] * x[0] + slope(0) / power * x[0].powf(power)
                    - x[0] * (scale * total.powf(-1.0 / gamma))
            },
            |y, x| {
                let total = x[0] + y[0] + y[1] + y[2] + y[3];
                let price = scale * total.powf(-1.0 / gamma);
                let fall = scale / gamma * total.powf(-1.0 - 1.0 / gamma);
                (0..4)
                    .map(|i| COST[i + 1] + slope(i + 1) * y[i] - price + y[i] * fall)
                    .collect()
            },
            [&lower, &upper],
            &y0,
            1,
        )?;
        bundle.minimise(&set, start, &mut f)
    };
    Problem {
        name,
        published: published.0,
        digits: published.1,
        starts: vec![vec![0.5 * most]],
        solve: Box::new(solve),
    }
}

/// The four problems of J. V. Outrata, SIAM J. Optim. 4 (1994), in the version of MacMPEC. The file of the fourth was not at hand: with the
/// constant 3 of the other three its value is that of the list.
fn outrata(name: &'static str, published: (f64, usize), objective: Objective, function: Function) -> Problem {
    problem(
        name,
        published,
        (objective, function, 4),
        &[[0.0, 10.0]],
        &[&[0.0], &[5.0], &[10.0]],
    )
}

fn conditions<'a>(x: &[Expression<'a>], y: Expression<'a>) -> Vec<Expression<'a>> {
    vec![
        (1.0 + 0.2 * y) * x[0] - (3.0 + 1.333 * y) - 0.333 * x[2] + 2.0 * x[0] * x[3],
        (1.0 + 0.1 * y) * x[1] - y + x[2] + 2.0 * x[1] * x[3],
        0.333 * x[0] - x[1] + 1.0 - 0.1 * y,
        9.0 + 0.1 * y - x[0].powi(2) - x[1].powi(2),
    ]
}

fn distance<'a>(x: &[Expression<'a>]) -> Expression<'a> {
    (x[0] - 3.0).powi(2) + (x[1] - 4.0).powi(2)
}

pub fn all() -> Vec<Problem> {
    let three: Function = |x, y| conditions(x, y[0]);
    vec![
        gnash("gnash10", (-230.823, 3), 1.0, 150.0),
        gnash("gnash11", (-129.912, 3), 1.1, 150.0),
        gnash("gnash12", (-36.9331, 4), 1.3, 150.0),
        gnash("gnash13", (-7.06178, 5), 1.5, 150.0),
        gnash("gnash14", (-0.179046, 6), 1.7, 150.0),
        gnash("gnash15", (-354.699, 3), 1.0, 50.0),
        gnash("gnash16", (-241.442, 3), 1.1, 40.0),
        gnash("gnash17", (-90.7491, 4), 1.3, 30.0),
        gnash("gnash18", (-25.6982, 4), 1.5, 25.0),
        gnash("gnash19", (-6.11671, 5), 1.7, 20.0),
        outrata("outrata31", (3.2077, 4), |x, _| 0.5 * distance(x), three),
        outrata(
            "outrata32",
            (3.4494, 4),
            |x, _| 0.5 * (distance(x) + (x[2] - 1.0).powi(2)),
            three,
        ),
        outrata(
            "outrata33",
            (4.60425, 5),
            |x, _| 0.5 * (distance(x) + 10.0 * x[3].powi(2)),
            three,
        ),
        outrata(
            "outrata34",
            (6.59268, 5),
            |x, y| 0.5 * (distance(x) + (x[2] - 1.0).powi(2) + (x[3] - 1.0).powi(2) + y[0].powi(2)),
            three,
        ),
        problem(
            "stackelberg1",
            (-3266.67, 2),
            (
                |y, x| 0.5 * x[0].powi(2) + 0.5 * x[0] * y[0] - 95.0 * x[0],
                |y, x| vec![2.0 * y[0] + 0.5 * x[0] - 100.0],
                1,
            ),
            &[[0.0, 200.0]],
            &[&[0.0], &[200.0]],
        ),
        problem(
            "jr1",
            (0.5, 1),
            (
                |y, x| (x[0] - 1.0).powi(2) + y[0].powi(2),
                |y, x| vec![y[0] - x[0]],
                1,
            ),
            &[[f64::NEG_INFINITY, f64::INFINITY]],
            &[&[-1.0], &[3.0]],
        ),
    ]
}
