//! Certificates of local uniqueness, condition by condition.

use semismooth::complementarity::Lcp;
use semismooth::piecewise::{
    CoherentOrientation, Facet, LocalUniqueness, PiecewiseSmooth, Selection, active_set, bd_regularity,
    coherent_orientation, local_uniqueness, value,
};
use semismooth::sparse::Matrix;

use super::maps::two_pieces;

/// The plane in eight sectors of 45°. The unit vectors at their boundaries go to those of `images`, and the map is linear between them.
pub(crate) struct Sectors {
    pub(crate) images: [[f64; 2]; 8],
}

const CELLS: [[Facet; 2]; 8] = [
    [Facet::positive(0), Facet::positive(1)],
    [Facet::negative(1), Facet::positive(2)],
    [Facet::negative(2), Facet::positive(3)],
    [Facet::negative(3), Facet::positive(0)],
    [Facet::negative(0), Facet::negative(1)],
    [Facet::positive(1), Facet::negative(2)],
    [Facet::positive(2), Facet::negative(3)],
    [Facet::positive(3), Facet::negative(0)],
];

impl Sectors {
    /// Every angle times `turns`.
    pub(crate) fn winding(turns: f64) -> Self {
        let images = std::array::from_fn(|k| {
            let (sin, cos) = (turns * k as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
            [cos, sin]
        });
        Self { images }
    }

    fn matrix(&self, k: usize) -> [[f64; 2]; 2] {
        let boundary = |k: usize| (k as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
        let ((b, a), (d, c)) = (boundary(k), boundary(k + 1));
        let det = a * d - b * c;
        let (p, q) = (self.images[k], self.images[(k + 1) % 8]);
        std::array::from_fn(|i| [(p[i] * d - q[i] * b) / det, (q[i] * a - p[i] * c) / det])
    }
}

impl PiecewiseSmooth for Sectors {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn num_sites(&self) -> usize {
        1
    }
    fn num_pieces(&self, _: usize) -> usize {
        8
    }
    fn num_tests(&self, _: usize) -> usize {
        4
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        &CELLS[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&[x[1], x[0] - x[1], x[0], x[0] + x[1]]);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let m = self.matrix(s.piece(0));
        (0..2).for_each(|i| out[i] = m[i][0] * x[0] + m[i][1] * x[1]);
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        let m = self.matrix(s.piece(0));
        (0..4).for_each(|k| jac.add(k / 2, k % 2, m[k / 2][k % 2]));
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

/// The plane in five sectors, the k-th from 72° k on, each of them mapped to one of 144°: it winds twice with the least number of pieces.
struct Fifths;

impl Fifths {
    fn matrix(k: usize) -> [[f64; 2]; 2] {
        let at = |turns: f64, k: usize| (turns * k as f64 * std::f64::consts::TAU / 5.0).sin_cos();
        let ((b, a), (d, c)) = (at(1.0, k), at(1.0, k + 1));
        let ((p1, p0), (q1, q0)) = (at(2.0, k), at(2.0, k + 1));
        let det = a * d - b * c;
        [[p0, q0], [p1, q1]].map(|[p, q]| [(p * d - q * b) / det, (q * a - p * c) / det])
    }
}

impl PiecewiseSmooth for Fifths {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn num_sites(&self) -> usize {
        1
    }
    fn num_pieces(&self, _: usize) -> usize {
        5
    }
    fn num_tests(&self, _: usize) -> usize {
        5
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        const CELLS: [[Facet; 2]; 5] = [
            [Facet::positive(0), Facet::negative(1)],
            [Facet::positive(1), Facet::negative(2)],
            [Facet::positive(2), Facet::negative(3)],
            [Facet::positive(3), Facet::negative(4)],
            [Facet::positive(4), Facet::negative(0)],
        ];
        &CELLS[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (k, out) in out.iter_mut().enumerate() {
            let (sin, cos) = (k as f64 * std::f64::consts::TAU / 5.0).sin_cos();
            *out = cos * x[1] - sin * x[0];
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let m = Self::matrix(s.piece(0));
        (0..2).for_each(|i| out[i] = m[i][0] * x[0] + m[i][1] * x[1]);
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        let m = Self::matrix(s.piece(0));
        (0..4).for_each(|k| jac.add(k / 2, k % 2, m[k / 2][k % 2]));
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

fn at_zero(map: &impl PiecewiseSmooth, cap: u64) -> LocalUniqueness {
    let n = map.num_residuals();
    let x = vec![0.0; map.num_vars()];
    local_uniqueness(map, &x, &active_set(map, &x, 1e-9), &Matrix::identity(n), cap).unwrap()
}

/// H(x) = H(−x): coherently oriented, and no homeomorphism.
#[test]
fn maps_that_wind_twice_are_not_certified() {
    let map = Sectors::winding(2.0);
    assert_eq!(
        coherent_orientation(&map, &[0.0; 2], 1e-9, 100).unwrap(),
        CoherentOrientation::Coherent { sign: 1 }
    );
    let found = at_zero(&map, 100);
    let LocalUniqueness::Winds { first, second } = &found else {
        panic!("{found:?}");
    };
    assert!(found.fails() && !found.is_certified() && found.constant().is_none());
    // The witness: two directions, each in the cell of its selection, with one image.
    let mut images = [[0.0; 2]; 2];
    for ((s, d), image) in [first, second].into_iter().zip(&mut images) {
        assert_eq!(*s, semismooth::piecewise::select(&map, d));
        value(&map, d, image);
    }
    assert_ne!(first.0, second.0);
    assert!((0..2).all(|k| (images[0][k] - images[1][k]).abs() < 1e-12));
    // With as few pieces as possible.
    let found = at_zero(&Fifths, 100);
    assert!(matches!(found, LocalUniqueness::Winds { .. }), "{found:?}");
    // Winding three times, and twice backwards.
    assert!(matches!(
        at_zero(&Sectors::winding(3.0), 100),
        LocalUniqueness::Winds { .. }
    ));
    assert!(matches!(
        at_zero(&Sectors::winding(-2.0), 100),
        LocalUniqueness::Winds { .. }
    ));
    // A list cut short decides nothing.
    assert!(matches!(
        at_zero(&map, 7),
        LocalUniqueness::Undecided { examined: 7, .. }
    ));
}

/// As many cells, but winding once: sectors with unequal images, and mirrored.
#[test]
fn maps_that_wind_once_are_certified() {
    let plain = at_zero(&Sectors::winding(1.0), 100);
    assert!((plain.constant().unwrap() - 1.0).abs() < 1e-12, "{plain:?}");
    let stretched = Sectors {
        images: [
            [2.0, 0.0],
            [1.0, 0.3],
            [0.5, 2.0],
            [-1.0, 1.0],
            [-3.0, 0.5],
            [-1.0, -1.0],
            [0.0, -0.2],
            [1.0, -0.5],
        ],
    };
    let found = at_zero(&stretched, 100);
    assert!(
        matches!(
            found,
            LocalUniqueness::Lipschitz {
                sign: Some(1),
                selections: 8,
                ..
            }
        ),
        "{found:?}"
    );
    let mirrored = at_zero(&Sectors::winding(-1.0), 100);
    assert!(matches!(
        mirrored,
        LocalUniqueness::Lipschitz { sign: Some(-1), .. }
    ));
    // Folded back.
    let mut folded = Sectors::winding(1.0);
    folded.images[1] = [1.0, -0.3];
    assert!(matches!(at_zero(&folded, 100), LocalUniqueness::Fails { .. }));
}

/// 0 ≤ y ⟂ M y ≥ 0 at 0: a homeomorphism exactly if M is a P-matrix (Samelson, Thrall, Wesler 1958), 2ⁿ cells.
#[test]
fn complementarity_is_certified_for_p_matrices() {
    let certificate = |rows: &[[f64; 3]]| {
        let lcp = Lcp::new(Matrix::from_rows(rows).unwrap(), vec![0.0; 3]).unwrap();
        at_zero(lcp.mcp(), 100)
    };
    // Cyclic, far from symmetric.
    let p = certificate(&[[1.0, 0.0, 5.0], [5.0, 1.0, 0.0], [0.0, 5.0, 1.0]]);
    assert!(
        matches!(
            p,
            LocalUniqueness::Lipschitz {
                sign: Some(_),
                selections: 8,
                ..
            }
        ),
        "{p:?}"
    );
    let other = certificate(&[[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert!(other.fails(), "{other:?}");
    // min(x, x): all eight selections hold everywhere.
    let identity = certificate(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert!(identity.is_certified(), "{identity:?}");
}

/// 2 y + 2 y₊ − 2 (y + y³)₊: between the kinks, where no point lies, the derivative would be 0.
struct Flat;

impl PiecewiseSmooth for Flat {
    two_pieces!(self, [negative, positive], 1, 1, 2);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&[x[0], x[0] + x[0].powi(3)]);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let [a, b] = [0, 1].map(|site| 2.0 * s.piece(site) as f64);
        out[0] = (2.0 + a - b) * x[0] - b * x[0].powi(3);
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let [a, b] = [0, 1].map(|site| 2.0 * s.piece(site) as f64);
        jac.add(0, 0, 2.0 + a - b - 3.0 * b * x[0] * x[0]);
    }
}

/// First derivatives cannot tell whether the singular selection has points: the map, whose derivative is near 2, is not called singular.
#[test]
fn selections_that_may_have_no_points_are_no_singular_elements() {
    let found = bd_regularity(&Flat, &[0.0], 1e-9, 10).unwrap();
    assert!(!found.fails(), "{found:?}");
}

#[cfg(feature = "autodiff")]
mod traced {
    use super::*;
    use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind, certify};
    use semismooth::piecewise::{CertificateDoubt, Kinks, NonsmoothFunction, Real, Traced, cd_regularity};

    /// 2 y + 4 y₊ − 4 y₊ = α: two sites with one test function.
    struct Cancelling;
    impl NonsmoothFunction for Cancelling {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn eval<T: Real>(&self, x: &[T], k: &mut Kinks<'_, T>, out: &mut [T]) {
            let (a, b) = (k.positive_part(x[0]), k.positive_part(x[0]));
            out[0] = x[0] * 2.0 + a * 4.0 - b * 4.0 - x[1];
        }
    }

    #[test]
    fn kinks_that_cancel_have_no_effect() {
        let map = Traced::new(Cancelling);
        let active = active_set(&map, &[0.0; 2], 1e-9);
        assert_eq!(active.total(), Some(4));
        assert_eq!(
            coherent_orientation(&map, &[0.0; 2], 1e-9, 10).unwrap(),
            CoherentOrientation::Coherent { sign: 1 }
        );
        let found = at_zero(&map, 10);
        let LocalUniqueness::Lipschitz {
            sign: Some(1),
            constant,
            selections: 2,
        } = found
        else {
            panic!("{found:?}");
        };
        assert!((constant - 0.5).abs() < 1e-12);
        let options = ContinuationOptions::default().with_parameter_range((-3.0, 3.0));
        let load = Matrix::identity(1);
        assert!(certify(&map, &[0.0; 2], &load, &options).unwrap().is_certified());
        let branch = Branch::follow(&map, &[-1.0, -2.0], Direction::Increasing, options.clone()).unwrap();
        for t in branch
            .transitions
            .iter()
            .filter(|t| t.kind == TransitionKind::PassThrough)
        {
            assert!(t.certify(&map, &load, &options).unwrap().is_certified());
        }
    }

    /// The same except that the second kink lies at y + y³ = 0: no point lies between the kinks, which first derivatives cannot detect.
    struct Tangent;
    impl NonsmoothFunction for Tangent {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn eval<T: Real>(&self, x: &[T], k: &mut Kinks<'_, T>, out: &mut [T]) {
            let y = x[0];
            let (a, b) = (k.positive_part(y), k.positive_part(y + y * y * y));
            out[0] = y * 2.0 + a * 4.0 - b * 4.0 - x[1];
        }
    }

    /// (y₁, y₂ − 2 mid(0, y₂, y₁²)) = (0, α): its B-derivative at 0 is the identity, and yet in the cusp 0 < y₂ < y₁² the determinant is −1.
    /// Kinks at y₂ = 0 that cancel may stand beside it.
    struct Cusp {
        cancelling: bool,
    }
    impl NonsmoothFunction for Cusp {
        fn num_vars(&self) -> usize {
            3
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn eval<T: Real>(&self, x: &[T], k: &mut Kinks<'_, T>, out: &mut [T]) {
            out[0] = x[0];
            out[1] = x[1] - k.project(T::from(0.0), x[1], x[0] * x[0]) * 2.0 - x[2];
            if self.cancelling {
                let (a, b) = (k.positive_part(x[1]), k.positive_part(x[1]));
                out[1] = out[1] + a - b;
            }
        }
    }

    /// Near 0 there are three points with one image: an invertible B-derivative alone certifies nothing.
    #[test]
    fn cusps_beside_an_invertible_b_derivative_are_no_certificate() {
        let map = Traced::new(Cusp { cancelling: false });
        let residual = |y: [f64; 2]| {
            let x = [y[0], y[1], 0.0];
            let mut out = [0.0; 2];
            map.residual(&semismooth::piecewise::select(&map, &x), &x, &mut out);
            out
        };
        // Below the cusp, in it and above it.
        let e = 0.125;
        let values = [-e * e / 2.0, e * e / 2.0, 1.5 * e * e].map(|y| residual([e, y]));
        assert_eq!(values, [[e, -e * e / 2.0]; 3]);
        for cancelling in [false, true] {
            let map = Traced::new(Cusp { cancelling });
            let found = at_zero(&map, 100);
            assert!(!found.is_certified(), "{found:?}");
            // Between the derivatives above the cusp and in it lies a singular one.
            let hull = cd_regularity(&map, &[0.0; 3], 1e-9, 100).unwrap();
            assert!(!hull.is_regular(), "{hull:?}");
        }
    }

    #[test]
    fn what_first_derivatives_cannot_decide_is_a_doubt() {
        let map = Traced::new(Tangent);
        let found = at_zero(&map, 10);
        assert!(
            matches!(
                found,
                LocalUniqueness::Doubtful {
                    doubt: CertificateDoubt::Activity,
                    ..
                }
            ),
            "{found:?}"
        );
        assert!(!found.is_certified() && !found.fails());
        let orientation = coherent_orientation(&map, &[0.0; 2], 1e-9, 10).unwrap();
        assert!(matches!(orientation, CoherentOrientation::Doubtful { .. }));
    }
}
