//! Arms at points with more degenerate sites than a complete search can handle: found locally, never called complete.

use semismooth::contact::{
    CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb, read_folder,
};
use semismooth::continuation::{ContinuationOptions, Diagram, DiagramOptions, arms_at};
use semismooth::enumeration::{Completeness, DirectionalArms, EnumerationOptions, all_arms};
use semismooth::piecewise::{PiecewiseSmooth, b_derivative};
use semismooth::sparse::Matrix;

/// p nodes of the model of Hild and Renard (λ = μ = 1, F = 4) without coupling, under α times the load (1.5, −4) at the first ones
/// and (2, 1) at the others: at α = 0 nothing is loaded and all nodes graze.
fn unloaded(p: usize, multiple: usize) -> CondensedContact<PlanarCoulomb> {
    let n = 2 * p;
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 2.0)).collect();
    for i in 0..p {
        entries.extend([(2 * i, 2 * i + 1, -1.0), (2 * i + 1, 2 * i, -1.0)]);
    }
    let pick = |first: usize| {
        let entries: Vec<_> = (0..p).map(|i| (i, 2 * i + first, 1.0)).collect();
        Matrix::from_triplets(p, n, &entries).unwrap()
    };
    let load = (0..p).flat_map(|i| if i < multiple { [1.5, -4.0] } else { [2.0, 1.0] });
    let load = LoadPath::affine(vec![0.0; n], load.collect::<Vec<_>>());
    let friction = FrictionCoefficient::nodal(vec![4.0; p]).unwrap();
    let stiffness = Matrix::from_triplets(n, n, &entries).unwrap();
    FullContact::planar(stiffness, pick(0), pick(1), load, friction)
        .unwrap()
        .condensed()
        .unwrap()
}

/// H'(x; τ) = 0, by the B-derivative.
fn check(map: &CondensedContact<PlanarCoulomb>, x: &[f64], found: &DirectionalArms) {
    let mut image = vec![0.0; map.num_residuals()];
    for (k, arm) in found.arms.iter().enumerate() {
        b_derivative(map, x, &arm.tangent, 1e-10, &mut image).unwrap();
        assert!(image.iter().all(|v| v.abs() < 1e-9), "{image:?}");
        let other = found.arms[..k].iter().all(|a| {
            let apart = a.tangent.iter().zip(&arm.tangent).map(|(a, b)| (a - b).abs());
            apart.fold(0.0, f64::max) > 1e-6
        });
        assert!(other);
    }
}

fn by_sign(found: &DirectionalArms) -> (usize, usize) {
    let growing = found.arms.iter().filter(|a| a.rate() > 0.0).count();
    (growing, found.arms.len() - growing)
}

#[test]
fn many_degenerate_sites() {
    for p in [6, 20, 40] {
        let map = unloaded(p, 2);
        let x = vec![0.0; map.num_vars()];
        let capped = EnumerationOptions::default().with_max_nodes(3);
        let found = all_arms(&map, &x, &capped).unwrap();
        assert!(
            matches!(found.completeness, Completeness::Incomplete { .. }),
            "{:?}",
            found.completeness
        );
        check(&map, &x, &found);
        // Three directions at each of two nodes where α grows; a single one, opening, where it falls.
        assert_eq!(by_sign(&found), (9, 1), "p = {p}");
        assert_eq!(found.orientation, Some((1, 1)));
        // The same by the continuation, which reports that the list may be incomplete.
        let list = arms_at(&map, &x, &ContinuationOptions::default().with_max_nodes(3)).unwrap();
        let (arms, complete) = (list.arms, !list.certainty.is_undecided());
        assert_eq!((arms.len(), complete), (10, false));
    }
    let map = unloaded(6, 2);
    let complete = all_arms(&map, &[0.0; 13], &EnumerationOptions::default()).unwrap();
    assert_eq!(
        (by_sign(&complete), complete.completeness),
        ((9, 1), Completeness::Complete)
    );
}

#[test]
fn no_local_starts_no_arms() {
    let map = unloaded(6, 2);
    let none = EnumerationOptions::default()
        .with_max_nodes(1)
        .with_local_starts(0);
    let found = all_arms(&map, &[0.0; 13], &none).unwrap();
    assert!(found.arms.is_empty() && !found.completeness.is_complete());
    let none = ContinuationOptions::default()
        .with_max_nodes(1)
        .with_local_starts(0);
    let list = arms_at(&map, &[0.0; 13], &none).unwrap();
    let (arms, complete) = (list.arms, !list.certainty.is_undecided());
    assert_eq!((arms.len(), complete), (0, false));
}

/// Three directions at each of some nodes, independent of each other: a single start finds more than one arm, by varying one node at a
/// time.
#[test]
fn neighbours_of_an_arm_are_tried() {
    for multiple in [1, 2, 3] {
        let map = unloaded(8, multiple);
        let options = EnumerationOptions::default()
            .with_max_nodes(3)
            .with_local_starts(1);
        let found = all_arms(&map, &vec![0.0; map.num_vars()], &options).unwrap();
        check(&map, &vec![0.0; map.num_vars()], &found);
        assert!(by_sign(&found).0 > 1, "{multiple}");
    }
}

#[test]
fn a_diagram_reports_that_arms_may_be_missing() {
    let map = unloaded(20, 1);
    let mut options = DiagramOptions::default().with_parameter_range((-1.0, 1.0));
    options.continuation.max_nodes = 3;
    let diagram = Diagram::explore(&map, &[vec![0.0; 41]], &options).unwrap();
    assert!(diagram.completeness().is_limited());
    assert_eq!(diagram.edges().len(), 4, "{diagram}");
    assert_eq!(diagram.solutions_at(&map, 0.5).unwrap().index_sum(), Some(1));
}

#[cfg(feature = "json")]
#[test]
fn the_symmetric_block() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/block_symmetric");
    let map = read_folder(folder).unwrap().condensed().unwrap();
    let mut x = vec![0.0; map.num_vars()];
    x[map.num_vars() - 1] = 0.5;
    let capped = EnumerationOptions::default().with_max_nodes(5);
    let found = all_arms(&map, &x, &capped).unwrap();
    assert!(!found.completeness.is_complete());
    check(&map, &x, &found);
    assert_eq!(by_sign(&found), (3, 3));
    assert_eq!(found.orientation, Some((1, 1)));
    let list = arms_at(&map, &x, &ContinuationOptions::default().with_max_nodes(5)).unwrap();
    let (arms, complete) = (list.arms, !list.certainty.is_undecided());
    assert_eq!((arms.len(), complete), (6, false));
}
