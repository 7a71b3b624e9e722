use std::ops::ControlFlow;

use semismooth::Cause;
use semismooth::complementarity::{Mcp, McpFunction, WithJacobian};
use semismooth::optimise::{Bundle, BundleOptions, Implicit, Objective, OptimiseError};
use semismooth::sparse::{Matrix, Pattern};
use semismooth::variational::Polyhedron;

use super::table::{BAD, NOT_POSITIVE, Table};

fn square(p: &[f64], g: &mut [f64]) -> Result<f64, Cause> {
    g[0] = 2.0 * p[0];
    Ok(p[0] * p[0])
}

/// constant + Σ aⱼ xⱼ.
fn affine(a: &'static [f64], constant: f64) -> impl McpFunction + Clone {
    let value = move |x: &[f64], out: &mut [f64]| {
        out[0] = constant + a.iter().zip(x).map(|(a, x)| a * x).sum::<f64>()
    };
    let jacobian =
        move |_: &[f64], jac: &mut Matrix| a.iter().enumerate().for_each(|(j, a)| jac.add(0, j, *a));
    WithJacobian::new(1, value, jacobian).with_pattern(Pattern::full(1, a.len()))
}

/// 0 ≤ x ⟂ x − θ ≥ 0.
fn problem() -> Mcp<impl McpFunction + Clone> {
    Mcp::with_parameters(affine(&[1.0, -1.0], 0.0), vec![0.0], vec![f64::INFINITY]).unwrap()
}

fn objective() -> impl McpFunction {
    affine(&[1.0, 1.0], 0.0)
}

#[test]
fn optimisation() {
    let mut t = Table::new("optimise");
    let (minimise, observed) = (
        "optimise::Bundle::minimise",
        "optimise::Bundle::minimise_observed",
    );
    let set = || Polyhedron::boxed(vec![-1.0], vec![1.0]).unwrap();
    for bad in BAD {
        t.refuses(minimise, "the start", "x[0]", || {
            Bundle::default().minimise(&set(), &[bad], &mut square)
        });
        t.refuses(minimise, "a value at the start", "not finite", || {
            Bundle::default().minimise(&set(), &[0.5], &mut |_: &[f64], _: &mut [f64]| Ok(bad))
        });
        t.refuses("optimise::Implicit::new", "x0", "x0[0]", || {
            Implicit::new(problem(), problem(), objective(), &[bad])
        });
    }
    t.refuses(observed, "a start of another length", "length 2", || {
        Bundle::default().minimise_observed(&set(), &[0.0; 2], &mut square, |_| ControlFlow::Continue(()))
    });
    let empty = Polyhedron::boxed(vec![1.0], vec![-1.0]).unwrap();
    t.refuses(minimise, "an empty set", "contradict", || {
        Bundle::default().minimise(&empty, &[0.0], &mut square)
    });
    let validate = "optimise::BundleOptions::validate";
    for bad in NOT_POSITIVE {
        for options in [
            BundleOptions::default().with_tolerance(bad),
            BundleOptions::default().with_value_tolerance(bad),
            BundleOptions::default().with_step(Some(bad)),
        ] {
            t.refuses(validate, "an option", "out of range", || options.validate());
        }
    }
    for options in [
        BundleOptions::default().with_max_iterations(0),
        BundleOptions::default().with_max_bundle(2),
    ] {
        t.refuses(validate, "a limit", "at least", || options.validate());
        t.refuses(minimise, "a limit", "at least", || {
            Bundle::new(options.clone()).minimise(&set(), &[0.0], &mut square)
        });
    }
    t.refuses("optimise::Implicit::new", "x0", "length 2", || {
        Implicit::new(problem(), problem(), objective(), &[0.0; 2])
    });
    t.refuses("optimise::Implicit::new", "another objective", "length 3", || {
        Implicit::new(problem(), problem(), affine(&[1.0, 1.0, 1.0], 0.0), &[0.0])
    });
    // 0 x + θ + 1 = 0 has no solution.
    let free = || {
        Mcp::with_parameters(
            affine(&[0.0, 1.0], 1.0),
            vec![f64::NEG_INFINITY],
            vec![f64::INFINITY],
        )
        .unwrap()
    };
    let mut f = Implicit::new(free(), free(), objective(), &[0.0]).unwrap();
    let refused = Bundle::default().minimise(&set(), &[0.5], &mut f).unwrap_err();
    assert!(matches!(refused, OptimiseError::Start { .. }), "{refused}");
    let cause = f.evaluate(&[0.5], &mut [0.0]).unwrap_err();
    t.refuses(
        "optimise::Objective::evaluate",
        "no solution",
        "not solved",
        || Err::<f64, _>(cause.downcast_ref::<OptimiseError>().unwrap().clone()),
    );
    t.refuses("minimise", "x0", "length 2", || {
        let bounds: [&[f64]; 2] = [&[0.0], &[1.0]];
        semismooth::minimise(
            |x, _| x[0],
            |x, p| vec![x[0] - p[0]],
            bounds,
            &set(),
            (&[0.0; 2], &[0.0]),
        )
    });
    t.refuses("implicit", "bounds that cross", "lies above", || {
        semismooth::implicit(|x, _| x[0], |x, p| vec![x[0] - p[0]], [&[1.0], &[0.0]], &[0.0], 1)
    });
    t.finish();
}
