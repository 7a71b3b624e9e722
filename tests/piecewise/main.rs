//! Piecewise-smooth maps: the checker, selections, active sets, derivatives, orientation and traced functions.

#[path = "../maps/mod.rs"]
mod maps;

#[path = "../dense/mod.rs"]
mod dense;

#[cfg(feature = "autodiff")]
#[path = "../common/random.rs"]
mod random;

#[cfg(feature = "autodiff")]
mod affinity;
mod certificates;
mod elements;
mod exact;
#[cfg(feature = "autodiff")]
mod formulas;
mod implicit;
#[cfg(feature = "autodiff")]
mod nested;
mod newton_derivatives;
mod notions;
mod rubber;
#[cfg(feature = "autodiff")]
mod traced;

use proptest::prelude::*;
use semismooth::InputError;
use semismooth::piecewise::check::{CheckError, CheckOptions, Finding, FindingKind, check};
use semismooth::piecewise::{
    ActiveSet, Activity, CoherentOrientation, Derivatives, Description, Facet, MinMap, PiecewiseError,
    PiecewiseSmooth, PiecewiseSmoothExt, Selection, Selections, Structure, TestLayout, active_set,
    b_derivative, coherent_orientation, essential_activity, select, value,
};
use semismooth::sparse::Matrix;

use maps::{hand_on, same_cells};
use rubber::{Fault, R, Rubber, samples};

#[test]
fn the_checker_passes_correct_maps() {
    let report = check(&Rubber(Fault::None), &samples(), &CheckOptions::default()).unwrap();
    assert_eq!((report.points, report.outside), (12, 1));
    assert_eq!(report.selections, 12 * 9);
    assert!(report.boundaries > 10, "{report:?}");
    // Beyond the cap each piece of each site is examined once, with the other sites at their own pieces.
    let few = CheckOptions::default().with_max_selections(4);
    let report = check(&Rubber(Fault::None), &samples(), &few).unwrap();
    assert_eq!(report.selections, 12 * 5);
    let own = CheckOptions::default().with_beyond_cells(false);
    assert_eq!(
        check(&Rubber(Fault::None), &samples(), &own).unwrap().selections,
        12
    );
    let map = MinMap::new(3, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a.copy_from_slice(x);
        b[0] = x[0] * x[1] - 1.0;
        b[1] = x[2].exp() - x[0];
        b[2] = x[1].sin();
    });
    let points: Vec<Vec<f64>> = samples().iter().map(|x| x[..3].to_vec()).collect();
    let report = check(&map, &points, &CheckOptions::default()).unwrap();
    assert!(report.boundaries > 10 && report.points == 13);
}

fn findings(fault: Fault) -> Vec<Finding> {
    match check(&Rubber(fault), &samples(), &CheckOptions::default()) {
        Err(CheckError::Findings(found)) => found,
        other => panic!("{fault:?}: {other:?}"),
    }
}

#[test]
fn each_deliberate_error_is_found_and_named() {
    let cases = [
        (Fault::JacobianSign, FindingKind::Jacobian),
        (Fault::Jump, FindingKind::Discontinuity),
        (Fault::Overlap, FindingKind::Overlap),
        (Fault::Gap, FindingKind::Gap),
        (Fault::Pattern, FindingKind::StrayEntry),
        (Fault::Gradient, FindingKind::TestGradient),
        (Fault::Rates, FindingKind::TestDerivatives),
        (Fault::Rows, FindingKind::SiteRows),
        (Fault::Affine, FindingKind::Affine),
        (Fault::Nan, FindingKind::NotFinite),
        (Fault::Facet, FindingKind::Structure),
        (Fault::PatternShape, FindingKind::Structure),
        (Fault::SiteJacobian, FindingKind::SiteRows),
        (Fault::SiteExtra, FindingKind::SiteRows),
    ];
    for (fault, kind) in cases {
        let found = findings(fault);
        assert!(found.iter().any(|f| f.kind == kind), "{fault:?}: {found:?}");
    }
}

