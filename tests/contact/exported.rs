//! Matrices that other programs have written: condensed substructures, rounded files.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{Branch, Continuation, ContinuationOptions, Direction};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh};
use semismooth::sparse::Matrix;

fn whole() -> (ElasticSystem, ContactRows, [Vec<f64>; 2]) {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [8, 4]).unwrap();
    let body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).fix("left");
    let system = body.assemble().unwrap();
    let mut f0 = system
        .traction("top", |x| [0.0, -0.01 - 0.004 * x[0], 0.0])
        .unwrap();
    let weight = system.body_force(|x| [0.002 * x[1], -0.003, 0.0]).unwrap();
    f0.iter_mut().zip(weight).for_each(|(f, w)| *f += w);
    let f1 = system.traction("right", |x| [0.01 * x[1], 0.002, 0.0]).unwrap();
    let ground = Foundation::gap(|x| 4e-3 * x[0] * x[0]);
    let rows = system.contact("bottom", &ground).unwrap();
    (system, rows, [f0, f1])
}

fn columns(matrix: &Matrix, kept: &[usize]) -> Matrix {
    let place = |j: usize| kept.iter().position(|k| *k == j).unwrap();
    let entries: Vec<_> = matrix.triplets().map(|(i, j, v)| (i, place(j), v)).collect();
    Matrix::from_triplets(matrix.nrows(), kept.len(), &entries).unwrap()
}

/// Statically condensed onto the displacements of the contact nodes (R. J. Guyan, AIAA J. 3 (1965)): the interior ones are eliminated, in
/// the stiffness and in both loads.
fn superelement(system: &ElasticSystem, loads: &[Vec<f64>; 2], kept: &[usize]) -> (Matrix, [Vec<f64>; 2]) {
    let n = system.num_free();
    let mut a = vec![vec![0.0; n + 2]; n];
    for (i, j, v) in system.stiffness().triplets() {
        a[i][j] = v;
    }
    for i in 0..n {
        (a[i][n], a[i][n + 1]) = (loads[0][i], loads[1][i]);
    }
    for k in (0..n).filter(|k| !kept.contains(k)) {
        let pivot = a[k].clone();
        for row in a.iter_mut().enumerate().filter(|r| r.0 != k) {
            let factor = row.1[k] / pivot[k];
            row.1.iter_mut().zip(&pivot).for_each(|(v, p)| *v -= factor * p);
        }
    }
    let entries: Vec<Vec<f64>> = kept
        .iter()
        .map(|&i| kept.iter().map(|&j| a[i][j]).collect())
        .collect();
    let rows: Vec<&[f64]> = entries.iter().map(Vec::as_slice).collect();
    let forces = [n, n + 1].map(|column| kept.iter().map(|&i| a[i][column]).collect());
    (Matrix::from_rows(&rows).unwrap(), forces)
}

fn law() -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::constant(0.3).unwrap())
}

fn close(a: &[f64], b: &[f64], tolerance: f64) {
    let size = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= tolerance * size, "{a} {b}");
    }
}

