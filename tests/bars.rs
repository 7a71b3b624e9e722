//! The non-uniqueness problems of friction that weakens with the slip, against independent digits.

use semismooth::contact::{CondensedContact, NodeLaw};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, PointKind};

#[path = "../examples/common/bars.rs"]
mod bars;

/// Follows ζ from 3.2 on the sticking side down, through both folds.
fn follow<L: NodeLaw>(problem: &CondensedContact<L>) -> Branch {
    let start = problem
        .solve(3.2, Some(&problem.stick_start(3.2).unwrap()))
        .unwrap();
    let options = ContinuationOptions::default()
        .with_parameter_range((0.6, 3.3))
        .with_targets(vec![1.4]);
    Branch::follow(problem, &start, Direction::Decreasing, options).unwrap()
}

#[test]
fn tmp() {
    for nx in [20, 40] {
        let bar = bars::bar2d(nx).unwrap();
        let b = follow(&bar.problem);
        println!(
            "{nx} {:?} {:?} kinks {:?} smooth {:?} pts {}",
            b.folds(),
            b.termination,
            b.transitions
                .iter()
                .filter(|t| t.is_fold())
                .map(|t| t.parameter())
                .collect::<Vec<_>>(),
            b.smooth_folds.len(),
            b.points.len()
        );
        for p in b
            .points
            .iter()
            .filter(|p| p.kind == PointKind::Target && p.parameter() == 1.4)
        {
            let s = bar.problem.solution(&p.x).unwrap();
            println!("  {:?} {:e}", p.det_sign, s.nodes.last().unwrap().slip[0]);
        }
    }
    for o in [false, true] {
        let bar = bars::bar3d(20, o).unwrap();
        let b = follow(&bar.problem);
        for t in &b.transitions {
            println!(
                "{} {:?} {:?} {:?} arms {} complete {} {:?}",
                t.parameter(),
                t.kind,
                t.sites,
                t.vanishing,
                t.arms.len(),
                t.complete,
                t.vanishing
                    .iter()
                    .map(|&v| t.test_functions[v])
                    .collect::<Vec<_>>()
            );
            for a in &t.arms {
                let q = a.tangent.len() - 1;
                let d: f64 = a.tangent.iter().zip(&t.tangent_before).map(|(x, y)| x * y).sum();
                println!(
                    "   arm dα {} cos {} {:?} graz {:?}",
                    a.tangent[q],
                    d,
                    t.sites
                        .iter()
                        .map(|s| a.selection.piece(s.site))
                        .collect::<Vec<_>>(),
                    a.grazing
                );
            }
        }
        println!(
            "3d {o} {:?} {:?} kinks {:?} smooth {:?} pts {}",
            b.folds(),
            b.termination,
            b.transitions
                .iter()
                .filter(|t| t.is_fold())
                .map(|t| t.parameter())
                .collect::<Vec<_>>(),
            b.smooth_folds.len(),
            b.points.len()
        );
        for p in b
            .points
            .iter()
            .filter(|p| p.kind == PointKind::Target && p.parameter() == 1.4)
        {
            let s = bar.problem.solution(&p.x).unwrap();
            println!("  {:?} {:?}", p.det_sign, s.nodes.last().unwrap().slip);
        }
    }
}
