//! Problems whose states are known: linear as long as no contact slips in space.

use super::newton::Piece;
use super::scaled::{ScaledProblem, add_product};
use crate::linear::SmallLu;

/// One unknown reaction of contact `contact` along `direction`, and the component of its velocity that vanishes.
#[derive(Debug, Clone, Copy)]
struct Unknown<const D: usize> {
    contact: usize,
    direction: [f64; D],
    component: usize,
}

/// Solves for the reactions of contacts in the given states, where the reaction of a slipping one stays on the side of the cone on which
/// `r` lies: u = 0 where it sticks, u_N = 0 and r_T = ±μ r_N where it slips. False, with `r` unchanged, where a contact slips in space or
/// the system is singular. The caller must check the law.
pub(super) fn solve_settled<const D: usize>(
    p: &ScaledProblem<D>,
    state: impl Fn(usize, &[f64; D]) -> Piece,
    r: &mut [[f64; D]],
) -> bool {
    let mut unknowns: Vec<Unknown<D>> = Vec::with_capacity(D * r.len());
    let mut first = Vec::with_capacity(r.len() + 1);
    for (contact, r) in r.iter().enumerate() {
        first.push(unknowns.len());
        let unit = |component: usize| Unknown {
            contact,
            direction: std::array::from_fn(|k| f64::from(k == component)),
            component,
        };
        match state(contact, r) {
            Piece::Open => {}
            Piece::Stick => unknowns.extend((0..D).map(unit)),
            Piece::Slip if D == 2 => {
                let mut one = unit(0);
                one.direction[1] = p.friction[contact].copysign(r[1]);
                unknowns.push(one);
            }
            Piece::Slip => return false,
        }
    }
    first.push(unknowns.len());
    let order = unknowns.len();
    let mut lu = SmallLu::default();
    let entries = lu.matrix(order);
    let mut b: Vec<f64> = unknowns
        .iter()
        .map(|one| -p.q[one.contact][one.component])
        .collect();
    for (column, one) in unknowns.iter().enumerate() {
        for (i, block) in p.matrix.column(one.contact) {
            let mut product = [0.0; D];
            add_product(block, &one.direction, &mut product);
            for row in first[i]..first[i + 1] {
                entries[column * order + row] = product[unknowns[row].component];
            }
        }
    }
    if !lu.factor() {
        return false;
    }
    lu.solve(&mut b);
    r.fill([0.0; D]);
    for (one, b) in unknowns.iter().zip(&b) {
        for k in 0..D {
            r[one.contact][k] += b * one.direction[k];
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::delassus::DelassusProblem;
    use crate::sparse::Matrix;
    use crate::spread::Random;

    fn problem<const D: usize>(random: &mut Random, contacts: usize) -> ScaledProblem<D> {
        let n = D * contacts;
        let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        // Some blocks are not stored.
        let stored = all.filter(|(i, j)| i / D == j / D || !(i / D + 2 * (j / D)).is_multiple_of(3));
        let entries = stored.map(|(i, j)| (i, j, random.symmetric() + if i == j { 3.0 } else { 0.0 }));
        let m = Matrix::from_triplets(n, n, &entries.collect::<Vec<_>>()).unwrap();
        let q = (0..n).map(|_| random.symmetric()).collect();
        let friction = (0..contacts).map(|_| 0.5 + 0.4 * random.symmetric()).collect();
        ScaledProblem::new(&DelassusProblem::new(D, m, q, friction).unwrap())
    }

    /// Each state's equations hold for u = M r + q, computed apart, and slip keeps its side of the cone.
    #[test]
    fn reactions_satisfy_the_equations_of_their_states() {
        let mut random = Random::new(3);
        let states = [Piece::Open, Piece::Stick, Piece::Slip];
        for case in 0..200 {
            let contacts = 1 + case % 7;
            let p: ScaledProblem<2> = problem(&mut random, contacts);
            let given: Vec<Piece> = (0..contacts).map(|i| states[(case / 3 + i * i) % 3]).collect();
            let start: Vec<[f64; 2]> = (0..contacts).map(|_| [1.0, random.symmetric()]).collect();
            let mut r = start.clone();
            assert!(solve_settled(&p, |i, _| given[i], &mut r));
            let mut u = r.clone();
            p.velocities(&r, &mut u);
            for i in 0..contacts {
                let side = p.friction[i] * start[i][1].signum();
                let rows = match given[i] {
                    Piece::Open => r[i],
                    Piece::Stick => u[i],
                    Piece::Slip => [u[i][0], r[i][1] - side * r[i][0]],
                };
                assert!(
                    rows.iter().all(|v| v.abs() < 1e-12),
                    "case {case}, contact {i}: {rows:?}"
                );
            }
        }
    }

    #[test]
    fn slip_in_space_and_singular_systems_are_left_alone() {
        let mut random = Random::new(4);
        let p: ScaledProblem<3> = problem(&mut random, 3);
        let start = vec![[1.0, 0.2, 0.1]; 3];
        let mut r = start.clone();
        let slips = |i: usize, _: &[f64; 3]| if i == 2 { Piece::Slip } else { Piece::Stick };
        assert!(!solve_settled(&p, slips, &mut r) && r == start);
        assert!(solve_settled(&p, |_, _| Piece::Stick, &mut r));
        let mut u = r.clone();
        p.velocities(&r, &mut u);
        assert!(u.iter().flatten().all(|v| v.abs() < 1e-12));
        // Two contacts at one point.
        let ones =
            Matrix::from_triplets(4, 4, &[(0, 0, 1.0), (0, 2, 1.0), (2, 0, 1.0), (2, 2, 1.0)]).unwrap();
        let twice = DelassusProblem::new(2, ones, vec![-1.0, 0.0, -1.0, 0.0], vec![0.5; 2]).unwrap();
        let mut r = vec![[0.5, 0.1]; 2];
        assert!(!solve_settled(
            &ScaledProblem::<2>::new(&twice),
            |_, _| Piece::Stick,
            &mut r
        ));
        assert_eq!(r, [[0.5, 0.1]; 2]);
    }
}