#[test]
fn findings_contain_their_location() {
    let found = findings(Fault::JacobianSign);
    assert!(found.iter().all(|f| f.kind == FindingKind::Jacobian), "{found:?}");
    assert!(found.iter().all(|f| f.entry == Some((3, 4))));
    let f = found.iter().find(|f| f.piece.is_some()).unwrap();
    assert_eq!(f.site, Some((1, "block 1".to_owned())));
    assert_eq!(f.piece, Some((0, "left".to_owned())));
    assert!((f.expected - 1.0).abs() < 1e-6 && f.found == -1.0);
    let text = CheckError::Findings(found).to_string();
    for word in ["wrong Jacobian", "block 1", "left", "(3, 4)"] {
        assert!(text.contains(word), "{text}");
    }
    // The wrong sign of the left piece alone, and an entry of a row that no site owns.
    let found = findings(Fault::SiteJacobian);
    assert!(
        found
            .iter()
            .all(|f| f.kind == FindingKind::SiteRows && f.expected == 1.0 && f.found == -1.0)
    );
    assert!(
        found.iter().all(|f| matches!(f.entry, Some((2 | 3, 4)))),
        "{found:?}"
    );
    let found = findings(Fault::SiteExtra);
    assert!(
        found
            .iter()
            .all(|f| f.entry == Some((0, 0)) && f.expected == 0.0 && f.found >= 2.0),
        "{found:?}"
    );
    assert!(found[0].to_string().contains("site_jacobian"), "{}", found[0]);
    let jump = &findings(Fault::Jump)[0];
    assert_eq!(jump.site.as_ref().map(|s| s.0), Some(1));
    assert!((jump.found - jump.expected - 0.1).abs() < 1e-9, "{jump}");
    let few = CheckOptions::default().with_max_findings(1);
    match check(&Rubber(Fault::Rows), &samples(), &few) {
        Err(CheckError::Findings(found)) => assert_eq!(found.len(), 1),
        other => panic!("{other:?}"),
    }
}

#[test]
fn misuse_of_the_checker_is_named() {
    let map = Rubber(Fault::None);
    let options = CheckOptions::default();
    assert_eq!(
        check(&map, &[], &options),
        Err(CheckError::NoSamples { outside: 0 })
    );
    let behind = [vec![0.0, 0.0, 0.0, 0.0, -1.0]];
    assert_eq!(
        check(&map, &behind, &options),
        Err(CheckError::NoSamples { outside: 1 })
    );
    assert!(matches!(
        check(&map, &[vec![0.0; 3]], &options),
        Err(CheckError::Sample {
            point: 0,
            source: InputError::Length {
                expected: 5,
                found: 3,
                ..
            }
        })
    ));
    let bad = options.with_tolerance(f64::NAN);
    assert!(matches!(
        check(&map, &samples(), &bad),
        Err(CheckError::Input(InputError::Option {
            name: "tolerance",
            ..
        }))
    ));
}

#[test]
fn selections_are_lazy_ordered_and_complete() {
    struct Many;
    impl PiecewiseSmooth for Many {
        fn num_vars(&self) -> usize {
            200
        }
        fn num_residuals(&self) -> usize {
            200
        }
        fn num_sites(&self) -> usize {
            200
        }
        fn num_pieces(&self, _: usize) -> usize {
            4
        }
        fn num_tests(&self, _: usize) -> usize {
            0
        }
        fn cell(&self, _: usize, _: usize) -> &[Facet] {
            &[]
        }
        fn test_functions(&self, _: &[f64], _: &mut [f64]) {}
        fn residual(&self, _: &Selection, _: &[f64], _: &mut [f64]) {}
        fn jacobian(&self, _: &Selection, _: &[f64], _: &mut Matrix) {}
    }
    let all = Selections::all(&Many);
    assert_eq!(all.total(), None);
    let first: Vec<Vec<usize>> = all.take(5).map(|s| s.pieces().skip(198).collect()).collect();
    assert_eq!(first, [[0, 0], [0, 1], [0, 2], [0, 3], [1, 0]]);
    assert_eq!(
        Selections::varying(&Many, &Selection::uniform(200, 1), 0..63).total(),
        Some(1 << 126)
    );
    let some: Vec<Selection> = Selections::all(&Rubber(Fault::None)).collect();
    assert_eq!(some.len(), 9);
    assert!(some.windows(2).all(|w| w[0] < w[1]));
    let none = Selections::new(Selection::uniform(2, 0), vec![(0, vec![1]), (1, vec![])]);
    assert_eq!((none.total(), none.count()), (Some(0), 0));
    assert_eq!(Selections::new(Selection::default(), vec![]).count(), 1);
}

