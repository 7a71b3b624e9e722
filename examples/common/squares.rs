//! Bodies clamped at x = 0 on the ground, E = 1, ν = 0.277: (0, 2) × (0, 1) in plane strain and the unit cube.
#![allow(dead_code)]

use std::error::Error;

use semismooth::contact::{
    CondensedContact, ContactBody, FrictionCoefficient, LoadPath, NodeLaw, PlanarCoulomb,
};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh, TraceSpace};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The plane body of n cells a unit length, pressed down by 1 and pulled by 0.4 on its right side.
pub(crate) fn plane<L: NodeLaw>(n: usize, law: L) -> Result<(CondensedContact<L>, ContactRows)> {
    condense(plane_mesh(n)?, law)
}

/// The unit cube of n³ cells.
pub(crate) fn cube<L: NodeLaw>(n: usize, law: L) -> Result<(CondensedContact<L>, ContactRows)> {
    condense(Mesh::block([0.0; 3], [1.0; 3], [n; 3])?, law)
}

fn condense<L: NodeLaw>(mesh: Mesh, law: L) -> Result<(CondensedContact<L>, ContactRows)> {
    let up = mesh.dim() - 1;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.277)?)
        .fix("left")
        .assemble()?;
    let mut normal = [0.0; 3];
    normal[up] = 1.0;
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], normal))?;
    let mut load = system.traction("top", |_| normal.map(|n| -n))?;
    let pull = system.traction("right", |_| [0.4, 0.0, 0.0])?;
    load.iter_mut().zip(&pull).for_each(|(l, p)| *l += p);
    let tangential = rows.tangential.clone();
    let body = ContactBody::new(
        system.stiffness().clone(),
        rows.normal.clone(),
        tangential,
        LoadPath::constant(load),
    )?;
    Ok((CondensedContact::new(body, law)?, rows))
}

/// Multipliers on the ground of the plane body.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Multipliers {
    /// One a free node, continuous and piecewise linear.
    Nodal,
    /// Piecewise constant on k merged faces, H = k h.
    Constant(usize),
}

/// The plane body's mesh of n cells a unit length.
pub(crate) fn plane_mesh(n: usize) -> Result<Mesh> {
    Ok(Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n])?)
}

/// Its functions that vanish at x = 0, with traces on the ground.
pub(crate) fn traces(mesh: &Mesh) -> Result<TraceSpace<'_>> {
    Ok(TraceSpace::new(mesh, "bottom", Some("left"))?)
}

/// β on n cells a unit length against the traces of a fine mesh.
pub(crate) fn inf_sup(n: usize, multipliers: Multipliers, reference: &TraceSpace) -> Result<f64> {
    let h = 1.0 / n as f64;
    let count = match multipliers {
        Multipliers::Nodal => 2 * n,
        Multipliers::Constant(k) => 2 * n / k,
    };
    let evaluate = move |x: [f64; 3], out: &mut Vec<(usize, f64)>| match multipliers {
        Multipliers::Nodal => {
            let s = x[0] / h;
            let left = (s.floor() as usize).min(2 * n - 1);
            let t = s - left as f64;
            // Node 0 is clamped.
            if left > 0 {
                out.push((left - 1, 1.0 - t));
            }
            out.push((left, t));
        }
        Multipliers::Constant(k) => {
            out.push((((x[0] / (k as f64 * h)).floor() as usize).min(count - 1), 1.0))
        }
    };
    let coarse = plane_mesh(n)?;
    let own = traces(&coarse)?;
    let q = own.pairing(count, evaluate)?;
    let q_ref = reference.pairing(count, evaluate)?;
    Ok(semismooth::contact::inf_sup_constant(
        (own.gram(), &q),
        (reference.gram(), &q_ref),
    )?)
}

/// A block (0, 2) × (0, 1) held at its top, pressed down by moving it 0.02 into the ground, with the horizontal traction 0.03 α on its
/// right side; E = 1, ν = 0.277, plane strain.
pub(crate) fn pushed_block(n: usize, friction: f64) -> Result<CondensedContact<PlanarCoulomb>> {
    let system = pressed(n)?;
    let push = system.traction("right", |_| [0.03, 0.0, 0.0])?;
    on_the_ground(&system, LoadPath::affine(system.supports(), push), friction)
}

/// The same block without the traction, its top moved to the right by 0.02 α.
pub(crate) fn moved_block(n: usize, friction: f64) -> Result<CondensedContact<PlanarCoulomb>> {
    let system = pressed(n)?;
    let shear = system.motion("top", 0, |_| 0.02)?;
    on_the_ground(&system, LoadPath::affine(system.supports(), shear), friction)
}

fn pressed(n: usize) -> Result<ElasticSystem> {
    Ok(Elasticity::new(plane_mesh(n)?, Material::isotropic(1.0, 0.277)?)
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()?)
}

fn on_the_ground(
    system: &ElasticSystem,
    load: LoadPath,
    friction: f64,
) -> Result<CondensedContact<PlanarCoulomb>> {
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    let a = system.stiffness().clone();
    let body = ContactBody::new(a, rows.normal, rows.tangential, load)?.with_gap(rows.gap)?;
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(friction)?);
    Ok(CondensedContact::new(body, law)?)
}
