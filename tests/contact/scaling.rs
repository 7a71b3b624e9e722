//! Units, numbering and the augmentation parameter change nothing: the same transitions, the same states.

use semismooth::contact::{
    CondensedContact, ContactBody, ContactSolution, ContactState, FrictionCoefficient, FrictionCurve,
    Frictionless, FullContact, GivenBound, LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::continuation::{
    Branch, ContinuationError, ContinuationOptions, Diagram, DiagramOptions, Direction, Termination,
};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::newton::Newton;
use semismooth::piecewise::{PiecewiseSmooth, select};
use semismooth::sparse::Matrix;

/// Matrices, loads at α = 0 and 1, gaps and r in given units, displacements and contact nodes renumbered.
#[derive(Clone)]
struct Parts {
    a: Matrix,
    traces: Vec<Matrix>,
    loads: [Vec<f64>; 2],
    gap: Vec<f64>,
    r: f64,
}

/// A permutation of 0..n.
fn shuffled(n: usize) -> Vec<usize> {
    // A stride coprime to n.
    let coprime = |k: &usize| (1..=*k).all(|d| d == 1 || !n.is_multiple_of(d) || !k.is_multiple_of(d));
    let step = (2..).find(coprime).unwrap();
    (0..n).map(|i| (step * i + 1) % n).collect()
}

impl Parts {
    /// A block on the ground, fixed on top; horizontal tractions on its sides turn from one direction to the other while it is pressed
    /// down.
    fn block(dim: usize) -> Self {
        let mesh = if dim == 2 {
            Mesh::rectangle([0.0, 0.0], [40.0, 80.0], [10, 20]).unwrap()
        } else {
            Mesh::block([0.0; 3], [40.0, 40.0, 80.0], [3, 3, 4]).unwrap()
        };
        let system = Elasticity::new(mesh, Material::lame(4000.0, 120.0).unwrap())
            .fix("top")
            .assemble()
            .unwrap();
        let mut up = [0.0; 3];
        up[dim - 1] = 1.0;
        let rows = system
            .contact("bottom", &Foundation::plane([0.0; 3], up))
            .unwrap();
        let sides = |push: f64| -> Vec<f64> {
            let side = |name: &str, down: f64| {
                system
                    .traction(name, |_| {
                        let mut t = [push, 0.3 * push, 0.0];
                        t[dim - 1] = down;
                        t
                    })
                    .unwrap()
            };
            let (left, right) = (side("left", -1.0), side("right", -1.3));
            left.iter().zip(&right).map(|(a, b)| a + b).collect()
        };
        let mut traces = vec![rows.normal];
        traces.extend(rows.tangential);
        Self {
            a: system.stiffness().clone(),
            traces,
            loads: [sides(-2.0), sides(2.0)],
            gap: rows.gap,
            r: 10.0,
        }
    }

    fn units(&self, force: f64, length: f64) -> Self {
        let scaled = |v: &[f64], s: f64| v.iter().map(|x| s * x).collect::<Vec<f64>>();
        let mut a = self.a.clone();
        a.values_mut().iter_mut().for_each(|v| *v *= force / length);
        Self {
            a,
            traces: self.traces.clone(),
            loads: self.loads.each_ref().map(|f| scaled(f, force)),
            gap: scaled(&self.gap, length),
            r: self.r * force / length,
        }
    }

    /// The new numbers of the contact nodes.
    fn places(&self) -> Vec<usize> {
        shuffled(self.gap.len())
    }

    fn renumbered(&self) -> Self {
        let (dofs, nodes) = (shuffled(self.a.nrows()), self.places());
        let (dof, node) = (|i: usize| dofs[i], |i: usize| nodes[i]);
        let moved = |m: &Matrix, rows: &dyn Fn(usize) -> usize| {
            let entries: Vec<_> = m.triplets().map(|(i, j, v)| (rows(i), dof(j), v)).collect();
            Matrix::from_triplets(m.nrows(), m.ncols(), &entries).unwrap()
        };
        let permuted = |v: &[f64], to: &dyn Fn(usize) -> usize| {
            let mut w = vec![0.0; v.len()];
            v.iter().enumerate().for_each(|(i, x)| w[to(i)] = *x);
            w
        };
        Self {
            a: moved(&self.a, &dof),
            traces: self.traces.iter().map(|t| moved(t, &node)).collect(),
            loads: self.loads.each_ref().map(|f| permuted(f, &dof)),
            gap: permuted(&self.gap, &node),
            r: self.r,
        }
    }

    fn load(&self) -> LoadPath {
        LoadPath::between(self.loads[0].clone(), &self.loads[1])
    }

    fn body(&self) -> ContactBody {
        let traces = self.traces[1..].to_vec();
        ContactBody::new(self.a.clone(), self.traces[0].clone(), traces, self.load())
            .unwrap()
            .with_gap(self.gap.clone())
            .unwrap()
    }

    fn planar(&self, friction: f64) -> FullContact<PlanarCoulomb> {
        let path = FrictionCoefficient::nodal(vec![friction; self.gap.len()]).unwrap();
        FullContact::planar(
            self.a.clone(),
            self.traces[0].clone(),
            self.traces[1].clone(),
            self.load(),
            path,
        )
        .unwrap()
        .with_gap(self.gap.clone())
        .unwrap()
        .with_r(self.r)
        .unwrap()
    }
}

/// Parameters of the transitions, and how many nodes of each piece there are after each.
fn transitions<M: PiecewiseSmooth>(map: &M, alpha: f64) -> Found {
    let mut x = vec![0.0; map.num_vars()];
    *x.last_mut().unwrap() = alpha;
    Newton::default().solve(map, &mut x).unwrap();
    follow(map, &x)
}

type Found = Result<Vec<(f64, Vec<usize>)>, ContinuationError>;

fn follow<M: PiecewiseSmooth>(map: &M, x: &[f64]) -> Found {
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(map, x, Direction::Increasing, options)?;
    assert_eq!(branch.termination, Termination::ParameterRange);
    let count = |t: &semismooth::continuation::Transition| {
        let mut changes: Vec<usize> = t.sites.iter().flat_map(|s| [s.from, s.to]).collect();
        changes.sort_unstable();
        changes
    };
    Ok(branch
        .transitions
        .iter()
        .map(|t| (t.parameter(), count(t)))
        .collect())
}

fn same(a: &Found, b: &Found, tolerance: f64, what: &str) {
    let a = a.as_ref().unwrap();
    let b = b.as_ref().unwrap_or_else(|e| panic!("{what}: {e}"));
    assert_eq!(a.len(), b.len(), "{what}");
    for (s, t) in a.iter().zip(b) {
        assert!((s.0 - t.0).abs() <= tolerance, "{what}: {} {}", s.0, t.0);
        assert_eq!(s.1, t.1, "{what}");
    }
}

/// Units of force and length that differ by 1e±9 (GPa and m, N and mm), both alone and together; stiffness scales by up to 1e±18.
const UNITS: [(f64, f64); 8] = [
    (1e9, 1.0),
    (1e-9, 1.0),
    (1.0, 1e9),
    (1.0, 1e-9),
    (1e9, 1e3),
    (1e-9, 1e-3),
    (1e-9, 1e9),
    (1e9, 1e-9),
];
const LEVELS: [f64; 4] = [0.0, 0.35, 0.7, 1.0];
const AUGMENTATIONS: [f64; 4] = [1e-3, 1e-1, 1e1, 1e3];

#[test]
fn plane_branches() {
    let parts = Parts::block(2);
    let first = transitions(&parts.planar(0.5).condensed().unwrap(), 0.0);
    assert!(first.as_ref().is_ok_and(|f| f.len() > 8), "{first:?}");
    let renumbered = parts.renumbered();
    same(
        &first,
        &transitions(&renumbered.planar(0.5).condensed().unwrap(), 0.0),
        1e-10,
        "renumbered",
    );
    for factor in AUGMENTATIONS {
        let other = parts.planar(0.5).with_r(10.0 * factor).unwrap();
        same(
            &first,
            &transitions(&other.condensed().unwrap(), 0.0),
            1e-10,
            &format!("r = {factor}"),
        );
    }
    for (force, length) in UNITS {
        let other = renumbered.units(force, length).planar(0.5);
        let what = format!("force {force}, length {length}");
        same(
            &first,
            &transitions(&other.condensed().unwrap(), 0.0),
            1e-10,
            &what,
        );
        same(&first, &transitions(&other, 0.0), 1e-10, &format!("full, {what}"));
    }
}

/// What a law needs to know of a scaled problem: units of force and length, and the new number of each node.
struct Terms {
    force: f64,
    length: f64,
    place: Vec<usize>,
}

/// A law, condensed and full, with its own r and with others, renumbered and in other units.
fn bodies<L: NodeLaw + Clone>(dim: usize, law: &dyn Fn(&Terms) -> L) {
    let parts = Parts::block(dim);
    let p = parts.gap.len();
    let terms = |force, length, place| Terms { force, length, place };
    let same_place: Vec<usize> = (0..p).collect();
    let own = law(&terms(1.0, 1.0, same_place.clone()));
    let condensed = |p: &Parts, law: &L| CondensedContact::new(p.body(), law.clone()).unwrap();
    let base = condensed(&parts, &own);
    let branch = |p: &CondensedContact<L>| follow(p, &p.solve(0.0, None).unwrap());
    // In space slipping nodes have smooth pieces; branches there are compared point by point.
    let first = (dim == 2 && own.is_affine()).then(|| branch(&base));
    let states = |p: &CondensedContact<L>, alpha: f64| p.solution(&p.solve(alpha, None).unwrap()).unwrap();
    let count = |s: &[ContactState]| ContactState::ALL.map(|k| s.iter().filter(|t| **t == k).count());
    let ends = LEVELS.map(|alpha| states(&base, alpha));
    let compare = |solution: &ContactSolution, end: &ContactSolution, force: f64, what: &str| {
        assert_eq!(count(&solution.states), count(&end.states), "{what}");
        let (a, b) = (solution.resultant(), end.resultant());
        let size = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        assert!(
            (0..3).all(|d| (a[d] / force - b[d]).abs() <= 1e-10 * size),
            "{what}: {a:?} {b:?}"
        );
    };
    let renumbered = parts.renumbered();
    let moved = law(&terms(1.0, 1.0, parts.places()));
    let mut others = vec![("renumbered".to_string(), condensed(&renumbered, &moved), 1.0)];
    let full = |parts: &Parts, law: &L| FullContact::new(parts.body(), law.clone()).unwrap();
    let mut fulls = vec![("full, renumbered".to_string(), full(&renumbered, &moved), 1.0)];
    for factor in AUGMENTATIONS {
        let other = condensed(&parts, &own);
        let r = other.r();
        let what = format!("r times {factor}");
        others.push((what.clone(), other.with_r(factor * r).unwrap(), 1.0));
        let other = full(&parts, &own);
        let r = other.r();
        fulls.push((format!("full, {what}"), other.with_r(factor * r).unwrap(), 1.0));
    }
    for (force, length) in UNITS {
        let what = format!("force {force}, length {length}");
        let (parts, law) = (
            parts.units(force, length),
            law(&terms(force, length, same_place.clone())),
        );
        others.push((what.clone(), condensed(&parts, &law), force));
        fulls.push((format!("full, {what}"), full(&parts, &law), force));
    }
    for (what, problem, force) in &others {
        for (alpha, end) in LEVELS.into_iter().zip(&ends) {
            compare(&states(problem, alpha), end, *force, what);
        }
        if let Some(first) = first.as_ref().filter(|_| *force == 1.0) {
            same(first, &branch(problem), 1e-10, what);
        }
    }
    for (what, problem, force) in &fulls {
        let x = problem.solve(LEVELS[1], None).unwrap();
        compare(&problem.solution(&x).unwrap(), &ends[1], *force, what);
    }
}

fn constant(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap())
}

