//! Two families of contact problems on meshes of any fineness, as GetFEM's demonstrations of continuation set them up.
#![allow(dead_code)]

use std::error::Error;
use std::path::Path;

use semismooth::contact::{FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::fem::{Dilatation, ElasticSystem, Elasticity, Foundation, Material, Mesh, read_gmsh};

/// The vee-shaped body on the ground: P1 triangles, λ = 100, μ = 82 GPa, F = 1.8; held at the ends of its arms. The volume force
/// turns from (−5, 1) to (−5, −8) GN/m³ while γ runs from 0 to 1. `refinements` times each triangle is cut in four.
pub(crate) fn vee(refinements: usize) -> Result<FullContact<PlanarCoulomb>, Box<dyn Error>> {
    let mut mesh = read_gmsh(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data/vee_h_0.03.msh"))?;
    for _ in 0..refinements {
        mesh = mesh.refined()?;
    }
    let diagonal = 0.5f64.sqrt();
    mesh.mark_boundary("held", |f| {
        let [x, y, _] = f.normal;
        y > 1.0 - 1e-7 || (x - diagonal).powi(2) + (y - diagonal).powi(2) < 1e-7
    });
    mesh.mark_boundary("ground", |f| f.normal[1] < -1.0 + 1e-7);
    let system = Elasticity::new(mesh, Material::lame(100.0, 82.0)?)
        .fix("held")
        .assemble()?;
    let start = system.body_force(|_| [-5.0, 1.0, 0.0])?;
    let end = system.body_force(|_| [-5.0, -8.0, 0.0])?;
    problem(&system, "ground", LoadPath::between(start, &end), 1.8)
}

/// The block of 40 mm × 80 mm on the ground: Q1 on n[0] × n[1] cells, λ = 4000, μ = 120 N/mm², held on top, F = 0.5. The tractions
/// on both sides turn from −2 to 2 N/mm² horizontally; the vertical ones stay at −1 on the left and −1.3 on the right.
pub(crate) fn block(n: [usize; 2]) -> Result<FullContact<PlanarCoulomb>, Box<dyn Error>> {
    let mesh = Mesh::rectangle([0.0, 0.0], [40.0, 80.0], n)?;
    let system = Elasticity::new(mesh, Material::lame(4000.0, 120.0)?)
        // That of the reference, though ν = 0.485: quadrilaterals of full integration.
        .with_dilatation(Dilatation::Pointwise)
        .fix("top")
        .assemble()?;
    let sides = |horizontal: f64| -> Result<Vec<f64>, Box<dyn Error>> {
        let left = system.traction("left", |_| [horizontal, -1.0, 0.0])?;
        let right = system.traction("right", |_| [horizontal, -1.3, 0.0])?;
        Ok(left.iter().zip(&right).map(|(l, r)| l + r).collect())
    };
    let load = LoadPath::between(sides(-2.0)?, &sides(2.0)?);
    problem(&system, "bottom", load, 0.5)
}

fn problem(
    system: &ElasticSystem,
    ground: &str,
    load: LoadPath,
    friction: f64,
) -> Result<FullContact<PlanarCoulomb>, Box<dyn Error>> {
    let contact = system.contact(ground, &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    let friction = FrictionCoefficient::nodal(vec![friction; contact.nodes.len()])?;
    Ok(FullContact::planar(
        system.stiffness().clone(),
        contact.normal,
        contact.tangential[0].clone(),
        load,
        friction,
    )?
    .with_gap(contact.gap)?
    .with_r(10.0)?)
}
