//! Random bodies of one or two nodes in degenerate states, in all forms, against the enumeration of all pieces.

use semismooth::contact::{
    CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb, ReducedBody, ReducedContact,
    ReducedOptions,
};
use semismooth::sensitivity::{Differentiability, Directional};
use semismooth::sparse::{Matrix, NodalMatrix};

use super::degenerate::solved;
use super::random::Random;

#[derive(Clone, Copy, PartialEq, Debug)]
enum State {
    Open,
    /// Just touching.
    Grazing,
    Stick,
    /// Sticking with the largest force there may be.
    Limit,
    Slip,
}

/// Rows of a node in (v, λ): what is zero, and what must not be negative.
type Piece = (Vec<[f64; 4]>, Vec<[f64; 4]>);

impl State {
    const ALL: [Self; 5] = [Self::Open, Self::Grazing, Self::Stick, Self::Limit, Self::Slip];

    /// Penetration (below the gap), slip, pressure and traction.
    fn values(self, f: f64) -> [f64; 4] {
        match self {
            Self::Open => [-1.0, 0.5, 0.0, 0.0],
            Self::Grazing => [0.0; 4],
            Self::Stick => [0.0, 0.0, 2.0, f],
            Self::Limit => [0.0, 0.0, 1.0, f],
            Self::Slip => [0.0, 0.5, 1.0, f],
        }
    }

    /// What each active piece asks of the rates.
    fn pieces(self, f: f64) -> Vec<Piece> {
        let [normal, along, pressure, traction] =
            std::array::from_fn(|k| std::array::from_fn(|j| f64::from(u8::from(j == k))));
        let minus = |row: [f64; 4]| row.map(|v| -v);
        let bound = |sign: f64| [0.0, 0.0, f, -sign];
        let open = (vec![pressure, traction], vec![minus(normal)]);
        let stick = (vec![normal, along], vec![pressure, bound(1.0), bound(-1.0)]);
        let ahead = (vec![normal, bound(1.0)], vec![pressure, along]);
        let behind = (vec![normal, bound(-1.0)], vec![pressure, minus(along)]);
        match self {
            Self::Open => vec![(open.0, vec![])],
            Self::Grazing => vec![open, stick, ahead, behind],
            Self::Stick => vec![(stick.0, vec![])],
            Self::Limit => vec![(stick.0, vec![bound(1.0)]), (ahead.0, vec![along])],
            Self::Slip => vec![(ahead.0, vec![])],
        }
    }
}

struct Body {
    a: Vec<Vec<f64>>,
    states: Vec<State>,
    f: f64,
}