/// A coefficient that falls from `first` to `last` over slips of about the size of the block, so that solutions stay unique.
fn weakening(terms: &Terms, first: f64, last: f64) -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::exponential(first, last, 20.0 * terms.length).unwrap())
}

fn given(terms: &Terms, tangents: usize) -> GivenBound {
    let p = terms.place.len();
    let mut bounds = vec![0.0; p];
    for (i, &to) in terms.place.iter().enumerate() {
        bounds[to] = 30.0 * terms.force * (1.0 + (i as f64).sin());
    }
    GivenBound::new(tangents, bounds, vec![[0.3, 0.2]; p]).unwrap()
}

#[test]
fn plane_bodies() {
    bodies(2, &|_| PlanarCoulomb::new(constant(0.5)));
}

#[test]
fn plane_bodies_under_other_laws() {
    bodies(2, &|_| Frictionless::plane());
    bodies(2, &|terms| given(terms, 1));
    bodies(2, &|terms| PlanarCoulomb::new(weakening(terms, 0.5, 0.3)));
}

#[test]
fn solid_bodies() {
    bodies(3, &|_| OrthotropicCoulomb::new(constant(0.3), constant(0.2)));
    bodies(3, &|_| OrthotropicCoulomb::isotropic(constant(0.3)));
}

