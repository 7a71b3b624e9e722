//! Paths of problems whose compliance is brought into hierarchical form, against those of the full form, which has sparse factors.

use semismooth::contact::{CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::interface::InterfaceProblem;
use semismooth::piecewise::{Derivatives, Facet, PiecewiseSmooth, Selection, Structure};
use semismooth::sparse::{Matrix, Pattern};

use crate::random::Random;

/// Compliances of an order above this are compressed.
const LARGE: usize = 1000;
/// Updates after which factors are made anew, at the latest.
const UPDATES: usize = 160;

fn follow(map: &impl PiecewiseSmooth, start: &[f64]) -> Branch {
    let options = ContinuationOptions::default()
        .with_parameter_range((-1.0, 1.0))
        .with_max_points(20_000);
    Branch::follow(map, start, Direction::Increasing, options).unwrap()
}

/// The same transitions in the same order, at the same α, with the same signs of determinants; so are the last points, whose multipliers
/// are last in both.
fn agree(condensed: &Branch, full: &Branch) {
    assert_eq!(condensed.termination, full.termination);
    assert_eq!(condensed.transitions.len(), full.transitions.len());
    for (k, (a, b)) in condensed.transitions.iter().zip(&full.transitions).enumerate() {
        assert!(
            (a.parameter() - b.parameter()).abs() < 1e-9,
            "{k}: {} {}",
            a.parameter(),
            b.parameter()
        );
        assert_eq!(
            (&a.sites, a.kind, a.det_sign),
            (&b.sites, b.kind, b.det_sign),
            "{k}"
        );
    }
    let [a, b] = [condensed, full].map(|branch| branch.points.last().unwrap());
    let size = a.x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let pairs = a.x.iter().rev().zip(b.x.iter().rev());
    assert!(pairs.take(a.x.len()).all(|(a, b)| (a - b).abs() < 1e-9 * size));
}

/// Each quantity is free up to a bound, then held by a spring, and beyond another bound by a second one. Where the first spring pulls
/// more than the rest of the structure holds, the path turns back.
#[derive(Clone)]
struct Springs(Vec<[f64; 4]>);

impl PiecewiseSmooth for Springs {
    fn num_vars(&self) -> usize {
        2 * self.0.len() + 1
    }
    fn num_residuals(&self) -> usize {
        self.0.len()
    }
    fn num_sites(&self) -> usize {
        self.0.len()
    }
    fn num_pieces(&self, _site: usize) -> usize {
        3
    }
    fn num_tests(&self, _site: usize) -> usize {
        2
    }
    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        const FREE: [Facet; 1] = [Facet::negative(0)];
        const FIRST: [Facet; 2] = [Facet::positive(0), Facet::negative(1)];
        const SECOND: [Facet; 1] = [Facet::positive(1)];
        [&FREE[..], &FIRST, &SECOND][piece]
    }
    fn pattern(&self) -> Pattern {
        let q = self.0.len();
        let entries = (0..q).flat_map(|i| [(i, i), (i, q + i)]);
        Pattern::from_entries(q, 2 * q + 1, entries).unwrap()
    }
    fn test_functions(&self, z: &[f64], out: &mut [f64]) {
        for ((v, [from, to, ..]), out) in z.iter().zip(&self.0).zip(out.chunks_exact_mut(2)) {
            out.copy_from_slice(&[v - from, v - to]);
        }
    }
    fn residual(&self, selection: &Selection, z: &[f64], out: &mut [f64]) {
        let q = self.0.len();
        for (i, [from, to, first, second]) in self.0.iter().enumerate() {
            let at = [
                0.0,
                first * (z[i] - from),
                first * (to - from) + second * (z[i] - to),
            ];
            out[i] = z[q + i] - at[selection.piece(i)];
        }
    }
    fn jacobian(&self, selection: &Selection, z: &[f64], jac: &mut Matrix) {
        (0..self.0.len()).for_each(|i| _ = self.site_jacobian(i, selection, z, jac));
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Derivatives for Springs {
    fn test_derivatives(&self, _z: &[f64], d: &[f64], out: &mut [f64]) {
        d.iter()
            .zip(out.chunks_exact_mut(2))
            .for_each(|(d, out)| out.fill(*d));
    }
    fn test_gradient(&self, site: usize, _test: usize, _z: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        gradient[site] = 1.0;
    }
}

impl Structure for Springs {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(site);
    }
    fn site_jacobian(&self, i: usize, selection: &Selection, _z: &[f64], jac: &mut Matrix) -> bool {
        let [.., first, second] = self.0[i];
        jac.add(i, self.0.len() + i, 1.0);
        jac.add(i, i, -[0.0, first, second][selection.piece(i)]);
        true
    }
}

/// A chain under a growing load, with springs that engage one after the other, some of which pull: hundreds of transitions, among them
/// folds, where the active block is singular in between, and determinants of both signs.
#[test]
fn springs_engage_and_snap() {
    let q = LARGE + 2;
    let mut random = Random::new(3);
    let mut draw = move |from: f64, to: f64| from + (to - from) * 0.5 * (1.0 + random.symmetric());
    let chain = (0..q).flat_map(|i| {
        let next = (i + 1 < q).then_some(i + 1);
        let beside = next.map(|j| [(i, j, -1.0), (j, i, -1.0)]);
        beside.into_iter().flatten().chain([(i, i, 2.5)])
    });
    let a = Matrix::from_triplets(q, q, &chain.collect::<Vec<_>>()).unwrap();
    let rate: Vec<f64> = (0..q).map(|_| draw(0.5, 1.5)).collect();
    let load = LoadPath::affine(vec![0.0; q], rate);
    let springs = (0..q).map(|k| {
        let from = draw(0.05, 6.0);
        let first = if k % 20 == 7 {
            draw(-2.5, -1.8)
        } else {
            draw(-0.5, 1.0)
        };
        [from, from + draw(0.01, 0.1), first, draw(0.1, 2.0)]
    });
    let law = Springs(springs.collect());
    let full = InterfaceProblem::from_parts(a, &Matrix::identity(q), load, law).unwrap();
    let condensed = full.condensed().unwrap();
    let found = follow(&condensed, &vec![0.0; q + 1]);
    let expected = follow(&full, &vec![0.0; 2 * q + 1]);
    assert!(
        found.transitions.len() > 2 * UPDATES,
        "{}",
        found.transitions.len()
    );
    assert!(found.folds().len() > 10, "{}", found.folds().len());
    agree(&found, &expected);
    let signs: Vec<_> = found.transitions.iter().map(|t| t.det_sign).collect();
    assert!(signs.contains(&Some(1)) && signs.contains(&Some(-1)));
}

/// A block on the ground whose nodes have friction coefficients of their own, pressed, and pulled ever more.
#[test]
fn blocks_slip_node_by_node() {
    let nodes = LARGE / 2 + 10;
    let mut random = Random::new(11);
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [nodes, 4]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap())
        .fix("left")
        .assemble()
        .unwrap();
    let ground = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
    let rows = system.contact("bottom", &ground).unwrap();
    let press = system.traction("top", |_| [0.0, -0.01, 0.0]).unwrap();
    let pull = system.traction("right", |_| [0.01, 0.0, 0.0]).unwrap();
    let body = ContactBody::new(
        system.stiffness().clone(),
        rows.normal,
        rows.tangential,
        LoadPath::affine(press, pull),
    );
    let body = body.unwrap().with_gap(rows.gap).unwrap();
    let friction = (0..nodes).map(|_| 0.4 + 0.05 * random.symmetric()).collect();
    let law = PlanarCoulomb::new(FrictionCoefficient::nodal(friction).unwrap());
    let condensed = CondensedContact::new(body, law).unwrap();
    let start = condensed.solve(0.2, None).unwrap();
    let full = condensed.full().unwrap();
    // Steps from hierarchical factors lead where those from sparse ones do.
    let other = full.solve(0.2, None).unwrap();
    let size = start.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let pairs = start.iter().rev().zip(other.iter().rev());
    assert!(pairs.take(start.len()).all(|(a, b)| (a - b).abs() < 1e-9 * size));
    let found = follow(&condensed, &start);
    let expected = follow(&full, &condensed.expand(&start).unwrap());
    assert!(found.transitions.len() > UPDATES, "{found}");
    agree(&found, &expected);
}