/// The superelement is exact in statics: contact forces, displacements of the nodes and all changes of state are those of the whole mesh.
#[test]
fn a_superelement_equals_the_whole_mesh() {
    let (system, rows, loads) = whole();
    let touched = rows.normal.triplets().chain(rows.tangential[0].triplets());
    let kept: Vec<usize> = touched
        .map(|t| t.1)
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect();
    let (small, forces) = superelement(&system, &loads, &kept);
    let path = |[f0, f1]: [Vec<f64>; 2]| LoadPath::affine(f0, f1);
    let body = ContactBody::new(
        system.stiffness().clone(),
        rows.normal.clone(),
        rows.tangential.clone(),
        path(loads.clone()),
    );
    // Entries of the condensed matrix are symmetric up to rounding of 64-bit numbers: nothing is to be told.
    let (element, note) = ContactBody::exported(
        small,
        columns(&rows.normal, &kept),
        vec![columns(&rows.tangential[0], &kept)],
        path(forces),
    )
    .unwrap();
    assert_eq!(note, None);
    let problem = |body: ContactBody| {
        let body = body.with_gap(rows.gap.clone()).unwrap();
        CondensedContact::new(body, law()).unwrap()
    };
    let (all, few) = (problem(body.unwrap()), problem(element));
    let mut states = BTreeSet::new();
    for alpha in [0.0, 0.4, 1.0] {
        let [x, y] = [&all, &few].map(|p| p.solve(alpha, None).unwrap());
        close(&y, &x, 1e-12);
        let (u, v) = (all.displacements(&x).unwrap(), few.displacements(&y).unwrap());
        let u: Vec<f64> = kept.iter().map(|&k| u[k]).collect();
        close(&v, &u, 1e-12);
        let found = few.solution(&y).unwrap().states;
        assert_eq!(all.solution(&x).unwrap().states, found);
        states.extend(found.iter().map(|s| s.name()));
    }
    assert!(states.len() > 1, "{states:?}");
    let curve = |p: &CondensedContact<PlanarCoulomb>| {
        let start = p.solve(0.0, None).unwrap();
        let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
        let curve = Continuation::new(p, &start, Direction::Increasing, options).unwrap();
        let branch = Branch::collect(curve, |_| ControlFlow::Continue(())).unwrap();
        branch
            .transitions
            .iter()
            .map(|t| t.parameter())
            .collect::<Vec<f64>>()
    };
    let (whole, element) = (curve(&all), curve(&few));
    assert!(!whole.is_empty(), "{states:?}");
    close(&element, &whole, 1e-10);
}

/// A matrix printed with eight digits is unsymmetric by 1e-8: that is told, and its symmetric part is taken, in both forms. One that is
/// meant to be unsymmetric stays, and is for the full form.
#[test]
fn rounding_of_files_is_told() {
    let (system, rows, loads) = whole();
    let exported = |asymmetry: f64| {
        let a = system.stiffness();
        let factor = |i: usize, j: usize| if i < j { 1.0 + asymmetry } else { 1.0 };
        let entries: Vec<_> = a.triplets().map(|(i, j, v)| (i, j, v * factor(i, j))).collect();
        let a = Matrix::from_triplets(a.nrows(), a.ncols(), &entries).unwrap();
        let path = LoadPath::affine(loads[0].clone(), loads[1].clone());
        ContactBody::exported(a, rows.normal.clone(), rows.tangential.clone(), path).unwrap()
    };
    let (exact, none) = exported(0.0);
    assert_eq!(none, None);
    let (written, note) = exported(1e-8);
    let note = note.unwrap();
    assert!(
        note.contains("differ by") && note.contains("symmetric part"),
        "{note}"
    );
    let solution = |body: ContactBody| {
        CondensedContact::new(body, law())
            .unwrap()
            .solve(0.5, None)
            .unwrap()
    };
    close(&solution(written.clone()), &solution(exact), 1e-6);
    let full = FullContact::new(written.clone(), law())
        .unwrap()
        .solve(0.5, None)
        .unwrap();
    let n = written.num_displacements();
    close(&full[n..], &solution(written), 1e-9);
    let (meant, note) = exported(1e-3);
    assert_eq!(note, None);
    assert!(
        meant
            .stiffness()
            .triplets()
            .any(|(i, j, v)| v != meant.stiffness().get(j, i))
    );
    assert!(
        FullContact::new(meant.clone(), law())
            .unwrap()
            .solve(0.5, None)
            .is_ok()
    );
    let refused = CondensedContact::new(meant, law()).unwrap_err();
    assert!(
        refused.to_string().contains("not symmetric") || refused.to_string().contains("must be symmetric"),
        "{refused}"
    );
    assert!(!matches!(refused, ContactError::Empty { .. }));
}