#[test]
fn solid_bodies_under_other_laws() {
    bodies(3, &|_| Frictionless::space());
    bodies(3, &|terms| given(terms, 2));
    bodies(3, &|terms| {
        OrthotropicCoulomb::isotropic(weakening(terms, 0.3, 0.2))
    });
    bodies(3, &|terms| {
        OrthotropicCoulomb::new(weakening(terms, 0.3, 0.2), weakening(terms, 0.2, 0.25))
    });
}

/// The parameter in units 1e±9: a load that grows to 1e9 times its initial value within α = 1, or hardly at all. The same transitions at
/// the same loads, condensed and full, with steps that do not depend on the unit where pieces are affine.
#[test]
fn the_parameter_in_other_units() {
    let parts = Parts::block(2);
    let friction = |terms: &Terms| PlanarCoulomb::new(weakening(terms, 0.5, 0.3));
    let terms = Terms {
        force: 1.0,
        length: 1.0,
        place: Vec::new(),
    };
    let [start, end] = parts.loads.clone();
    let found = |unit: f64| {
        let slope: Vec<f64> = end.iter().zip(&start).map(|(b, a)| (b - a) / unit).collect();
        let load = LoadPath::affine(start.clone(), slope);
        let planar = parts.planar(0.5).with_load(load.clone()).unwrap();
        let body = ContactBody::new(
            parts.a.clone(),
            parts.traces[0].clone(),
            parts.traces[1..].to_vec(),
            load,
        );
        let body = body.unwrap().with_gap(parts.gap.clone()).unwrap();
        let curved = CondensedContact::new(body, friction(&terms)).unwrap();
        let at_zero = |m: usize| vec![0.0; m];
        let list = |map: &dyn PiecewiseSmooth, x: Vec<f64>, step: f64| {
            let options = ContinuationOptions::default()
                .with_parameter_range((0.0, unit))
                .with_min_step(1e-8 * step.min(1.0))
                .with_step(0.05 * step)
                .with_max_step(step);
            let branch = Branch::follow(map, &x, Direction::Increasing, options).unwrap();
            assert_eq!(branch.termination, Termination::ParameterRange, "{unit}");
            let transitions = branch.transitions.iter();
            let list: Vec<(f64, Vec<usize>)> = transitions
                .map(|t| (t.parameter() / unit, t.sites.iter().map(|s| s.site).collect()))
                .collect();
            Ok(list)
        };
        let condensed = planar.condensed().unwrap();
        let solved = |map: &dyn PiecewiseSmooth| {
            let mut x = at_zero(map.num_vars());
            Newton::default().solve(map, &mut x).unwrap();
            x
        };
        [
            list(&condensed, solved(&condensed), 1.0),
            list(&planar, solved(&planar), 1.0),
            list(&curved, curved.solve(0.0, None).unwrap(), unit),
        ]
    };
    let first = found(1.0);
    for unit in [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9] {
        for (kind, (a, b)) in ["condensed", "full", "curved"]
            .iter()
            .zip(first.iter().zip(&found(unit)))
        {
            assert!(a.as_ref().is_ok_and(|a: &Vec<_>| a.len() > 8));
            same(a, b, 1e-9, &format!("{kind}, α in units of {unit}"));
        }
    }
}