#[test]
fn active_sets_are_products() {
    let map = Rubber(Fault::None);
    // z₁ = α: stick and right; z₂ = −α: left and stick.
    let x = [1.0, -1.0, -0.5, 0.5, 1.0];
    let active = active_set(&map, &x, 1e-12);
    assert_eq!(active.total(), Some(4));
    assert_eq!(active.degenerate_sites(), [(0, vec![1, 2]), (1, vec![0, 1])]);
    let listed: Vec<Selection> = active.selections().collect();
    for s in Selections::all(&map) {
        assert_eq!(active.contains(&s), listed.contains(&s));
    }
    assert!(!active.contains(&Selection::uniform(3, 1)));
    assert!(active.outside().is_empty());
    // All agree there, and with the value.
    let (mut h, mut other) = ([0.0; 4], [0.0; 4]);
    value(&map, &x, &mut h);
    for s in listed {
        map.residual(&s, &x, &mut other);
        assert!(h.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-15));
    }
    let outside = active_set(&map, &[0.0, 0.0, 0.0, 0.0, -1.0], 0.0);
    assert_eq!(outside.outside(), [0, 1]);
    // The apex z = α = 0: all pieces of both sites.
    assert_eq!(active_set(&map, &[0.0; 5], 0.0).total(), Some(9));
    let layout = TestLayout::new(&map);
    let mut theta = [0.0; 6];
    map.test_functions(&x, &mut theta);
    let one = ActiveSet::from_tests(&map, &layout, &theta, vec![0]);
    assert_eq!(one.degenerate_sites(), [(0, vec![1, 2])]);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn b_derivatives_are_one_sided_and_positively_homogeneous(
        u in prop::array::uniform2(-1.0..1.0_f64),
        on in prop::array::uniform2(0..3_usize),
        alpha in 0.5..2.0_f64,
        d in prop::array::uniform5(-1.0..1.0_f64),
        t in 0.1..10.0_f64,
    ) {
        let map = Rubber(Fault::None);
        // Each site on a kink or in the middle of sticking.
        let z = |k: usize| alpha * [-1.0, 0.0, 1.0][k];
        let x = [u[0], u[1], z(on[0]) - R * u[0], z(on[1]) - R * u[1], alpha];
        let mut derivative = [0.0; 4];
        let s = b_derivative(&map, &x, &d, 1e-9, &mut derivative).unwrap();
        prop_assert!(active_set(&map, &x, 1e-9).contains(&s));
        let h = 1e-6;
        let moved: Vec<f64> = x.iter().zip(&d).map(|(x, d)| x + h * d).collect();
        let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
        value(&map, &x, &mut a);
        value(&map, &moved, &mut b);
        for i in 0..4 {
            prop_assert!(((b[i] - a[i]) / h - derivative[i]).abs() < 2e-5, "{} {:?}", i, derivative);
        }
        let longer = d.map(|d| t * d);
        let mut scaled = [0.0; 4];
        b_derivative(&map, &x, &longer, 1e-9, &mut scaled).unwrap();
        for i in 0..4 {
            prop_assert!((scaled[i] - t * derivative[i]).abs() < 1e-12 * (1.0 + scaled[i].abs()));
        }
    }
}

fn lcp(m: [[f64; 2]; 2]) -> impl PiecewiseSmooth {
    MinMap::new(2, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a.copy_from_slice(x);
        for i in 0..2 {
            b[i] = m[i][0] * x[0] + m[i][1] * x[1];
        }
    })
}

#[test]
fn min_maps_of_p_matrices_are_coherently_oriented() {
    let at = |m, cap| coherent_orientation(&lcp(m), &[0.0, 0.0], 1e-12, cap).unwrap();
    let p = [[1.0, 3.0], [0.0, 1.0]];
    assert_eq!(at(p, 100), CoherentOrientation::Coherent { sign: 1 });
    // Principal minors 1, 1 and −3.
    match at([[1.0, 2.0], [2.0, 1.0]], 100) {
        CoherentOrientation::Incoherent { first, second } => {
            assert_eq!((first.1, second.1), (1, -1));
            assert_eq!(second.0, Selection::uniform(2, 1));
        }
        other => panic!("{other:?}"),
    }
    // A vanishing minor is no orientation.
    match at([[1.0, 1.0], [1.0, 1.0]], 100) {
        CoherentOrientation::Incoherent { second, .. } => assert_eq!(second.1, 0),
        other => panic!("{other:?}"),
    }
    assert_eq!(
        at(p, 3),
        CoherentOrientation::Undecided {
            examined: 3,
            total: Some(4)
        }
    );
    // Away from kinks one selection decides.
    let away = coherent_orientation(&lcp([[1.0, 2.0], [2.0, 1.0]]), &[-1.0, 1.0], 1e-12, 10).unwrap();
    assert!(matches!(away, CoherentOrientation::Coherent { .. }));
}

