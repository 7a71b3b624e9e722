//! Gradients and Hessians of random expressions compared with differences, and their values with a recursive evaluation of the formula.

mod common;

use common::header;
use proptest::prelude::*;
use semismooth::complementarity::{McpFunction, Program, kkt};
use semismooth::sparse::Matrix;
use semismooth_cli::graph::{Gradient, Hessian};
use semismooth_cli::model::Model;
use semismooth_cli::nl::read;
use semismooth_cli::program::Nlp;
use semismooth_cli::square::Square;

const VARIABLES: usize = 4;
const DEFINED: usize = 2;

/// A formula as a tree.
#[derive(Debug, Clone)]
enum Tree {
    Number(f64),
    Reference(usize),
    One(usize, Box<Tree>),
    Two(usize, Box<Tree>, Box<Tree>),
    Sum(Vec<Tree>),
    If(Box<Tree>, Box<Tree>, Box<Tree>),
}

/// Codes of operators that are smooth on ℝ, so that every tree is differentiable everywhere.
const ONE: [usize; 7] = [16, 41, 46, 37, 49, 50, 79];

fn tree(references: usize) -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        1 => (-2.0..2.0_f64).prop_map(Tree::Number),
        3 => (0..references).prop_map(Tree::Reference),
    ];
    leaf.prop_recursive(5, 24, 3, |inner| {
        let boxed = || inner.clone().prop_map(Box::new);
        prop_oneof![
            2 => ((0..ONE.len()), boxed()).prop_map(|(k, a)| Tree::One(ONE[k], a)),
            3 => (prop_oneof![Just(0), Just(1), Just(2)], boxed(), boxed()).prop_map(|(o, a, b)| Tree::Two(o, a, b)),
            // A quotient and powers whose operands stay away from 0: (a, 2 + sin b), (2 + sin a)^b, a^2, a^3.
            1 => (boxed(), boxed()).prop_map(|(a, b)| Tree::Two(3, a, away(b))),
            1 => (boxed(), boxed()).prop_map(|(a, b)| Tree::Two(5, away(a), b)),
            1 => (boxed(), prop_oneof![Just(2.0), Just(3.0)]).prop_map(|(a, p)| Tree::Two(5, a, Box::new(Tree::Number(p)))),
            1 => proptest::collection::vec(inner.clone(), 3..5).prop_map(Tree::Sum),
            // A condition between constants, so that the branch does not depend on the variables.
            1 => (any::<bool>(), boxed(), boxed()).prop_map(|(first, a, b)| {
                let test = Tree::Two(22, Box::new(Tree::Number(f64::from(u8::from(!first)))), Box::new(Tree::Number(0.5)));
                Tree::If(Box::new(test), a, b)
            }),
        ]
    })
}

fn away(of: Box<Tree>) -> Box<Tree> {
    Box::new(Tree::Two(
        0,
        Box::new(Tree::Number(2.0)),
        Box::new(Tree::One(41, of)),
    ))
}

impl Tree {
    fn write(&self, out: &mut String) {
        match self {
            Self::Number(x) => out.push_str(&format!("n{x:?}\n")),
            Self::Reference(k) => out.push_str(&format!("v{k}\n")),
            Self::One(op, a) => {
                out.push_str(&format!("o{op}\n"));
                a.write(out);
            }
            Self::Two(op, a, b) => {
                out.push_str(&format!("o{op}\n"));
                a.write(out);
                b.write(out);
            }
            Self::Sum(all) => {
                out.push_str(&format!("o54\n{}\n", all.len()));
                all.iter().for_each(|t| t.write(out));
            }
            Self::If(t, a, b) => {
                out.push_str("o35\n");
                [t, a, b].iter().for_each(|t| t.write(out));
            }
        }
    }

    /// The value; NaN if an intermediate value is so large that functions of it are inaccurate.
    fn value(&self, x: &[f64]) -> f64 {
        let value = match self {
            Self::Number(x) => *x,
            Self::Reference(k) => x[*k],
            Self::One(op, a) => {
                let a = a.value(x);
                match op {
                    16 => -a,
                    41 => a.sin(),
                    46 => a.cos(),
                    37 => a.tanh(),
                    49 => a.atan(),
                    50 => a.asinh(),
                    _ => 1.0 / (1.0 + (-a).exp()),
                }
            }
            Self::Two(op, a, b) => {
                let (a, b) = (a.value(x), b.value(x));
                match op {
                    0 => a + b,
                    1 => a - b,
                    2 => a * b,
                    3 => a / b,
                    22 => f64::from(u8::from(a < b)),
                    _ => a.powf(b),
                }
            }
            Self::Sum(all) => all.iter().map(|t| t.value(x)).sum(),
            Self::If(t, a, b) => if t.value(x) != 0.0 { a } else { b }.value(x),
        };
        if value.abs() <= 100.0 { value } else { f64::NAN }
    }
}