/// A stiff node with a tiny slip: the facet of sticking is within the distance at which facets count as met, but the curve on its other
/// side is far away.
#[test]
fn a_start_next_to_a_stiff_facet() {
    for stiffness in [1e6, 2e8] {
        let a = Matrix::from_rows(&[[1.0, 0.0], [0.0, stiffness]]).unwrap();
        let row = |j: usize| Matrix::from_triplets(1, 2, &[(0, j, 1.0)]).unwrap();
        // Pressed by 1 − α, pushed by 1/2: slips under F (1 − α) < 1/2 until it opens at α = 1.
        let load = LoadPath::between(vec![1.0, 0.5], &[0.0, 0.5]);
        let path = FrictionCoefficient::nodal(vec![0.25]).unwrap();
        let problem = FullContact::planar(a, row(0), row(1), load, path).unwrap();
        let map = problem.condensed().unwrap();
        let mut x = [1.0, 0.25, 0.0];
        Newton::default().solve(&map, &mut x).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-9 && (x[1] - 0.25).abs() < 1e-9, "{x:?}");
        let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
        let branch = Branch::follow(&map, &x, Direction::Increasing, options).unwrap();
        assert_eq!(branch.termination, Termination::ParameterRange);
        let found: Vec<f64> = branch.transitions.iter().map(|t| t.parameter()).collect();
        assert_eq!(found.len(), 1, "{stiffness} {found:?}");
        assert!((found[0] - 1.0).abs() < 1e-9, "{stiffness} {found:?}");
    }
}

