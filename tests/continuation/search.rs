//! Searches for solutions without complete enumeration: their results are compared with complete lists.

use std::ops::ControlFlow;
use std::time::Duration;

use crate::random::Random;
use semismooth::InputError;
use semismooth::contact::{CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::continuation::{
    ContinuationError, FoundBy, FoundSolutions, SearchOptions, search_solutions, search_solutions_observed,
};
use semismooth::enumeration::{Completeness, EnumerationOptions, all_solutions};
use semismooth::piecewise::{MinMap, PiecewiseSmooth};
use semismooth::sparse::Matrix;

const NONE: [[f64; 1]; 0] = [];

/// p nodes of the model of Hild and Renard (λ = μ = 1), coupled a little, F = 4; `multiple` of them have the load of two branches
/// (three solutions each where there is no coupling), the others one that sticks.
fn nodes(p: usize, multiple: usize, coupling: f64, seed: u64) -> CondensedContact<PlanarCoulomb> {
    let n = 2 * p;
    let mut rng = Random::new(seed);
    let mut rows = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..i {
            let block = if i / 2 == j / 2 { -1.0 } else { 0.0 };
            rows[i][j] = block + coupling * rng.symmetric() / p as f64;
            rows[j][i] = rows[i][j];
        }
        rows[i][i] = 2.0;
    }
    let pick = |first: usize| {
        let entries: Vec<_> = (0..p).map(|i| (i, 2 * i + first, 1.0)).collect();
        Matrix::from_triplets(p, n, &entries).unwrap()
    };
    let load = (0..p).flat_map(|i| if i < multiple { [1.5, -4.0] } else { [2.0, 1.0] });
    let slope: Vec<f64> = rng.vector(n, 1.0).iter().map(|v| 0.3 * v).collect();
    let load = LoadPath::affine(load.collect::<Vec<_>>(), slope);
    let friction = FrictionCoefficient::nodal(vec![4.0; p]).unwrap();
    let problem = FullContact::planar(
        Matrix::from_rows(&rows).unwrap(),
        pick(0),
        pick(1),
        load,
        friction,
    );
    problem.unwrap().condensed().unwrap()
}

fn is_solution<P: PiecewiseSmooth>(map: &P, x: &[f64]) -> bool {
    let mut r = vec![0.0; map.num_residuals()];
    semismooth::piecewise::value(map, x, &mut r);
    r.iter().all(|r| r.abs() < 1e-9)
}

fn distinct(found: &FoundSolutions) -> bool {
    let s = &found.solutions;
    (0..s.len()).all(|i| {
        (0..i).all(|j| {
            let far = s[i].x.iter().zip(&s[j].x).map(|(a, b)| (a - b).abs());
            far.fold(0.0, f64::max) > 1e-7
        })
    })
}

#[test]
fn friction_against_complete_lists() {
    let map = nodes(6, 2, 0.5, 3);
    let complete = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
    assert_eq!(complete.completeness, Completeness::Complete);
    assert_eq!(complete.solutions.len(), 9);
    let found = search_solutions(&map, 0.0, &NONE, &SearchOptions::default()).unwrap();
    assert_eq!(found.solutions.len(), 9, "{found}");
    assert_eq!(found.index_sum, Some(1));
    assert!(distinct(&found));
    for s in &found.solutions {
        let same = complete.solutions.iter().find(|c| {
            let apart = c.x.iter().zip(&s.x).map(|(a, b)| (a - b).abs());
            apart.fold(0.0, f64::max) < 1e-9
        });
        assert_eq!(same.expect("a solution").det_signs[0], s.det_sign);
    }
    assert_eq!(found.to_string(), "found 9, complete: unknown; index sum +1");
}

/// Without coupling each of three nodes has three solutions; regular ones persist under a small coupling.
#[test]
fn friction_with_many_nodes() {
    for (p, coupling) in [(14, 0.0), (14, 0.5), (24, 0.0)] {
        let map = nodes(p, 3, coupling, 3);
        let found = search_solutions(&map, 0.0, &NONE, &SearchOptions::default()).unwrap();
        assert!(found.solutions.iter().all(|s| is_solution(&map, &s.x)));
        assert!(distinct(&found));
        assert_eq!((found.solutions.len(), found.index_sum), (27, Some(1)), "{found}");
    }
}

/// min(y³ − y − c − α, 3 + y) at every component: three roots each for |c + α| < 2/(3√3).
fn cubics(c: &'static [f64]) -> impl PiecewiseSmooth {
    MinMap::curve(c.len(), move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for i in 0..c.len() {
            a[i] = x[i] * x[i] * x[i] - x[i] - c[i] - x[c.len()];
            b[i] = 3.0 + x[i];
        }
    })
}

/// The roots of y³ − y = c by bisection between the critical points.
fn roots(c: f64) -> Vec<f64> {
    let f = |y: f64| y * y * y - y - c;
    let turn = 1.0 / 3f64.sqrt();
    let mut list = Vec::new();
    for (mut a, mut b) in [(-2.0, -turn), (-turn, turn), (turn, 2.0)] {
        if f(a) * f(b) > 0.0 {
            continue;
        }
        for _ in 0..200 {
            let m = 0.5 * (a + b);
            if f(a) * f(m) <= 0.0 { b = m } else { a = m }
        }
        list.push(0.5 * (a + b));
    }
    list
}

