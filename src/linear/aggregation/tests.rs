use super::*;
use crate::fem::{Dilatation, Elasticity, Material, Mesh};
use crate::linear::Gmres;
use crate::sparse::{NodalBlocks, NodalMatrix, dot};

fn rigid(points: &[[f64; 3]]) -> Vec<[[f64; 6]; 3]> {
    let rows = |x: &[f64; 3]| {
        [
            [1.0, 0.0, 0.0, 0.0, x[2], -x[1]],
            [0.0, 1.0, 0.0, -x[2], 0.0, x[0]],
            [0.0, 0.0, 1.0, x[1], -x[0], 0.0],
        ]
    };
    points.iter().map(rows).collect()
}

fn body(mesh: Mesh, material: Material, jump: f64) -> NodalMatrix {
    body_with(mesh, material, jump, Dilatation::Automatic)
}

fn body_with(mesh: Mesh, material: Material, jump: f64, dilatation: Dilatation) -> NodalMatrix {
    let mut mesh = mesh;
    mesh.mark_cells("stiff", |x| {
        (0..3).map(|d| (3.0 * x[d]).floor() as i64).sum::<i64>() % 2 == 0
    });
    let stiff = Material::isotropic(jump, 0.3).unwrap();
    let mut body = Elasticity::new(mesh, material);
    if jump != 1.0 {
        body = body.with_material("stiff", stiff);
    }
    let body = body.with_dilatation(dilatation);
    body.fix("left").discretize().unwrap().nodal_stiffness().unwrap()
}

fn block(n: [usize; 3]) -> Mesh {
    Mesh::block([0.0; 3], [2.0, 2.0, 1.0], n).unwrap()
}

fn space(a: &NodalMatrix) -> &Symmetric<3> {
    match &a.blocks {
        NodalBlocks::Space(a) => a,
        NodalBlocks::Plane(_) => panic!("a body in space"),
    }
}

/// Iterations that reduce the residual by 1e-8 with some contact nodes fixed.
fn iterations(a: &NodalMatrix, constrained: &[usize]) -> usize {
    let blocks = space(a);
    let fixed = vec![0; a.num_nodes()];
    let mut cycle =
        Aggregation::<3, 6>::new(blocks, rigid(a.points()), (fixed, Vec::new()), Until::default()).unwrap();
    assert!(cycle.sizes(blocks).len() >= 2);
    cycle.constrain(blocks, constrained, &[]).unwrap();
    let n = 3 * a.num_nodes();
    let mut b: Vec<f64> = (0..n).map(|k| ((k * k) % 17) as f64 - 8.0).collect();
    constrained.iter().for_each(|k| b[*k] = 0.0);
    let rhs = b.clone();
    let cycle = std::cell::RefCell::new(cycle);
    let outcome = Gmres::flexible(60)
        .solve(
            |x, y| {
                cycle.borrow().add_image(blocks, x, y);
                constrained.iter().for_each(|k| y[*k] = 0.0);
            },
            |z| cycle.borrow_mut().apply(blocks, z),
            &mut b,
            1e-8,
            60,
        )
        .unwrap();
    // The residual of the recurrence is the true one.
    let mut image = vec![0.0; n];
    blocks.mul(&b, &mut image);
    constrained.iter().for_each(|k| image[*k] = 0.0);
    let rest: f64 = rhs.iter().zip(&image).map(|(b, i)| (b - i).powi(2)).sum();
    assert!(rest.sqrt() <= 2e-8 * dot(&rhs, &rhs).sqrt());
    outcome.iterations
}

