mod common;
use common::*;
use semismooth::contact::*;
use semismooth::continuation::*;
#[test]
fn scratch() {
    let case = cases().into_iter().find(|c| c.name == "p1_ex3").unwrap();
    let map = CondensedFriction::new(case.problem.clone()).unwrap();
    for (st, dir) in [
        ("K", Direction::Decreasing),
        ("O", Direction::Increasing),
        ("O", Direction::Decreasing),
    ] {
        let x = first_point(&map, 6.0, &FrictionStart::States(states(st))).unwrap();
        let o = ContinuationOptions::default()
            .with_parameter_range((-12.0, 25.0))
            .with_max_step(0.5)
            .with_max_points(100);
        let c = Continuation::new(&map, &x, dir, o).unwrap();
        for e in c {
            match e.unwrap() {
                Event::Point(p) => println!("{:?} t {:?} {:?} {:?}", p.x, p.tangent, p.selection, p.kind),
                Event::Transition(t) => println!("T {:?} {} {:?}", t.x, t.kind, t.arms),
                Event::BranchPoint(t) => println!("BP {:?} {:?}", t.point.x, t.arms),
                _ => println!("other"),
            }
        }
    }
}