/// A start 1e-9 from a facet, with directions of different stiffness. Found by fuzzing: the curve on the other side of the facet, which is
/// far away, must not be followed.
#[test]
fn a_start_near_the_facet_of_a_far_curve() {
    let a = Matrix::from_rows(&[
        [1000001.0, 0.0, 0.0, -8000.0, 5125.0, 0.0],
        [0.0, 16.50390625, 0.0, 0.0, -7.13671875, -31.5],
        [0.0, 0.0, 114.87890625, 0.0, 36.5, -18.5390625],
        [-8000.0, 0.0, 0.0, 1000065.0, -41.0, 500.0],
        [5125.0, -7.13671875, 36.5, -41.0, 51.3671875, 14.5],
        [0.0, -31.5, -18.5390625, 500.0, 14.5, 72.140625],
    ])
    .unwrap();
    let pick = |first: usize| {
        let entries: Vec<_> = (0..3).map(|i| (i, 2 * i + first, 1.0)).collect();
        Matrix::from_triplets(3, 6, &entries).unwrap()
    };
    let load = LoadPath::between(
        vec![0.0, 0.0, 0.0, 0.0, -1000.0, 0.0],
        &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0625],
    );
    let friction = FrictionCoefficient::nodal(vec![0.03125, 0.3125, 0.0]).unwrap();
    let problem = FullContact::planar(a, pick(0), pick(1), load, friction).unwrap();
    let own = problem.r();
    let map = problem.with_r(1.0).unwrap().condensed().unwrap();
    let set = all_solutions(&map, 0.0, &EnumerationOptions::default()).unwrap();
    assert_eq!((set.solutions.len(), set.completeness.is_complete()), (1, true));
    let options = ContinuationOptions::default().with_parameter_range((-2.0, 2.0));
    let branch = Branch::follow(&map, &set.solutions[0].x, Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    assert_eq!(branch.transitions.len(), 3);
    let mut r = vec![0.0; 6];
    for (_, x) in branch.polyline() {
        map.residual(&select(&map, x), x, &mut r);
        // Displacements are w − C λ; their terms count with the map's own r, 10⁴ times the stiffness of the softest node.
        let (free, compliance) = (map.free_motion(x[6]).unwrap(), map.compliance());
        let terms = |i: usize| {
            let forces = (0..6).map(|j| (compliance.get(i, j) * x[j]).abs());
            free[i].abs() + forces.sum::<f64>()
        };
        let largest = (0..6).map(terms).fold(0.0, f64::max);
        let size = x[..6].iter().fold(own * largest, |m, v| m.max(v.abs()));
        assert!(r.iter().all(|r| r.abs() <= 1e-12 * size), "{x:?}: {r:?}");
    }
}

