use semismooth::contact::{
    CondensedContact, ContactBody, ContactState, FrictionCoefficient, FullContact,
    LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::fem::{ElasticSystem, Elasticity, Foundation, Material, Mesh};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn block() -> Outcome<(ElasticSystem, ContactBody)> {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [16, 8])?;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()?;
    let load =
        LoadPath::affine(system.supports(), system.motion("top", 0, |_| 0.05)?);
    let ground =
        system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    let body = semismooth::contact_body(&system, &ground, load)?;
    Ok((system, body))
}

fn main() -> Outcome<()> {
    let (system, body) = block()?;
    let law = |f: f64| {
        Ok::<_, Box<dyn std::error::Error>>(PlanarCoulomb::new(
            FrictionCoefficient::constant(f)?,
        ))
    };
    let condensed = CondensedContact::new(body.clone(), law(0.4)?)?;
    let x = condensed.solve(0.5, None)?;

    println!("1.");
    let full = FullContact::new(body.clone(), law(0.4)?)?;
    let y = full.solve(0.5, None)?;
    println!(
        "  {} unknowns in condensed, {} in full form",
        x.len() - 1,
        y.len() - 1
    );
    let (a, b) = (condensed.solution(&x)?, full.solution(&y)?);
    let difference = a
        .nodes
        .iter()
        .zip(&b.nodes)
        .map(|(a, b)| (a.pressure - b.pressure).abs())
        .fold(0.0, f64::max);
    println!("  the pressures agree to 1e-12: {}", difference < 1e-12);

    println!("2.");
    let reactions = system.reactions(
        &condensed.displacements(&x)?,
        &condensed.support_displacements(&x)?,
    )?;
    let top = |component: usize| -> f64 {
        let nodes = system
            .mesh()
            .points()
            .iter()
            .enumerate()
            .filter(|(_, p)| p[1] == 1.0);
        nodes.map(|(node, _)| reactions[2 * node + component]).sum()
    };
    let ground = a.resultant();
    println!(
        "  on the top ({:+.5}, {:+.5}); pressure {:.5}, friction {:.5}",
        top(0),
        top(1),
        ground[0],
        ground[1].abs()
    );

    println!("3.");
    for f in [0.2, 0.4] {
        let map = CondensedContact::new(body.clone(), law(f)?)?;
        let options =
            ContinuationOptions::default().with_parameter_range((0.0, 2.0));
        let branch = Branch::follow(
            &map,
            &map.solve(0.0, None)?,
            Direction::Increasing,
            options,
        )?;
        let gone = branch
            .transitions
            .iter()
            .find(|t| !map.states(&t.after).contains(&ContactState::Stick));
        match gone {
            Some(t) => {
                println!(
                    "  F = {f}: nothing sticks from α = {:.4} on",
                    t.parameter()
                )
            }
            None => println!("  F = {f}: something sticks up to α = 2"),
        }
    }
    Ok(())
}
