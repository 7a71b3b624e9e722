use semismooth::contact::{ContactState, HildRenard};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    let model = HildRenard::new(1.5, -4.0, 1.0, 1.0)?;
    let map = model.problem()?;
    let found = map.solve_from_states(4.0, &[ContactState::SlipMinus])?;
    let exact = model.solution(ContactState::SlipMinus, 4.0);
    println!(
        "  u_t = {:.4}, λ_ν = {:.4}; by the formula {:.4}, {:.4}",
        found[1], found[2], exact[1], exact[2]
    );

    println!("2.");
    let options = ContinuationOptions::default().with_parameter_range((0.0, 8.0));
    for change in [0.08, 0.0, -0.08] {
        let map = HildRenard::new(1.0 - change, -2.0, 1.0, 1.0)?.problem()?;
        let start = map.solve_from_states(8.0, &[ContactState::Stick])?;
        let branch =
            Branch::follow(&map, &start, Direction::Decreasing, options.clone())?;
        let met: Vec<String> = branch
            .transitions
            .iter()
            .map(|t| format!("{} at {:.4}", t.kind, t.parameter()))
            .collect();
        println!(
            "  f_ν = {:.2}: {}; {}",
            1.0 - change,
            met.join(", "),
            branch.termination
        );
    }
    Ok(())
}