/// Cells in the plane: y > 0; y < 0 < x; y < 0 and x < 0; and 0 < y < −|x|, which meets the others in the origin alone.
struct Apex;

impl PiecewiseSmooth for Apex {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn num_sites(&self) -> usize {
        1
    }
    fn num_pieces(&self, _: usize) -> usize {
        4
    }
    fn num_tests(&self, _: usize) -> usize {
        4
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        const CELLS: [&[Facet]; 4] = [
            &[Facet::positive(0)],
            &[Facet::negative(0), Facet::positive(1)],
            &[Facet::negative(0), Facet::negative(1)],
            &[Facet::positive(0), Facet::positive(2), Facet::positive(3)],
        ];
        CELLS[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&[x[1], x[0], x[0] - x[1], -x[0] - x[1]]);
    }
    fn residual(&self, _: &Selection, _: &[f64], out: &mut [f64]) {
        out[0] = 0.0;
    }
    fn jacobian(&self, _: &Selection, _: &[f64], _: &mut Matrix) {}
}

#[test]
fn a_piece_without_interior_is_inessential() {
    let origin = [0.0, 0.0];
    let activity = |piece, x: &[f64]| {
        essential_activity(&Apex, x, &Selection::uniform(1, piece), 1e-12, 20_000).unwrap()
    };
    for piece in 0..3 {
        assert_eq!(activity(piece, &origin), Activity::Essential);
    }
    assert_eq!(activity(3, &origin), Activity::Inessential);
    assert_eq!(activity(0, &[1.0, -1.0]), Activity::Inactive);
    assert_eq!(activity(1, &[1.0, -1.0]), Activity::Essential);
    assert!(essential_activity(&Apex, &origin, &Selection::uniform(2, 0), 0.0, 20_000).is_err());
    assert_eq!(select(&Apex, &[1.0, -1.0]).piece(0), 1);
}

#[test]
fn opposite_facets_with_others_are_inessential() {
    /// y > 0, y < 0 by two tests, and x > 0: 0 lies on a face of the hull of the normals, not inside.
    struct Squeezed;
    impl PiecewiseSmooth for Squeezed {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn num_sites(&self) -> usize {
            1
        }
        fn num_pieces(&self, _: usize) -> usize {
            1
        }
        fn num_tests(&self, _: usize) -> usize {
            3
        }
        fn cell(&self, _: usize, _: usize) -> &[Facet] {
            const CELL: &[Facet] = &[Facet::positive(0), Facet::positive(1), Facet::positive(2)];
            CELL
        }
        fn test_functions(&self, x: &[f64], out: &mut [f64]) {
            out.copy_from_slice(&[x[0] + 0.3 * x[1], x[1], -x[1]]);
        }
        fn residual(&self, _: &Selection, _: &[f64], out: &mut [f64]) {
            out[0] = 0.0;
        }
        fn jacobian(&self, _: &Selection, _: &[f64], _: &mut Matrix) {}
    }
    let found = essential_activity(&Squeezed, &[0.0, 0.0], &Selection::uniform(1, 0), 0.0, 20_000);
    assert_eq!(found, Ok(Activity::Inessential));
}