/// Strips of rows, relaxed in two colours: the residual that a smoothing returns is the true one.
#[test]
fn residuals_of_sweeps_are_true() {
    let steel = Material::isotropic(1.0, 0.277).unwrap();
    let a = body(block([40, 15, 8]), steel, 1.0);
    let blocks = space(&a);
    let n = 3 * a.num_nodes();
    let mut smoother = Smoother::new(blocks, |_| 0);
    assert!(smoother.num_strips() > 3);
    let b: Vec<f64> = (0..n).map(|k| crate::spread::golden(k + 1) - 0.5).collect();
    let check = |smoother: &Smoother<3>| {
        let mut image = vec![0.0; n];
        blocks.mul(&smoother.x, &mut image);
        let rest = image.iter().zip(&b).zip(&smoother.r);
        let off = rest.fold(0.0f64, |m, ((i, b), r)| m.max((b - i - r).abs()));
        assert!(off <= 1e-13, "{off:e}");
        dot(&smoother.r, &smoother.r).sqrt()
    };
    smoother.b.copy_from_slice(&b);
    for sweeps in [1, 2, 3] {
        for symmetric in [false, true] {
            smoother.smooth_before(blocks, sweeps);
            let before = check(&smoother);
            smoother.smooth_after(blocks, &Added::new(), sweeps, symmetric);
            assert!(check(&smoother) < before);
        }
    }
}

/// Every other node at the bottom sticks, the rest is fixed along z.
fn bottom(a: &NodalMatrix) -> Vec<usize> {
    let nodes = (0..a.num_nodes()).filter(|i| a.points()[*i][2] == 0.0);
    let components = |i: usize| {
        if i.is_multiple_of(2) {
            3 * i..3 * i + 3
        } else {
            3 * i + 2..3 * i + 3
        }
    };
    nodes.flat_map(components).collect()
}

#[test]
fn bodies_of_all_kinds_take_few_iterations() {
    let steel = || Material::isotropic(1.0, 0.277).unwrap();
    let rubber = || Material::isotropic(1.0, 0.49).unwrap();
    let slender = Mesh::block([0.0; 3], [20.0, 1.0, 1.0], [60, 3, 3]).unwrap();
    let cases = [
        ("block", body(block([16, 15, 8]), steel(), 1.0), 18),
        ("slender", body(slender, steel(), 1.0), 25),
        ("jumps", body(block([12, 11, 6]), steel(), 1e4), 30),
        (
            "tetrahedra",
            body(block([12, 11, 6]).simplices().unwrap(), steel(), 1.0),
            25,
        ),
        (
            "nearly incompressible",
            body_with(block([12, 11, 6]), rubber(), 1.0, Dilatation::Pointwise),
            30,
        ),
        // Without locking the volume is held in each cell, which smoothing by nodes reduces more slowly.
        (
            "nearly incompressible, mean dilatation",
            body_with(block([12, 11, 6]), rubber(), 1.0, Dilatation::Mean),
            50,
        ),
    ];
    for (name, a, most) in cases {
        for constrained in [Vec::new(), bottom(&a)] {
            let count = iterations(&a, &constrained);
            assert!(
                count <= most,
                "{name}, {} constrained: {count}",
                constrained.len()
            );
        }
    }
}

/// Twice the largest relative rounding of coarse matrices, which are in single precision where they are not the coarsest.
const SINGLE: f64 = f32::EPSILON as f64;

/// The first coarse matrix, entry by entry, in the units of A.
fn coarse(cycle: &Aggregation<3, 6>) -> Vec<f64> {
    let unit = cycle.first.as_ref().unwrap().unit();
    let wide = |b: [[f32; 6]; 6]| b.map(|row| row.map(f64::from));
    let blocks: Vec<[[f64; 6]; 6]> = match cycle.matrices.first() {
        Some(a) => a.lower().value.iter().copied().map(wide).collect(),
        None => cycle.coarsest.lower().value.clone(),
    };
    let entries = blocks.as_flattened().as_flattened().iter();
    entries.map(|v| v / unit).collect()
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0f64, |m, v| m.max(v.abs()))
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()))
}

