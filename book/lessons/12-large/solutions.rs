use semismooth::contact::{
    CondensedContact, FrictionCoefficient, LoadPath, OrthotropicCoulomb,
    ReducedContact, ReducedOptions,
};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], [4, 4, 2])?;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .fix("left")
        .discretize()?;
    let press = system.traction("top", |_| [0.0, 0.0, -0.02])?;
    let push = system.traction("right", |_| [0.02, 0.0, 0.0])?;
    let ground =
        system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]))?;
    let load = LoadPath::affine(press, push); // pressed at α = 0, pushed as well at α = 1
    let body = semismooth::reduced_body(&system, &ground, load)?;
    let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.3)?);

    println!("1.");
    let condensed = CondensedContact::new(body.to_contact_body()?, law.clone())?;
    let reference = condensed.displacements(&condensed.solve(1.0, None)?)?;
    let mut large = ReducedContact::new(body, law, ReducedOptions::default())?;
    let first = large.solve(1.0, None)?;
    let far = first
        .displacements
        .iter()
        .zip(&reference)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    let size = reference.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    println!(
        "  the displacements agree to 1e-8 of the largest: {}",
        far <= 1e-8 * size
    );

    println!("2.");
    let near = large.solve(1.01, Some(&first.displacements))?;
    println!(
        "  from the solution at the load before: {} Newton steps in place of {}",
        near.newton(),
        first.newton()
    );
    Ok(())
}
