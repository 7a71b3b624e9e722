//! Bars pressed on the ground whose friction weakens with the slip, after Haslinger, Kučera and Vlach (2008): E = 211.9 GPa,
//! ν = 0.277, clamped at x = 0, F(ξ) = 0.1 + 0.3 exp(−(ξ/5 mm)²), scaled by the parameter ζ. Metres, GPa and GN.
#![allow(dead_code)]

use std::error::Error;

use semismooth::contact::{
    CondensedContact, FrictionCoefficient, FrictionCurve, LoadPath, OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// A bar with its contact rows and the condensed problem.
pub(crate) struct Bar<L> {
    pub(crate) system: ElasticSystem,
    pub(crate) rows: ContactRows,
    pub(crate) problem: CondensedContact<L>,
}

/// F(ξ), ξ in metres.
pub(crate) fn weakening() -> FrictionCurve {
    FrictionCurve::function(|slip| {
        let s = slip / 0.005;
        let decay = 0.3 * (-s * s).exp();
        (0.1 + decay, -2.0 * s / 0.005 * decay)
    })
}

/// (0, 10) × (0, 1) m in plane strain, n × n/10 squares.
pub(crate) fn bar2d(nx: usize) -> Result<Bar<PlanarCoulomb>> {
    check(nx)?;
    let mesh = Mesh::rectangle([0.0, 0.0], [10.0, 1.0], [nx, nx / 10])?;
    let (system, load) = press(mesh, [0.57, 0.0, 0.0])?;
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    let body = semismooth::contact_body(&system, &rows, LoadPath::constant(load))?;
    let law = PlanarCoulomb::new(FrictionCoefficient::scaled(weakening()));
    Ok(Bar {
        problem: CondensedContact::new(body, law)?,
        system,
        rows,
    })
}

/// (0, 10) × (0, 1)² m, n × n/10 × n/10 cubes; friction diag(F, F) with 0.56 GPa on the end, or diag(F, 0.6 F) with 0.54 GPa.
pub(crate) fn bar3d(nx: usize, orthotropic: bool) -> Result<Bar<OrthotropicCoulomb>> {
    check(nx)?;
    let mesh = Mesh::block([0.0; 3], [10.0, 1.0, 1.0], [nx, nx / 10, nx / 10])?;
    let pull = if orthotropic { 0.54 } else { 0.56 };
    let (system, load) = press(mesh, [pull, 0.03, 0.0])?;
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]))?;
    let body = semismooth::contact_body(&system, &rows, LoadPath::constant(load))?;
    let along = FrictionCoefficient::scaled(weakening());
    let across = along.times(if orthotropic { 0.6 } else { 1.0 });
    Ok(Bar {
        problem: CondensedContact::new(body, OrthotropicCoulomb::new(along, across))?,
        system,
        rows,
    })
}

fn check(nx: usize) -> Result<()> {
    if nx < 10 || !nx.is_multiple_of(10) {
        return Err(format!("the number of cells along the bar is {nx}; it must be a multiple of 10").into());
    }
    Ok(())
}

/// The bar clamped at x = 0, pressed from above (0.5 GPa where x > 8 at the middle of the facet, else 0.02), with a traction on its end.
fn press(mut mesh: Mesh, end: [f64; 3]) -> Result<(ElasticSystem, Vec<f64>)> {
    let up = mesh.dim() - 1;
    mesh.mark_boundary("pressed hard", |f| f.normal[up] > 0.5 && f.centre[0] > 8.0);
    mesh.mark_boundary("pressed", |f| f.normal[up] > 0.5 && f.centre[0] <= 8.0);
    let system = Elasticity::new(mesh, Material::isotropic(211.9, 0.277)?)
        .fix("left")
        .assemble()?;
    let down = |pressure: f64| {
        let mut t = [0.0; 3];
        t[up] = -pressure;
        t
    };
    let mut load = system.traction("pressed hard", |_| down(0.5))?;
    for part in [
        system.traction("pressed", |_| down(0.02))?,
        system.traction("right", |_| end)?,
    ] {
        load.iter_mut().zip(&part).for_each(|(l, p)| *l += p);
    }
    Ok((system, load))
}