/// Trees for two defined variables, the rows and the objective, with the linear parts of all.
#[derive(Debug, Clone)]
struct Formulas {
    defined: Vec<Tree>,
    rows: Vec<Tree>,
    objective: Tree,
    linear: Vec<[f64; VARIABLES]>,
}

fn formulas() -> impl Strategy<Value = Formulas> {
    let all = VARIABLES + DEFINED;
    (
        (tree(VARIABLES), tree(VARIABLES + 1)),
        proptest::collection::vec(tree(all), VARIABLES),
        tree(all),
        proptest::collection::vec(proptest::array::uniform4(-2.0..2.0_f64), VARIABLES + 3),
    )
        .prop_map(|((first, second), rows, objective, linear)| Formulas {
            defined: vec![first, second],
            rows,
            objective,
            linear,
        })
}

impl Formulas {
    fn file(&self) -> String {
        let (n, m) = (VARIABLES, self.rows.len());
        let mut out = header([n, m, 1, 0, n * m, n, DEFINED]);
        let pairs = |out: &mut String, linear: &[f64; VARIABLES]| {
            linear
                .iter()
                .enumerate()
                .for_each(|(j, c)| out.push_str(&format!("{j} {c:?}\n")));
        };
        for (k, tree) in self.defined.iter().enumerate() {
            out.push_str(&format!("V{} {n} 0\n", n + k));
            pairs(&mut out, &self.linear[m + 1 + k]);
            tree.write(&mut out);
        }
        for (i, tree) in self.rows.iter().enumerate() {
            out.push_str(&format!("C{i}\n"));
            tree.write(&mut out);
        }
        out.push_str("O0 1\n");
        self.objective.write(&mut out);
        out.push_str("r\n5 1 2\n5 3 1\n4 0.5\n4 -1\nb\n0 -1 1\n2 0\n3\n3\n");
        for (i, linear) in self.linear[..m].iter().enumerate() {
            out.push_str(&format!("J{i} {n}\n"));
            pairs(&mut out, linear);
        }
        out.push_str(&format!("G0 {n}\n"));
        pairs(&mut out, &self.linear[m]);
        out
    }

    fn dot(&self, k: usize, x: &[f64]) -> f64 {
        self.linear[k].iter().zip(x).map(|(c, x)| c * x).sum()
    }

    /// Values of the rows and of the objective.
    fn values(&self, x: &[f64]) -> Vec<f64> {
        let mut all = x.to_vec();
        for (k, tree) in self.defined.iter().enumerate() {
            let value = tree.value(&all) + self.dot(self.rows.len() + 1 + k, x);
            all.push(value);
        }
        let trees = self.rows.iter().chain([&self.objective]).enumerate();
        trees.map(|(k, tree)| tree.value(&all) + self.dot(k, x)).collect()
    }
}

fn model_of(formulas: &Formulas) -> Model {
    read(formulas.file().as_bytes()).unwrap()
}

fn moderate(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite() && v.abs() < 1e4)
}

/// Compares with central differences of two step sizes, whose distance estimates their error.
fn near(found: f64, coarse: f64, fine: f64, scale: f64) -> bool {
    (found - fine).abs() <= 2.0 * (coarse - fine).abs() + 1e-6 * scale
}