/// 0 ≤ y ⟂ M y + q ≥ 0 at its degenerate solution y = 0, q = 0: all 2ⁿ selections are active, and the constant is the largest norm of
/// the inverses of the matrices whose rows are those of M or of the identity.
#[test]
fn lipschitz_constants_of_complementarity_problems() {
    use semismooth::complementarity::Lcp;
    use semismooth::piecewise::{LocalUniqueness, local_uniqueness};
    let at_zero = |m: [[f64; 2]; 2], cap: u64| {
        let lcp = Lcp::new(Matrix::from_rows(&m).unwrap(), vec![0.0; 2]).unwrap();
        let active = active_set(lcp.mcp(), &[0.0; 2], 1e-12);
        assert_eq!(active.total(), Some(4));
        local_uniqueness(lcp.mcp(), &[0.0; 2], &active, &Matrix::identity(2), cap).unwrap()
    };
    for [[a, b], [c, d]] in [
        [[2.0, 1.0], [-3.0, 1.0]],
        [[1.0, 0.0], [0.25, 4.0]],
        [[0.1, -0.2], [0.3, 5.0]],
    ] {
        let norm = |m: [[f64; 2]; 2]| {
            let [[a, b], [c, d]] = m;
            ((d.abs() + b.abs()).max(a.abs() + c.abs())) / (a * d - b * c).abs()
        };
        let (e1, e2) = ([1.0, 0.0], [0.0, 1.0]);
        let all = [[[a, b], [c, d]], [e1, [c, d]], [[a, b], e2], [e1, e2]].map(norm);
        let largest = all.iter().fold(0.0_f64, |m, v| m.max(*v));
        let found = at_zero([[a, b], [c, d]], 10);
        assert!(found.is_certified() && !found.fails());
        assert!(
            (found.constant().unwrap() - largest).abs() < 1e-12 * largest,
            "{found:?} {all:?}"
        );
        // A list that is cut short bounds the constant from below and decides nothing.
        let cut = at_zero([[a, b], [c, d]], 2);
        assert!(!cut.is_certified() && !cut.fails() && cut.constant().is_none());
        match cut {
            LocalUniqueness::Undecided {
                examined,
                total,
                at_least,
            } => {
                assert_eq!((examined, total), (2, Some(4)));
                assert!(all.iter().any(|v| (v - at_least).abs() < 1e-12 * largest));
            }
            other => panic!("{other:?}"),
        }
    }
    // A principal minor that is negative, and one that is zero: no P-matrix, no local uniqueness.
    for (m, signs) in [
        ([[1.0, 2.0], [2.0, 1.0]], [-1, 1]),
        ([[0.0, 1.0], [-1.0, 1.0]], [0, 0]),
    ] {
        let found = at_zero(m, 10);
        assert!(found.fails() && !found.is_certified() && found.constant().is_none());
        match found {
            LocalUniqueness::Fails { first, second } => {
                let mut found = [first.1, second.1];
                found.sort_unstable();
                if signs[1] == 0 {
                    assert_eq!(found[0], 0);
                } else {
                    assert_eq!(found, signs);
                }
            }
            other => panic!("{other:?}"),
        }
    }
}

/// All properties that a map declares at a point.
fn told<P: PiecewiseSmooth + ?Sized>(map: &P, x: &[f64]) -> (Vec<String>, Vec<f64>) {
    let (m, n) = (map.num_vars(), map.num_residuals());
    let layout = TestLayout::new(map);
    let s = select(map, x);
    let mut words = vec![format!(
        "{m} {n} {} {s:?} {}",
        map.num_sites(),
        map.is_piecewise_affine()
    )];
    let mut numbers = vec![0.0; n];
    map.residual(&s, x, &mut numbers);
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(&s, x, &mut jac);
    numbers.extend(jac.values());
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(x, &mut theta);
    numbers.extend(&theta);
    map.test_derivatives(x, &vec![0.5; m], &mut theta);
    numbers.extend(&theta);
    let mut sizes = vec![1.0; m];
    map.typical_sizes(&mut sizes);
    numbers.extend(&sizes);
    for site in 0..map.num_sites() {
        let mut rows = vec![99];
        map.site_rows(site, &mut rows);
        words.push(format!("{} {rows:?}", map.site_name(site)));
        for piece in 0..map.num_pieces(site) {
            words.push(format!(
                "{} {:?}",
                map.piece_name(site, piece),
                map.cell(site, piece)
            ));
        }
        for test in 0..map.num_tests(site) {
            let mut gradient = vec![0.0; m];
            map.test_gradient(site, test, x, &mut gradient);
            numbers.extend(gradient);
        }
        jac.clear();
        words.push(map.site_jacobian(site, &s, x, &mut jac).to_string());
        numbers.extend(jac.values());
    }
    (words, numbers)
}