/// Coarse matrices after a change of constraints are Galerkin products, as if the hierarchy were rebuilt, and changing back leaves rounding.
#[test]
fn constraints_change_what_depends_on_them_and_nothing_is_missed() {
    for cells in [[9, 8, 4], [24, 24, 12]] {
        let a = body(block(cells), Material::isotropic(1.0, 0.3).unwrap(), 1.0);
        let (blocks, n) = (space(&a), a.num_nodes());
        let make = || {
            Aggregation::<3, 6>::new(
                blocks,
                rigid(a.points()),
                (vec![0; n], Vec::new()),
                Until::default(),
            )
        };
        let mut cycle = make().unwrap();
        let free = coarse(&cycle);
        let constrained = bottom(&a);
        let node = constrained[0] / 3 + 3;
        let added = [(3 * node, 3 * node, 2.0), (3 * node + 1, 3 * node + 1, 0.5)];
        cycle.constrain(blocks, &constrained[3..], &added).unwrap();
        cycle.constrain(blocks, &constrained, &added).unwrap();
        let first = cycle.first.as_ref().unwrap();
        let m = cycle.smoothers[0].x.len();
        let prolonged = |k: usize| {
            let (mut unit, mut x) = (vec![0.0; m], vec![0.0; 3 * n]);
            unit[k] = 1.0;
            first.prolong(&unit, &mut x);
            x.iter_mut().for_each(|x| *x /= first.unit());
            x
        };
        let sums = coarse(&cycle);
        let lower = match cycle.matrices.first() {
            Some(a) => (a.lower().start.clone(), a.lower().col.clone()),
            None => (
                cycle.coarsest.lower().start.clone(),
                cycle.coarsest.lower().col.clone(),
            ),
        };
        // All columns where there are few, else some of them, of all components.
        for k in (0..m).step_by(if m < 300 { 1 } else { (m / 40) | 1 }) {
            let x = prolonged(k);
            assert!(constrained.iter().all(|h| x[*h] == 0.0));
            let mut image = vec![0.0; 3 * n];
            blocks.mul(&x, &mut image);
            image[3 * node] += 2.0 * x[3 * node];
            image[3 * node + 1] += 0.5 * x[3 * node + 1];
            // Entries (j, k) of the row of blocks.
            let row = k / 6;
            for place in lower.0[row]..lower.0[row + 1] {
                for c in 0..6 {
                    let exact = dot(&prolonged(6 * lower.1[place] as usize + c), &image);
                    let off = (sums[36 * place + 6 * (k % 6) + c] - exact).abs();
                    assert!(off <= SINGLE * largest(&free), "column {k}: {off:e}");
                }
            }
        }
        // The image of what a cycle returns is that under A with additions, in fixed components, too.
        let mut x: Vec<f64> = (0..3 * n).map(|k| crate::spread::golden(k + 1) - 0.5).collect();
        cycle.apply(blocks, &mut x).unwrap();
        assert!(constrained.iter().all(|h| x[*h] == 0.0));
        let (mut image, mut exact) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
        cycle.add_image(blocks, &x, &mut image);
        blocks.mul(&x, &mut exact);
        exact[3 * node] += 2.0 * x[3 * node];
        exact[3 * node + 1] += 0.5 * x[3 * node + 1];
        assert!(distance(&image, &exact) <= 1e-13);
        let mut product = vec![0.0; 3 * n];
        cycle.add_product(blocks, &x, &mut product);
        assert!(distance(&product, &exact) <= 1e-13);
        cycle.constrain(blocks, &[], &[]).unwrap();
        let rounding = if cycle.matrices.is_empty() { 1e-14 } else { SINGLE };
        assert!(distance(&coarse(&cycle), &free) <= rounding * largest(&free));
    }
}