/// Compares the Jacobian of a function with differences of its values, where the differences are accurate enough.
fn compare(function: &impl McpFunction, x: &[f64]) -> Result<(), TestCaseError> {
    let n = function.num_vars();
    let mut jac = Matrix::zeros(function.pattern());
    function.jacobian(x, &mut jac);
    prop_assert_eq!(jac.stray(), None);
    let value = |j: usize, h: f64| {
        let (mut y, mut out) = (x.to_vec(), vec![0.0; n]);
        y[j] += h;
        function.value(&y, &mut out);
        out
    };
    for j in 0..n {
        let quotient = |h: f64| -> Vec<f64> {
            let (above, below) = (value(j, h), value(j, -h));
            above
                .iter()
                .zip(below)
                .map(|(a, b)| (a - b) / (2.0 * h))
                .collect()
        };
        let (coarse, fine) = (quotient(1e-3), quotient(2.5e-4));
        prop_assume!(moderate(&fine) && moderate(&coarse));
        for i in 0..n {
            let found = jac.get(i, j);
            prop_assume!(found.abs() < 1e4);
            prop_assert!(
                near(found, coarse[i], fine[i], 1.0 + found.abs()),
                "({}, {}): {} {}",
                i,
                j,
                found,
                fine[i]
            );
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, max_global_rejects: 1_000_000, ..ProptestConfig::default() })]

    #[test]
    fn values_follow_the_formula(f in formulas(), x in proptest::array::uniform4(-1.5..1.5_f64)) {
        let expected = f.values(&x);
        prop_assume!(moderate(&expected));
        let model = model_of(&f);
        let mut values = model.graph.workspace();
        model.graph.set_variables(&x, &mut values);
        for (row, expected) in model.rows.iter().zip(&expected) {
            let found = row.body(&model.graph, &mut values);
            prop_assert!((found - expected).abs() <= 1e-9 * (1.0 + expected.abs()), "{found} {expected}");
        }
    }

    #[test]
    fn jacobians_of_square_systems_are_those_of_their_values(f in formulas(), x in proptest::array::uniform4(-1.5..1.5_f64)) {
        prop_assume!(moderate(&f.values(&x)));
        let model = model_of(&f);
        let square = Square::new(&model).unwrap();
        let mut out = [0.0; VARIABLES];
        square.value(&x, &mut out);
        prop_assume!(moderate(&out));
        compare(&square, &x)?;
    }

    #[test]
    fn the_hessian_is_the_derivative_of_gradients(f in formulas(), x in proptest::array::uniform4(-1.2..1.2_f64), w in proptest::array::uniform4(-2.0..2.0_f64)) {
        prop_assume!(moderate(&f.values(&x)));
        let model = model_of(&f);
        let graph = &model.graph;
        let terms: Vec<_> = model.rows.iter().filter_map(|r| r.expression.as_ref()).zip(w).collect();
        let mut values = graph.workspace();
        let mut sweeps = Gradient::new(graph);
        let mut gradient = |x: &[f64]| {
            let mut g = [0.0; VARIABLES];
            graph.set_variables(x, &mut values);
            for (expression, weight) in &terms {
                graph.evaluate(expression, &mut values);
                sweeps.sweep(graph, expression, &values, *weight, &mut |j, v| g[j] += v);
            }
            g
        };
        let mut quotient = |j: usize, h: f64| {
            let (mut above, mut below) = (x, x);
            above[j] += h;
            below[j] -= h;
            let (a, b) = (gradient(&above), gradient(&below));
            std::array::from_fn::<f64, VARIABLES, _>(|i| (a[i] - b[i]) / (2.0 * h))
        };
        let quotients: Vec<_> = (0..VARIABLES).map(|j| (quotient(j, 1e-3), quotient(j, 2.5e-4))).collect();
        prop_assume!(quotients.iter().all(|(a, b)| moderate(a) && moderate(b)));
        let mut values = graph.workspace();
        graph.set_variables(&x, &mut values);
        terms.iter().for_each(|(e, _)| { graph.evaluate(e, &mut values); });
        let mut hessian = Hessian::new(graph);
        let pattern = hessian.pattern(graph, terms.iter().map(|(e, _)| *e), 1000).unwrap();
        // Twice, to check that the buffers are reset.
        for _ in 0..2 {
            let mut found = [[0.0; VARIABLES]; VARIABLES];
            let mut stray = false;
            hessian.sweep(graph, terms.iter().copied(), &values, &mut |i, j, v| {
                stray |= pattern.binary_search(&(i, j)).is_err();
                found[i][j] += v;
            });
            prop_assert!(!stray);
            let size = found.iter().flatten().fold(1.0_f64, |m, v| m.max(v.abs()));
            for (j, (coarse, fine)) in quotients.iter().enumerate() {
                for i in 0..VARIABLES {
                    prop_assert_eq!(found[i][j], found[j][i]);
                    prop_assert!(near(found[i][j], coarse[i], fine[i], size), "({}, {}): {} {}", i, j, found[i][j], fine[i]);
                }
            }
        }
    }

    #[test]
    fn first_order_conditions_have_the_derivatives_of_their_values(f in formulas(), z in proptest::collection::vec(-1.2..1.2_f64, VARIABLES + 2)) {
        // Two of the rows are complementarities, which a program ignores.
        let model = model_of(&f);
        let nlp = Nlp::new(&model, &model.objectives[0]).unwrap();
        prop_assert_eq!(nlp.num_constraints(), 2);
        let values = f.values(&z[..VARIABLES]);
        prop_assume!(moderate(&values));
        let objective = values[VARIABLES];
        prop_assert!((nlp.objective(&z[..VARIABLES]) - objective).abs() <= 1e-9 * (1.0 + objective.abs()));
        let (lower, upper) = nlp.bounds();
        let problem = kkt(&nlp, &nlp.kinds(), lower, upper).unwrap();
        let mut out = vec![0.0; z.len()];
        problem.function().value(&z, &mut out);
        prop_assume!(moderate(&out));
        compare(problem.function(), &z)?;
    }
}