/// References and boxes delegate to the map, including methods with defaults.
#[test]
fn maps_behind_pointers() {
    /// Overrides the methods for which `Rubber` uses defaults.
    struct Sized(Rubber);
    impl PiecewiseSmooth for Sized {
        same_cells!(0);
        hand_on! {
            0:
            fn test_functions(&self, x: &[f64], out: &mut [f64]);
            fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]);
            fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix);
            fn pattern(&self) -> semismooth::sparse::Pattern;
            fn structure(&self) -> Option<&dyn Structure>;
        }
        fn is_piecewise_affine(&self) -> bool {
            true
        }
        fn derivatives(&self) -> Option<&dyn Derivatives> {
            Some(self)
        }
        fn description(&self) -> Option<&dyn Description> {
            Some(self)
        }
    }

    impl Derivatives for Sized {
        fn test_derivatives(&self, _: &[f64], d: &[f64], out: &mut [f64]) {
            out.fill(d[0] + 17.0);
        }
        fn test_gradient(&self, site: usize, test: usize, _: &[f64], gradient: &mut [f64]) {
            gradient.fill((10 * site + test) as f64);
        }
    }

    impl Description for Sized {
        fn piece_name(&self, site: usize, piece: usize) -> std::borrow::Cow<'_, str> {
            Description::piece_name(&self.0, site, piece)
        }
        fn site_name(&self, site: usize) -> std::borrow::Cow<'_, str> {
            Description::site_name(&self.0, site)
        }
        fn typical_sizes(&self, sizes: &mut [f64]) {
            sizes.copy_from_slice(&[1e-3, 2e-3, 1e4, 2e4, 5.0]);
        }
    }
    for x in samples() {
        let own = told(&Sized(Rubber(Fault::None)), &x);
        let boxed: Box<dyn PiecewiseSmooth> = Box::new(Sized(Rubber(Fault::None)));
        assert_eq!(told(&boxed, &x), own);
        assert_eq!(told(&&boxed, &x), own);
        assert_eq!(told(&&Sized(Rubber(Fault::None)), &x), own);
    }
}

/// A map that implements the three further traits and overrides nothing says the same as one that does not implement them.
#[test]
fn what_maps_do_not_say_has_one_default() {
    struct Silent(Rubber);
    struct Saying(Rubber);
    macro_rules! same_map {
        () => {
            same_cells!(0);
            hand_on! {
                0:
                fn test_functions(&self, x: &[f64], out: &mut [f64]);
                fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]);
                fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix);
            }
        };
    }
    impl PiecewiseSmooth for Silent {
        same_map!();
    }
    impl PiecewiseSmooth for Saying {
        same_map!();
        fn derivatives(&self) -> Option<&dyn Derivatives> {
            Some(self)
        }
        fn structure(&self) -> Option<&dyn Structure> {
            Some(self)
        }
        fn description(&self) -> Option<&dyn Description> {
            Some(self)
        }
    }
    impl Derivatives for Saying {}
    impl Structure for Saying {}
    impl Description for Saying {}
    let (silent, saying) = (Silent(Rubber(Fault::None)), Saying(Rubber(Fault::None)));
    for x in samples() {
        let (words, numbers) = told(&silent, &x);
        assert_eq!(told(&saying, &x), (words.clone(), numbers));
        assert!(words.iter().any(|w| w == "site 0 [0, 1, 2, 3]"), "{words:?}");
        assert!(words.iter().any(|w| w.starts_with("piece 1 ")), "{words:?}");
        let (s, d) = (select(&silent, &x), vec![0.25; x.len()]);
        let total = TestLayout::new(&silent).total();
        for d in [None, Some(d.as_slice())] {
            let [mut a, mut b, mut c] = [vec![0.0; total], vec![1.0; total], vec![2.0; total]];
            silent.tests_of_selection(&s, &x, d, &mut a);
            PiecewiseSmoothExt::tests_of_selection(&saying, &s, &x, d, &mut b);
            match d {
                Some(d) => silent.test_derivatives(&x, d, &mut c),
                None => silent.test_functions(&x, &mut c),
            }
            assert_eq!((&a, &a), (&b, &c));
        }
    }
    assert!(!silent.has_nested_kinks() && silent.exact().is_none() && silent.expansions().is_none());
}

#[test]
fn a_wrong_pattern_is_an_error() {
    let map = Rubber(Fault::PatternShape);
    let found = b_derivative(&map, &[0.1; 5], &[1.0; 5], 0.0, &mut [0.0; 4]);
    assert!(matches!(
        found,
        Err(PiecewiseError::Input(InputError::Length { .. }))
    ));
    let found = b_derivative(
        &Rubber(Fault::Pattern),
        &[0.1, 9.0, 0.1, 9.0, 0.1],
        &[1.0; 5],
        0.0,
        &mut [0.0; 4],
    );
    assert_eq!(found, Err(PiecewiseError::StrayEntry { row: 3, col: 4 }));
}
