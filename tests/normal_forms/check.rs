//! The catalogue against itself, without the code that it judges: what it calls solutions are solutions, there are no others, and the
//! coordinates are what they say.

use semismooth::piecewise::{PiecewiseSmooth, Selection, Selections, Traced};

use crate::coordinates::Embedded;
use crate::forms::{Entry, FAMILIES, Kind, solve};
use crate::random::Random;

const MEMBERS: u64 = 8;

/// Calls `check` with members of all families.
fn members(mut check: impl FnMut(&str, &Entry, &mut Random)) {
    for (_, name, draw) in FAMILIES {
        for seed in 0..MEMBERS {
            let mut random = Random::new(977 * seed + 5);
            let entry = draw(&mut random);
            check(name, &entry, &mut random);
        }
    }
}

/// H(x) with the pieces that the test functions choose; all orders of facets, the kinks may be nested.
fn residual(map: &Traced<Embedded>, x: &[f64]) -> (Vec<f64>, Selection) {
    let mut h = vec![0.0; map.num_residuals()];
    let mut chosen = Selection::uniform(map.num_sites(), 0);
    let mut theta = vec![0.0; (0..map.num_sites()).map(|s| map.num_tests(s)).sum()];
    map.test_functions(x, &mut theta);
    let mut first = 0;
    for site in 0..map.num_sites() {
        let tests = &theta[first..first + map.num_tests(site)];
        first += tests.len();
        let piece = match tests {
            [t] => usize::from(*t < 0.0),
            [lower, _] if *lower < 0.0 => 0,
            [_, upper] => 1 + usize::from(*upper > 0.0),
            _ => unreachable!("kinks have one or two test functions"),
        };
        chosen.set(site, piece);
    }
    map.residual(&chosen, x, &mut h);
    (h, chosen)
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[test]
fn known_curves_are_solutions_and_begin_at_the_vertex() {
    members(|name, entry, random| {
        let inner = Embedded::random(entry.core.clone(), random);
        let map = Traced::new(inner.clone());
        for curve in entry.arms.iter().chain(&entry.more) {
            for _ in 0..10 {
                let t = random.unit();
                let (y, a) = ((curve.y)(t), f64::from(curve.side) * t);
                let z = inner.place(&y, a);
                let (h, _) = residual(&map, &z);
                assert!(inner.largest(&h) < 1e-12, "{name}: {} at {a}", inner.largest(&h));
                let back = inner.normal(&z);
                let there: Vec<f64> = y.iter().copied().chain([a]).collect();
                let off = back
                    .iter()
                    .zip(&there)
                    .map(|(p, q)| (p - q).abs())
                    .fold(0.0, f64::max);
                assert!(off < 1e-12, "{name}: {back:?} is not {there:?}");
            }
        }
        for arm in &entry.arms {
            assert!(
                norm(&(arm.y)(0.0)) == 0.0 && norm(&(arm.y)(1e-14)) < 1e-4,
                "{name}"
            );
        }
        for level in entry.levels.iter().flat_map(|l| [*l, -*l]) {
            for y in entry.at(level) {
                let (h, _) = residual(&map, &inner.place(&y, level));
                assert!(
                    inner.largest(&h) < 1e-12,
                    "{name}: {} at {level}",
                    inner.largest(&h)
                );
            }
        }
        for fold in &entry.folds {
            let (a, y) = fold.split_last().expect("a fold has a parameter");
            assert!(
                inner.largest(&residual(&map, &inner.place(y, *a)).0) < 1e-12,
                "{name}"
            );
        }
    });
}

/// Newton's method on every selection from many starts finds no solution that is not known, and all that are known and regular.
#[test]
fn there_are_no_other_solutions() {
    members(|name, entry, random| {
        if entry.kinds == [Kind::Continuum] && entry.levels.is_empty() {
            return;
        }
        let map = Traced::new(Embedded::plain(entry.core.clone()));
        let n = map.num_residuals();
        let starts = (200 >> map.num_sites().min(4)).max(8);
        let pick = random.below(entry.levels.len());
        for level in [1.0, -1.0].map(|side| side * entry.levels[pick]) {
            let known = entry.at(level);
            let (mut found, size) = (vec![false; known.len()], level.abs().max(1e-3));
            for selection in Selections::all(&map) {
                for start in 0..starts {
                    let reach = [4.0, 4.0 * size, 0.3 * size][start % 3];
                    let mut x = random.vector(n, reach);
                    x.push(level);
                    if !newton(&map, &selection, &mut x) {
                        continue;
                    }
                    let (h, _) = residual(&map, &x);
                    if norm(&h) > 1e-12 {
                        continue;
                    }
                    let off =
                        |y: &Vec<f64>| norm(&y.iter().zip(&x).map(|(p, q)| p - q).collect::<Vec<f64>>());
                    match known.iter().position(|y| off(y) < 1e-6 * size.min(1.0)) {
                        Some(k) => found[k] = true,
                        None => panic!("{name}: {x:?} is not among {known:?}"),
                    }
                }
            }
            assert!(
                found.iter().all(|f| *f),
                "{name}: {known:?} at {level}: found {found:?}"
            );
        }
    });
}

/// Newton's method at fixed α on one selection, derivatives by differences.
fn newton(map: &Traced<Embedded>, selection: &Selection, x: &mut [f64]) -> bool {
    let n = map.num_residuals();
    let value = |x: &[f64]| {
        let mut h = vec![0.0; n];
        map.residual(selection, x, &mut h);
        h
    };
    for _ in 0..80 {
        let h = value(x);
        let mut jacobian = vec![vec![0.0; n]; n];
        for j in 0..n {
            let step = 1e-7 * x[j].abs().max(1e-6);
            let (mut p, mut q) = (x.to_vec(), x.to_vec());
            p[j] += step;
            q[j] -= step;
            for (row, (p, q)) in jacobian.iter_mut().zip(value(&p).iter().zip(value(&q))) {
                row[j] = (p - q) / (2.0 * step);
            }
        }
        let (d, det) = solve(&jacobian, &h);
        if det == 0.0 || d.iter().any(|d| !d.is_finite()) {
            return false;
        }
        for (x, d) in x.iter_mut().zip(&d) {
            *x -= d;
        }
        if norm(&d) <= 1e-12 * norm(x).max(1e-3) {
            return true;
        }
    }
    false
}
