use std::ops::ControlFlow;

use semismooth::contact::{
    ContactBody, EvolutionOptions, FrictionCoefficient, FullContact, LoadPath,
    PlanarCoulomb, evolve,
};
use semismooth::sparse::Matrix;

/// A mass on a spring of stiffness 1 along the ground, pressed by 1 and pulled by
/// α.
fn slider(
    friction: f64,
) -> Result<FullContact<PlanarCoulomb>, Box<dyn std::error::Error>> {
    let load = LoadPath::affine(vec![1.0, 0.0], vec![0.0, 1.0]);
    let body = ContactBody::new(
        Matrix::identity(2),
        Matrix::from_rows(&[[1.0, 0.0]])?,
        vec![Matrix::from_rows(&[[0.0, 1.0]])?],
        load,
    )?;
    Ok(FullContact::new(
        body,
        PlanarCoulomb::new(FrictionCoefficient::constant(friction)?),
    )?)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    let mut problem = slider(0.4)?;
    let start = problem.solve(0.0, None)?;
    let options = EvolutionOptions::default();
    let mut dissipated = 0.0;
    evolve(
        &mut problem,
        &start,
        &[1.0, 0.5, 0.0, -1.0, 1.0],
        &options,
        |step| {
            dissipated += step.dissipated;
            let place = (step.displacements[1] * 1e9).round() / 1e9;
            println!(
                "  α = {:+.1}: u_t = {place:+.2}, {}, dissipated so far {dissipated:.2}",
                step.level, step.solution.states[0]
            );
            ControlFlow::Continue(())
        },
    )?;

    println!("2.");
    for levels in [vec![1.0], vec![0.5, 1.0], vec![1.0, 0.0]] {
        let mut problem = slider(0.4)?;
        let start = problem.solve(0.0, None)?;
        let steps = evolve(&mut problem, &start, &levels, &options, |_| {
            ControlFlow::Continue(())
        })?;
        let end = steps.last().ok_or("there are levels")?;
        println!("  by way of {levels:?}: u_t = {:.2}", end.displacements[1]);
    }
    Ok(())
}
