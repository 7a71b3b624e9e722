//! The doors of contact from a mesh: a system of `fem` and its contact rows in, a problem of `contact` out.

use crate::cause::Cause;
use crate::contact::{
    CondensedContact, ContactBody, ContactError, ContactForm, ContactProblem, FullContact, LoadPath, NodeLaw,
    ReducedBody, ReducedContact, ReducedOptions,
};
use crate::fem::{ContactRows, ElasticSystem};

/// The body of a contact problem from an elastic system, the rows of its contact nodes
/// ([`ElasticSystem::contact`], [`ElasticSystem::contact_between`]) and a load, for the full and the condensed form.
///
/// ```
/// use semismooth::contact::{CondensedContact, FrictionCoefficient, LoadPath, PlanarCoulomb};
/// use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
/// let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [8, 4])?; // or fem::read_gmsh("block.msh")?
/// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).fix("left").assemble()?;
/// let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
/// let load = LoadPath::constant(system.traction("top", |_| [0.0, -0.01, 0.0])?);
/// let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.4)?);
/// let problem = CondensedContact::new(semismooth::contact_body(&system, &rows, load)?, law)?;
/// println!("{}", problem.solution(&problem.solve(0.0, None)?)?); // states of the nodes, residuals
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`ContactBody::new`].
pub fn contact_body(
    system: &ElasticSystem,
    rows: &ContactRows,
    load: LoadPath,
) -> Result<ContactBody, ContactError> {
    let (normal, tangential) = (rows.normal.clone(), rows.tangential.clone());
    // The nodes with free displacements, for messages.
    let (mesh, mut points, mut places) = (system.mesh(), Vec::new(), vec![[0; 2]; system.num_free()]);
    for (node, at) in mesh.points().iter().enumerate() {
        let before = points.len();
        let free = (0..mesh.dim()).filter_map(|d| Some((d, system.dof(node, d)?)));
        free.for_each(|(d, k)| places[k] = [before, d]);
        if (0..mesh.dim()).any(|d| system.dof(node, d).is_some()) {
            points.push(*at);
        }
    }
    ContactBody::new(system.stiffness().clone(), normal, tangential, load)?
        .with_gap(rows.gap.clone())?
        .with_nodes(points, &places)
}

/// The same for contact in the displacements alone ([`ReducedContact`]), where the stiffness matrix is stored in blocks of nodes. Does not
/// assemble [`ElasticSystem::stiffness`].
///
/// # Errors
/// As [`ReducedBody::new`]; [`ContactError::Body`] where the blocks do not fit into memory.
pub fn reduced_body(
    system: &ElasticSystem,
    rows: &ContactRows,
    load: LoadPath,
) -> Result<ReducedBody, ContactError> {
    let stiffness = system.nodal_stiffness().map_err(|e| ContactError::Body {
        source: Cause::new(e),
    })?;
    ReducedBody::new(stiffness, &rows.normal, &rows.tangential, load)?.with_gap(rows.gap.clone())
}

/// A contact problem from an elastic system, the rows of its contact nodes, a load and a law, in the form that suits its size
/// ([`ContactForm::Auto`]) or a given one.
///
/// ```
/// use semismooth::contact::{ContactForm, FrictionCoefficient, LoadPath, PlanarCoulomb};
/// use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
/// let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [8, 4])?; // or fem::read_gmsh("block.msh")?
/// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).fix("left").discretize()?;
/// let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
/// let load = LoadPath::constant(system.traction("top", |_| [0.0, -0.01, 0.0])?);
/// let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.4)?);
/// let mut problem = semismooth::contact_problem(&system, &rows, load, law, ContactForm::Auto)?;
/// let found = problem.solve(0.0, None)?;
/// assert!(found.solution.residuals.largest() < 1e-10);
/// println!("{}", found.solution); // states of the nodes, residuals
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`contact_body`] and [`FullContact::new`], [`CondensedContact::new`], or [`reduced_body`] and [`ReducedContact::new`].
pub fn contact_problem<L: NodeLaw>(
    system: &ElasticSystem,
    rows: &ContactRows,
    load: LoadPath,
    law: L,
    form: ContactForm,
) -> Result<ContactProblem<L>, ContactError> {
    let nodal = rows.has_own_nodes(system);
    Ok(match form.suited(system.mesh().dim(), system.num_free(), nodal) {
        ContactForm::Displacements => {
            let body = reduced_body(system, rows, load.clone())?;
            if form == ContactForm::Auto && !body.is_supported() {
                return contact_problem(system, rows, load, law, ContactForm::Condensed);
            }
            ContactProblem::Displacements(Box::new(ReducedContact::new(
                body,
                law,
                ReducedOptions::default(),
            )?))
        }
        ContactForm::Full => ContactProblem::Full(Box::new(FullContact::new(
            contact_body(system, rows, load)?,
            law,
        )?)),
        _ => ContactProblem::Condensed(Box::new(CondensedContact::new(
            contact_body(system, rows, load)?,
            law,
        )?)),
    })
}
