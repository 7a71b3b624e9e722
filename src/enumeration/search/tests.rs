use super::super::system;
use super::*;
use crate::piecewise::MinMap;

/// All leaves of a search with the given limits, its nodes, and whether it was stopped.
fn search(kept: usize, limit: usize) -> (Vec<Vec<usize>>, u64, bool) {
    // xᵢ = 0 or 1 for each i: min(x, 1 − x) = 0, coupled weakly.
    let map = MinMap::new(6, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        for i in 0..6 {
            a[i] = x[i];
            b[i] = 1.0 - x[i] + 0.1 * x[(i + 1) % 6];
        }
    });
    let choices = system::all_choices(&map);
    let system = system::at_parameter(&map, &choices, &[0.0; 6], Deadline::after(None))
        .unwrap()
        .unwrap();
    let mut search = SelectionSearch::new(&system, None, 1000, Deadline::after(None));
    (search.kept, search.limit) = (kept, limit);
    let mut leaves = Vec::new();
    let root = search.root(&[]).unwrap();
    let all = search.run(root, &mut |pieces: &[usize]| {
        leaves.push(pieces.to_vec());
        Ok::<_, ()>(None)
    });
    assert_eq!(all, Ok(()));
    assert!(
        search.stopped || search.stored == 0,
        "{} numbers are left",
        search.stored
    );
    (leaves, search.nodes, search.stopped)
}

#[test]
fn tables_made_anew_give_the_same_leaves() {
    let kept = search(usize::MAX, usize::MAX);
    assert_eq!((kept.0.len(), kept.2), (64, false));
    assert_eq!(search(0, usize::MAX), kept);
    assert_eq!(search(400, usize::MAX), kept);
}

#[test]
fn memory_stops_the_search() {
    let (leaves, _, stopped) = search(usize::MAX, 300);
    assert!(stopped && leaves.len() < 64, "{} leaves", leaves.len());
}