/// Page 5 of the guide in other units of force and length, with r not given: the same transitions of the same nodes, and on a coarse mesh
/// the same numbers of solutions and of edges of the diagram.
#[test]
fn planar_problems_choose_their_own_r() {
    let problem = |cells: [usize; 2], force: f64, length: f64| {
        let stress = force / (length * length);
        let mesh = Mesh::rectangle([0.0, 0.0], [2.0 * length, length], cells).unwrap();
        let material = Material::isotropic(stress, 0.3).unwrap();
        let system = Elasticity::new(mesh, material).fix("left").assemble().unwrap();
        let press = system.traction("top", |_| [0.0, -0.02 * stress, 0.0]).unwrap();
        let push = system.traction("right", |_| [0.05 * stress, 0.0, 0.0]).unwrap();
        let end: Vec<f64> = press.iter().zip(&push).map(|(a, b)| a + b).collect();
        let plane = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
        let contact = system.contact("bottom", &plane).unwrap();
        let friction = FrictionCoefficient::nodal(vec![0.5; contact.nodes.len()]).unwrap();
        let load = LoadPath::between(press, &end);
        let a = system.stiffness().clone();
        FullContact::planar(a, contact.normal, contact.tangential[0].clone(), load, friction).unwrap()
    };
    let transitions = |force: f64, length: f64| {
        let map = problem([8, 4], force, length).condensed().unwrap();
        let start = map.solve(0.0, None).unwrap();
        let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
        let branch = Branch::follow(&map, &start, Direction::Increasing, options).unwrap();
        assert_eq!(branch.termination, Termination::ParameterRange);
        let seen = branch.transitions.iter();
        seen.map(|t| (t.parameter(), t.sites[0].site, t.sites[0].to))
            .collect::<Vec<_>>()
    };
    let counts = |force: f64, length: f64| {
        let map = problem([3, 2], force, length).condensed().unwrap();
        let list = all_solutions(&map, 0.5, &EnumerationOptions::default()).unwrap();
        assert!(list.completeness.is_complete());
        let start = list.solutions[0].x.clone();
        let options = DiagramOptions::default().with_parameter_range((0.0, 1.0));
        let diagram = Diagram::explore(&map, &[start], &options).unwrap();
        assert!(!diagram.completeness().is_limited());
        (
            list.solutions.len(),
            diagram.edges().len(),
            diagram.vertices().len(),
        )
    };
    let (path, numbers) = (transitions(1.0, 1.0), counts(1.0, 1.0));
    assert_eq!(path.len(), 9);
    for (force, length) in [(2.1e11, 1.0), (1e-9, 1.0), (1e9, 1e-3), (1e3, 1e3), (1e6, 1e6)] {
        let other = transitions(force, length);
        assert_eq!(other.len(), path.len(), "{force:e} {length:e}");
        for (a, b) in path.iter().zip(&other) {
            assert!(
                (a.0 - b.0).abs() < 1e-9 && (a.1, a.2) == (b.1, b.2),
                "{a:?} {b:?}"
            );
        }
        assert_eq!(counts(force, length), numbers, "{force:e} {length:e}");
    }
}