impl Body {
    fn new(random: &mut Random) -> Self {
        let p = 1 + random.below(2);
        let n = 2 * p;
        let b: Vec<Vec<f64>> = (0..n)
            .map(|_| (0..n).map(|_| random.below(5) as f64 - 2.0).collect())
            .collect();
        let entry = |i: usize, j: usize| super::dot(&b[i], &b[j]) + f64::from(u8::from(i == j));
        Self {
            a: (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect(),
            states: (0..p).map(|_| State::ALL[random.below(5)]).collect(),
            f: [0.25, 0.5, 1.0, 2.0][random.below(4)],
        }
    }

    /// All (v, λ) along a change of the load; nothing where a choice of pieces is singular.
    fn branches(&self, delta: &[f64]) -> Option<Vec<Vec<f64>>> {
        let n = delta.len();
        let choices: Vec<Vec<Piece>> = self.states.iter().map(|s| s.pieces(self.f)).collect();
        let mut list: Vec<Vec<f64>> = Vec::new();
        let total = choices.iter().map(Vec::len).product();
        for mut code in 0..total {
            let (mut rows, mut right) = (Vec::new(), delta.to_vec());
            for (i, a) in self.a.iter().enumerate() {
                let unit = (0..n).map(|j| f64::from(u8::from(i == j)));
                rows.push(a.iter().copied().chain(unit).collect::<Vec<f64>>());
            }
            let mut asked = Vec::new();
            for (i, pieces) in choices.iter().enumerate() {
                let (zero, kept) = &pieces[code % pieces.len()];
                code /= pieces.len();
                let spread = |row: &[f64; 4]| {
                    let mut all = vec![0.0; 2 * n];
                    for (k, v) in [2 * i, 2 * i + 1, n + 2 * i, n + 2 * i + 1].into_iter().zip(row) {
                        all[k] = *v;
                    }
                    all
                };
                rows.extend(zero.iter().map(spread));
                asked.extend(kept.iter().map(spread));
            }
            right.resize(2 * n, 0.0);
            let v = solved(rows, right)?;
            let holds = asked.iter().all(|row| super::dot(row, &v) >= -1e-9);
            if holds && !list.iter().any(|known| are_same(known, &v)) {
                list.push(v);
            }
        }
        Some(list)
    }

    /// Displacements and forces of both forms: node by node, and all normal ones first.
    fn solution(&self) -> [Vec<f64>; 2] {
        let all: Vec<[f64; 4]> = self.states.iter().map(|s| s.values(self.f)).collect();
        let u = all.iter().flat_map(|v| [v[0], v[1]]).collect();
        let forces = [2, 3].into_iter().flat_map(|k| all.iter().map(move |v| v[k]));
        [u, forces.collect()]
    }

    fn load(&self) -> Vec<f64> {
        let [u, forces] = self.solution();
        let p = self.states.len();
        let force = |i: usize| forces[i % 2 * p + i / 2];
        (0..u.len())
            .map(|i| super::dot(&self.a[i], &u) + force(i))
            .collect()
    }

    fn law(&self) -> PlanarCoulomb {
        PlanarCoulomb::new(FrictionCoefficient::constant(self.f).unwrap())
    }

    fn traces(&self) -> [Matrix; 2] {
        let p = self.states.len();
        [0, 1].map(|d| {
            let entries: Vec<_> = (0..p).map(|i| (i, 2 * i + d, 1.0)).collect();
            Matrix::from_triplets(p, 2 * p, &entries).unwrap()
        })
    }

    fn condensed(&self) -> CondensedContact<PlanarCoulomb> {
        let [normal, tangential] = self.traces();
        let a = Matrix::from_rows(&self.a).unwrap();
        let body = ContactBody::new(a, normal, vec![tangential], LoadPath::constant(self.load())).unwrap();
        CondensedContact::new(body, self.law()).unwrap()
    }

    fn reduced(&self) -> ReducedContact<PlanarCoulomb> {
        let [normal, tangential] = self.traces();
        let p = self.states.len();
        let places = (0..p).map(|i| [i as f64, 0.0, 0.0]).collect();
        let dofs: Vec<[usize; 2]> = (0..2 * p).map(|k| [k / 2, k % 2]).collect();
        let a = NodalMatrix::new(&Matrix::from_rows(&self.a).unwrap(), places, &dofs, 2).unwrap();
        let body = ReducedBody::new(a, &normal, &[tangential], LoadPath::constant(self.load())).unwrap();
        ReducedContact::new(body, self.law(), ReducedOptions::default()).unwrap()
    }
}

fn are_same(a: &[f64], b: &[f64]) -> bool {
    let largest = b.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-8 * largest)
}

