mod common;
use common::*;
use semismooth::contact::*;
use semismooth::continuation::*;
fn run<M: FrictionMap>(map: &M) {
    let x = first_point(map, 6.0, &FrictionStart::States(states("K"))).unwrap();
    let o = ContinuationOptions::default()
        .with_parameter_range((-12.0, 25.0))
        .with_max_step(0.5)
        .with_max_points(1000);
    let mut c = Continuation::new(map, &x, Direction::Decreasing, o).unwrap();
    for e in c.by_ref() {
        match e.unwrap() {
            Event::Point(p) => println!("P {:?} t {:?} {:?} {:?}", p.x, p.tangent, p.selection, p.kind),
            Event::Transition(t) => println!("T {:?} {} {:?}", t.x, t.kind, t.arms),
            Event::BranchPoint(t) => println!("BP {:?} {:?}", t.point.x, t.arms),
            _ => println!("other"),
        }
    }
    println!("{:?} {:?}", c.termination(), c.position());
}
#[test]
fn scratch() {
    let case = cases().into_iter().find(|c| c.name == "p1_ex3").unwrap();
    run(&case.problem);
    run(&CondensedFriction::new(case.problem.clone()).unwrap());
}