/// Additions change by little: coarse matrices stay until small changes have become a large one, products are exact all the time.
#[test]
fn slight_changes_are_kept_from_coarse_levels_alone() {
    let a = body(block([9, 8, 4]), Material::isotropic(1.0, 0.3).unwrap(), 1.0);
    let (blocks, n) = (space(&a), a.num_nodes());
    let mut cycle = Aggregation::<3, 6>::new(
        blocks,
        rigid(a.points()),
        (vec![0; n], Vec::new()),
        Until::default(),
    )
    .unwrap();
    let free = coarse(&cycle);
    let node = bottom(&a)[0] / 3;
    let size = largest(blocks.diagonal(node).as_flattened());
    for (share, same) in [(0.6, true), (1.2, false), (1.2 - 0.6, false)] {
        let before = coarse(&cycle);
        let more = share * SLIGHT * size;
        cycle
            .constrain(blocks, &[], &[(3 * node, 3 * node, more)])
            .unwrap();
        assert_eq!(coarse(&cycle) == free, same, "{share}");
        assert_eq!(coarse(&cycle) == before, share < 1.0, "{share}");
        let mut x: Vec<f64> = (0..3 * n).map(|k| crate::spread::golden(k + 1) - 0.5).collect();
        cycle.apply(blocks, &mut x).unwrap();
        let (mut image, mut exact) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
        cycle.add_image(blocks, &x, &mut image);
        blocks.mul(&x, &mut exact);
        exact[3 * node] += more * x[3 * node];
        let off = distance(&image, &exact);
        assert!(off <= 1e-13 && more * x[3 * node].abs() > 1e-6, "{off:e}");
    }
    cycle.constrain(blocks, &[], &[]).unwrap();
    assert!(distance(&coarse(&cycle), &free) <= 1e-14 * size);
}

/// The body has no support.
#[test]
fn floating_bodies_are_refused() {
    let a = body(block([9, 8, 4]), Material::isotropic(1.0, 0.3).unwrap(), 1.0);
    let mut blocks = space(&a).clone();
    // Springs to the support are taken away: each row sums to nothing under translations.
    let lower = blocks.lower().clone();
    let mut values = lower.value.clone();
    for i in 0..blocks.nrows() {
        let mut sum = [[0.0; 3]; 3];
        blocks.each(i, |_, block| {
            for (s, v) in sum.as_flattened_mut().iter_mut().zip(block.as_flattened()) {
                *s += v;
            }
        });
        let own = values[lower.start[i + 1] - 1].as_flattened_mut();
        own.iter_mut().zip(sum.as_flattened()).for_each(|(v, s)| *v -= s);
    }
    blocks.values_mut().copy_from_slice(&values);
    let made = Aggregation::<3, 6>::new(
        &blocks,
        rigid(a.points()),
        (vec![0; a.num_nodes()], Vec::new()),
        Until::default(),
    );
    assert_eq!(made.err(), Some(LinearError::NotPositiveDefinite));
}

/// Changes and cycles end once time is over; an interrupted change is completed by the next one, bitwise the same as without.
#[test]
fn interrupted_changes_are_carried_through() {
    let a = body(block([10, 10, 5]), Material::isotropic(1.0, 0.277).unwrap(), 1.0);
    let (blocks, n) = (space(&a), a.num_nodes());
    let make = |until| Aggregation::<3, 6>::new(blocks, rigid(a.points()), (vec![0; n], Vec::new()), until);
    let over = Until::after(Some(std::time::Duration::ZERO));
    assert_eq!(make(over).err(), Some(LinearError::TimeLimit));
    let (mut cycle, mut other) = (make(Until::default()).unwrap(), make(Until::default()).unwrap());
    let (first, second): (Vec<usize>, Vec<usize>) = ((0..60).collect(), (30..90).collect());
    cycle.set_until(over);
    assert_eq!(cycle.constrain(blocks, &first, &[]), Err(LinearError::TimeLimit));
    assert_eq!(
        cycle.apply(blocks, &mut vec![1.0; 3 * n]),
        Err(LinearError::TimeLimit)
    );
    cycle.set_until(Until::default());
    let image = |cycle: &mut Aggregation<3, 6>| {
        cycle.constrain(blocks, &second, &[]).unwrap();
        let mut b: Vec<f64> = (0..3 * n).map(|k| ((k * k) % 17) as f64 - 8.0).collect();
        cycle.apply(blocks, &mut b).unwrap();
        b
    };
    other.constrain(blocks, &first, &[]).unwrap();
    assert_eq!(image(&mut cycle), image(&mut other));
}
