use std::fmt;
use std::sync::Arc;

use super::springs::Given;
use super::{Material, Mesh, PlaneModel};
use crate::words::named;

type Field = Arc<dyn Fn([f64; 3]) -> f64 + Send + Sync>;

/// Prescribed displacements on a group of facets or nodes.
#[derive(Clone)]
pub(super) struct Support {
    pub(super) group: String,
    /// All components if none.
    pub(super) component: Option<usize>,
    /// Zero if none.
    pub(super) value: Option<Field>,
}

impl fmt::Debug for Support {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Support")
            .field("group", &self.group)
            .field("component", &self.component)
            .finish_non_exhaustive()
    }
}

/// How quadrilaterals and hexahedra integrate the volumetric strain.
///
/// Materials that are nearly incompressible lock at full integration: a bonded block with ν = 0.4999 on a mesh of 8 cells is four times
/// too stiff. The mean over the cell (B-bar: T. J. R. Hughes, Int. J. Numer. Methods Eng. 15 (1980)) asks for one constraint a cell. It
/// changes nothing in triangles and tetrahedra, whose strains are constant: these lock, as [`ElasticSystem::notes`](super::ElasticSystem::notes)
/// says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Dilatation {
    /// The mean where Poisson's ratio is above 0.45 (of anisotropic materials that of their isotropic mean), pointwise elsewhere and in
    /// plane stress.
    #[default]
    Automatic,
    /// At each point of integration.
    Pointwise,
    /// The mean over each cell; pointwise in plane stress.
    Mean,
}

named!(
    Dilatation,
    "dilatation",
    [Self::Automatic, Self::Pointwise, Self::Mean]
);

impl Dilatation {
    /// "automatic", "pointwise" or "mean".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Automatic => "automatic",
            Self::Pointwise => "pointwise",
            Self::Mean => "mean",
        }
    }
}

/// A linearly elastic body: mesh, materials, supports.
///
/// ```
/// use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
/// let mesh = Mesh::rectangle([0.0, 0.0], [4.0, 1.0], [8, 2])?;
/// let body = Elasticity::new(mesh, Material::isotropic(211.9, 0.277)?).fix("left");
/// let system = body.assemble()?; // plane strain
/// let load = system.traction("top", |_| [0.0, -0.02, 0.0])?;
/// let contact = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
/// assert_eq!((system.stiffness().nrows(), load.len()), (48, 48));
/// assert_eq!(contact.nodes.len(), 8); // the clamped corner is left out
/// # Ok::<(), semismooth::fem::FemError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Elasticity {
    pub(super) mesh: Arc<Mesh>,
    pub(super) material: Material,
    pub(super) by_group: Vec<(String, Material)>,
    pub(super) plane: PlaneModel,
    pub(super) dilatation: Dilatation,
    pub(super) supports: Vec<Support>,
    pub(super) attached: Vec<Given>,
    pub(super) floats: bool,
}

impl Elasticity {
    /// A body of one material; plane strain if the mesh is plane.
    #[must_use]
    pub fn new(mesh: Mesh, material: Material) -> Self {
        Self {
            mesh: Arc::new(mesh),
            material,
            by_group: Vec::new(),
            plane: PlaneModel::default(),
            dilatation: Dilatation::default(),
            supports: Vec::new(),
            attached: Vec::new(),
            floats: false,
        }
    }

    /// Accepts supports that leave rigid motions, of bodies that contact and friction alone hold. Their stiffness matrix is singular: the
    /// full and the condensed form ([`FullContact`](crate::contact::FullContact), [`CondensedContact`](crate::contact::CondensedContact))
    /// solve them, and say with a certificate where nothing balances the load
    /// ([`ContactError::Unbalanced`](crate::contact::ContactError::Unbalanced)).
    ///
    /// ```
    /// use semismooth::contact::{ContactBody, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
    /// use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
    /// // A block on a table, pulled by α times its weight.
    /// let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2])?;
    /// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?).floating().assemble()?;
    /// let rows = system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    /// let load = LoadPath::affine(system.body_force(|_| [0.0, -0.01, 0.0])?, system.body_force(|_| [0.01, 0.0, 0.0])?);
    /// let body = ContactBody::new(system.stiffness().clone(), rows.normal, rows.tangential, load)?;
    /// let problem = FullContact::new(body, PlanarCoulomb::new(FrictionCoefficient::constant(0.5)?))?;
    /// let x = problem.solve(0.4, None)?;
    /// let [normal, tangential, _] = problem.solution(&x)?.resultant();
    /// assert!((normal - 0.02).abs() < 1e-10 && (tangential - 0.008).abs() < 1e-10);
    /// assert!(problem.solve(0.6, None).unwrap_err().to_string().contains("nothing balances the load"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn floating(mut self) -> Self {
        self.floats = true;
        self
    }

    /// Sets plane strain, plane stress or a body of revolution; without effect in space.
    #[must_use]
    pub fn with_plane_model(mut self, plane: PlaneModel) -> Self {
        self.plane = plane;
        self
    }

    /// Sets how quadrilaterals and hexahedra integrate the volumetric strain.
    #[must_use]
    pub fn with_dilatation(mut self, dilatation: Dilatation) -> Self {
        self.dilatation = dilatation;
        self
    }

    /// Another material for a group of cells; later calls override earlier ones.
    #[must_use]
    pub fn with_material(mut self, cells: impl Into<String>, material: Material) -> Self {
        self.by_group.push((cells.into(), material));
        self
    }

    /// u = 0 on a group of facets, or at a group of nodes ([`Mesh::add_node_group`]); if groups of both have the name, on both.
    #[must_use]
    pub fn fix(mut self, facets: impl Into<String>) -> Self {
        self.supports.push(Support {
            group: facets.into(),
            component: None,
            value: None,
        });
        self
    }

    /// u_component = 0 on a group of facets or at a group of nodes (0: x, 1: y, 2: z), as on a plane of symmetry.
    #[must_use]
    pub fn fix_component(mut self, facets: impl Into<String>, component: usize) -> Self {
        self.supports.push(Support {
            group: facets.into(),
            component: Some(component),
            value: None,
        });
        self
    }

    /// u_component = `value(x)` on a group of facets or at a group of nodes; where groups overlap, later calls override earlier ones.
    #[must_use]
    pub fn prescribe(
        mut self,
        facets: impl Into<String>,
        component: usize,
        value: impl Fn([f64; 3]) -> f64 + Send + Sync + 'static,
    ) -> Self {
        self.supports.push(Support {
            group: facets.into(),
            component: Some(component),
            value: Some(Arc::new(value)),
        });
        self
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }
}