#[test]
fn curved_pieces() {
    const C: [f64; 4] = [0.1, -0.2, 0.3, 0.7];
    let map = cubics(&C);
    let found = search_solutions(&map, 0.0, &NONE, &SearchOptions::default()).unwrap();
    // Three, three, three and one.
    let exact: Vec<Vec<f64>> = C.iter().map(|c| roots(*c)).collect();
    assert_eq!(exact.iter().map(Vec::len).product::<usize>(), 27);
    assert_eq!((found.solutions.len(), found.index_sum), (27, Some(1)), "{found}");
    assert!(distinct(&found));
    for s in &found.solutions {
        for (y, roots) in s.x.iter().zip(&exact) {
            assert!(roots.iter().any(|r| (r - y).abs() < 1e-9), "{y}");
        }
        let sign: f64 = s.x[..4].iter().map(|y| (3.0 * y * y - 1.0).signum()).product();
        assert_eq!(s.index, Some(sign as i8));
    }
    assert!(
        all_solutions(&map, 0.0, &EnumerationOptions::default()).is_err(),
        "not affine"
    );
}

#[test]
fn each_method_finds_solutions_alone() {
    let map = cubics(&[0.1]);
    let off = SearchOptions::default()
        .with_starts(0)
        .with_neighbours(0)
        .with_deflations(0)
        .with_reach(None);
    let start = [[1.2, 0.0]];
    let run = |options: &SearchOptions| search_solutions(&map, 0.0, &start, options).unwrap();
    let by = |found: &FoundSolutions, way: FoundBy| found.solutions.iter().filter(|s| s.by == way).count();
    assert_eq!(run(&off).solutions.len(), 1);
    let deflated = run(&off.clone().with_deflations(20));
    assert_eq!(
        (by(&deflated, FoundBy::Start), by(&deflated, FoundBy::Deflation)),
        (1, 2),
        "{deflated}"
    );
    let followed = run(&off.clone().with_reach(Some(1.0)));
    assert_eq!(
        (
            by(&followed, FoundBy::Start),
            by(&followed, FoundBy::Continuation)
        ),
        (1, 2),
        "{followed}"
    );
    let random = run(&off.clone().with_starts(50));
    assert_eq!(
        (by(&random, FoundBy::Start), by(&random, FoundBy::RandomStart)),
        (1, 2),
        "{random}"
    );
    assert_eq!(run(&off.clone().with_starts(50)), random);
}

#[test]
fn an_equation_without_solution() {
    let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = 1.0 + x[0] * x[0];
        b[0] = 2.0;
    });
    let found = search_solutions(&map, 0.0, &NONE, &SearchOptions::default()).unwrap();
    assert_eq!((found.solutions.len(), found.converged), (0, 0));
    // The empty sum: the degree of this map is 0.
    assert_eq!(found.index_sum, Some(0));
}

#[test]
fn folds_have_index_zero_and_continua_none() {
    // α = |y| at its kink: one solution, the sum of a regular value on either side.
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = x[1] + x[0];
    });
    let found = search_solutions(&map, 0.0, &NONE, &SearchOptions::default()).unwrap();
    assert_eq!(
        (found.solutions.len(), found.index_sum),
        (1, Some(0)),
        "{found:?}"
    );
    // α = min(y, 0) at 0: all y ≥ 0.
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] - x[1];
        b[0] = -x[1];
    });
    let found = search_solutions(&map, 0.0, &[[-1.0, -1.0]], &SearchOptions::default()).unwrap();
    assert!(found.continua > 0 && found.index_sum.is_none(), "{found:?}");
}

#[test]
fn it_can_be_ended_and_bad_input_is_refused() {
    let map = nodes(6, 2, 0.2, 1);
    let mut calls = 0;
    let ended = search_solutions_observed(&map, 0.0, &NONE, &SearchOptions::default(), |_| {
        calls += 1;
        if calls == 3 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
    .unwrap();
    assert_eq!((calls, ended.runs), (3, 3));
    let options = SearchOptions::default();
    let run = |limit: Option<Duration>| {
        search_solutions(&map, 0.0, &NONE, &options.clone().with_max_time(limit)).unwrap()
    };
    let (none, long, over) = (
        run(None),
        run(Some(Duration::from_secs(3600))),
        run(Some(Duration::ZERO)),
    );
    assert_eq!((long.runs, &long.solutions), (none.runs, &none.solutions));
    assert!(none.runs > 3 && over.runs == 0 && over.solutions.is_empty());
    let short = search_solutions(&map, 0.0, &[vec![0.0; 3]], &options);
    assert!(matches!(
        short,
        Err(ContinuationError::Input(InputError::Length { .. }))
    ));
    let nan = search_solutions(&map, 0.0, &[vec![f64::NAN; 13]], &options);
    assert!(matches!(
        nan,
        Err(ContinuationError::Input(InputError::NotFinite { .. }))
    ));
    assert!(search_solutions(&map, f64::NAN, &NONE, &options).is_err());
    for bad in [
        options.clone().with_spread(0.0),
        options.with_reach(Some(f64::NAN)),
    ] {
        let refused = search_solutions(&map, 0.0, &NONE, &bad);
        assert!(matches!(
            refused,
            Err(ContinuationError::Input(InputError::Option { .. }))
        ));
    }
}
