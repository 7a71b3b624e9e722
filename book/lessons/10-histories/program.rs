use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, EvolutionOptions, FrictionCoefficient, FrictionCurve,
    LoadPath, PlanarCoulomb, evolve,
};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};

/// The block of lesson 9; its top moves by 0.02 α.
fn block(
    friction: FrictionCoefficient,
) -> Result<CondensedContact<PlanarCoulomb>, Box<dyn std::error::Error>> {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [16, 8])?;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()?;
    let load =
        LoadPath::affine(system.supports(), system.motion("top", 0, |_| 0.02)?);
    let ground =
        system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    let body = semismooth::contact_body(&system, &ground, load)?;
    Ok(CondensedContact::new(body, PlanarCoulomb::new(friction))?)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let corners = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0];
    let levels: Vec<f64> = corners
        .windows(2)
        .flat_map(|w| {
            (1..=8).map(move |k| w[0] + (w[1] - w[0]) * f64::from(k) / 8.0)
        })
        .collect();
    let mut panel =
        Panel::new("displacement of the top", "force on the ground along it");
    let laws = [
        ("F = 0.2", Colour::BLUE, FrictionCoefficient::constant(0.2)?),
        (
            "F falls from 0.2 to 0.1 with the slip",
            Colour::ORANGE,
            FrictionCoefficient::uniform(FrictionCurve::exponential(
                0.2, 0.1, 0.005,
            )?),
        ),
    ];
    for (name, colour, friction) in laws {
        println!("{name}");
        println!("  top      open stick slip   force      dissipated");
        let mut problem = block(friction)?;
        let start = problem.solve(0.0, None)?;
        let force =
            |found: &semismooth::contact::ContactSolution| found.resultant()[1];
        let mut path = vec![(0.0, force(&problem.solution(&start)?))];
        let mut sums = [0.0; 3];
        let steps = evolve(
            &mut problem,
            &start,
            &levels,
            &EvolutionOptions::default(),
            |step| {
                sums = [
                    sums[0] + step.work,
                    sums[1] + step.stored,
                    sums[2] + step.dissipated,
                ];
                let found = &step.solution;
                path.push((0.02 * step.level, force(found)));
                if step.level.abs() == 1.0 {
                    println!(
                        "  {:+.3}   {:4} {:5} {:4}   {:+.5}   {:.3e}",
                        0.02 * step.level,
                        found.open(),
                        found.stick(),
                        found.slip(),
                        force(found),
                        sums[2]
                    );
                }
                ControlFlow::Continue(())
            },
        )?;
        let followed = steps.iter().filter(|s| s.arrival.is_followed()).count();
        let balance = (sums[0] - sums[1] - sums[2]).abs() < 1e-12;
        println!(
            "  {followed} of {} levels followed; work = stored + dissipated: {balance}",
            steps.len()
        );
        panel = panel.with_curve(
            Curve::line(path, SegmentStyle::new(name, colour)).with_arrows(true),
        );
    }
    BranchDiagram::new(panel)
        .with_size(700, 430)
        .write("hysteresis.svg")?;
    Ok(())
}
