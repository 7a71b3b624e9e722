#[path = "../../examples/common/macmpec.rs"]
mod problems;

use semismooth::optimise::Bundle;

/// Each problem ends at stationary points from all its starts, and one of them has the value of the list to all its digits.
#[test]
fn macmpec() {
    let all = problems::all();
    assert!(all.len() >= 15);
    for problem in all {
        let mut best = f64::INFINITY;
        for start in &problem.starts {
            let (_, report) = (problem.solve)(&Bundle::default(), start).unwrap();
            assert!(report.is_solved(), "{} from {start:?}: {report}", problem.name);
            assert!(report.subgradient_norm <= 1e-6 * report.gradient_norm);
            best = best.min(report.value);
        }
        let unit = 10.0_f64.powi(-(problem.digits as i32));
        assert!(
            (best - problem.published).abs() <= 0.5 * unit * (1.0 + 1e-6),
            "{}: {best}",
            problem.name
        );
    }
}