/// Whatever is said of derivatives in the load, in the full form, in that of forces and in that of displacements, holds of the rates of all
/// pieces: one derivative where there is one branch along every direction, branches that are those of the pieces, *yes* where they are
/// linear, *no* where two sides differ. `BODY_CASES` examines more bodies.
#[test]
fn what_is_said_of_degenerate_bodies_holds() {
    let random = &mut Random::new(21);
    let mut counts = [0; 4];
    'bodies: for _ in 0..super::cases("BODY_CASES", 2000) {
        let body = Body::new(random);
        let (n, p) = (body.a.len(), body.states.len());
        let [u, forces] = body.solution();
        let condensed = body.condensed();
        let full = condensed.full().unwrap();
        let mut reduced = body.reduced();
        let parameters = condensed.parameters().with_loads(&Matrix::identity(n)).unwrap();
        let own = [forces.clone(), vec![0.0]].concat();
        let all = [u.clone(), own.clone()].concat();
        let what = format!("{:?} {:?} {}", body.a, body.states, body.f);
        let made = (
            full.sensitivity(&all, &parameters),
            condensed.sensitivity(&own, &parameters),
            reduced.sensitivity(0.0, &u, &parameters),
        );
        let (mut full, mut condensed, mut reduced) = match made {
            (Ok(full), Ok(condensed), Ok(reduced)) => (full, condensed, reduced),
            // A selection away from kinks, or the first one at a kink, is singular.
            _ => {
                assert!(body.branches(&vec![0.0; n]).is_none(), "{what}");
                continue;
            }
        };
        let directions: Vec<Vec<f64>> = (0..6)
            .map(|_| (0..n).map(|_| random.below(5) as f64 - 2.0).collect())
            .flat_map(|d: Vec<f64>| [d.clone(), d.iter().map(|v| -v).collect()])
            .collect();
        for delta in &directions {
            let exact = body.branches(delta);
            let by_direction = |v: &Vec<f64>| -> Vec<f64> {
                let force = |k: usize| v[n + 2 * (k % p) + k / p];
                v[..n].iter().copied().chain((0..2 * p).map(force)).collect()
            };
            let exact = exact.map(|list| list.iter().map(by_direction).collect::<Vec<_>>());
            let Ok(alone) = reduced.directional(delta) else {
                // Nothing is solved with a singular piece.
                assert!(exact.is_none(), "{what}");
                continue 'bodies;
            };
            let found = [
                (full.directional(delta).unwrap(), 0..2 * n),
                (condensed.directional(delta).unwrap(), n..2 * n),
                (alone, 0..n),
            ];
            for (form, (found, part)) in found.into_iter().enumerate() {
                match (found, &exact) {
                    (Directional::Derivative(v), Some(exact)) => {
                        assert_eq!(exact.len(), 1, "{form} {what} {delta:?}");
                        let exact = &exact[0][part];
                        assert!(are_same(&v, exact), "{form} {what} {delta:?}: {v:?} {exact:?}");
                    }
                    (Directional::Derivative(_), None) => panic!("{form} {what}: a piece is singular"),
                    (
                        Directional::Branches {
                            branches,
                            complete: true,
                        },
                        Some(exact),
                    ) => {
                        counts[3] += 1;
                        let each = |e: &Vec<f64>| branches.iter().any(|b| are_same(b, &e[part.clone()]));
                        assert!(
                            exact.iter().all(each),
                            "{form} {what} {delta:?} {branches:?} {exact:?}"
                        );
                        assert!(branches.len() <= exact.len(), "{form} {what} {delta:?}");
                    }
                    _ => {}
                }
            }
        }
        let known = [
            full.differentiable().unwrap(),
            condensed.differentiable().unwrap(),
            reduced.differentiable().unwrap(),
        ];
        for (form, said) in known.iter().enumerate() {
            let one = |delta: &[f64]| {
                let list = body.branches(delta).expect("a verdict where a piece is singular");
                assert_eq!(list.len(), 1, "{form} {what} {delta:?}");
                list[0].clone()
            };
            match said {
                Differentiability::Yes { .. } => {
                    counts[0] += 1;
                    for pair in directions.chunks_exact(2) {
                        let (ahead, behind) = (one(&pair[0]), one(&pair[1]));
                        let back: Vec<f64> = behind.iter().map(|v| -v).collect();
                        assert!(are_same(&ahead, &back), "{form} {what}");
                    }
                }
                Differentiability::No { direction, .. } => {
                    counts[1] += 1;
                    let opposite: Vec<f64> = direction.iter().map(|d| -d).collect();
                    let back: Vec<f64> = one(&opposite).iter().map(|v| -v).collect();
                    assert!(!are_same(&one(direction), &back), "{form} {what}");
                }
                _ => counts[2] += 1,
            }
        }
        let words = known.each_ref().map(Differentiability::known);
        assert!(words[0] == words[1] && words[1] == words[2], "{what} {words:?}");
    }
    assert!(counts.iter().all(|c| *c > 30), "{counts:?}");
}
