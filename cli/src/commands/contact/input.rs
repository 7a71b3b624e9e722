//! The run file of a body in contact.

use serde::Deserialize;
use toml::Spanned;

/// A run file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Input {
    pub mesh: Option<Spanned<MeshInput>>,
    pub material: Option<Spanned<MaterialInput>>,
    /// In place of a mesh, a material, supports and tractions.
    pub matrices: Option<Spanned<MatricesInput>>,
    #[serde(default)]
    pub inclusion: Vec<Spanned<InclusionInput>>,
    #[serde(default)]
    pub point: Vec<Spanned<PointInput>>,
    #[serde(default)]
    pub support: Vec<Spanned<SupportInput>>,
    #[serde(default)]
    pub spring: Vec<Spanned<SpringInput>>,
    #[serde(default)]
    pub elastic_foundation: Vec<Spanned<ElasticFoundationInput>>,
    #[serde(default)]
    pub traction: Vec<Spanned<TractionInput>>,
    #[serde(default)]
    pub force: Vec<Spanned<ForceInput>>,
    pub contact: Spanned<ContactInput>,
    pub run: Spanned<RunInput>,
    #[serde(default)]
    pub output: OutputInput,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshInput {
    pub file: Option<Spanned<String>>,
    pub block: Option<Spanned<BlockInput>>,
    pub order: Option<Spanned<u8>>,
}

/// A name for the node at a position.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PointInput {
    pub name: String,
    pub at: Vec<f64>,
}

/// Springs at the nodes of a group, to the ground or to those of another group.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpringInput {
    pub nodes: String,
    pub to: Option<String>,
    pub stiffness: Vec<f64>,
}

/// A stiffness per area below facets.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ElasticFoundationInput {
    pub facets: String,
    pub normal: f64,
    #[serde(default)]
    pub tangential: f64,
}

/// A force at each node of a group.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ForceInput {
    pub nodes: String,
    #[serde(default)]
    pub value: Vec<f64>,
    #[serde(default)]
    pub grows: Vec<f64>,
}

/// Files with the matrices and vectors of a body.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MatricesInput {
    pub stiffness: Spanned<String>,
    pub normal: Spanned<String>,
    pub tangential: Vec<Spanned<String>>,
    pub load: Option<Spanned<String>>,
    pub grows: Option<Spanned<String>>,
    pub gap: Option<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BlockInput {
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub cells: Vec<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialInput {
    pub young: f64,
    pub poisson: f64,
    #[serde(default)]
    pub plane: Plane,
}

#[derive(Debug, Default, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Plane {
    #[default]
    Strain,
    Stress,
    Axisymmetric,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InclusionInput {
    pub cells: String,
    pub young: f64,
    pub poisson: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Component {
    X,
    Y,
    Z,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SupportInput {
    pub facets: Option<String>,
    pub nodes: Option<String>,
    pub components: Option<Vec<Component>>,
    #[serde(default)]
    pub value: Vec<f64>,
    #[serde(default)]
    pub grows: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TractionInput {
    pub facets: String,
    #[serde(default)]
    pub value: Vec<f64>,
    #[serde(default)]
    pub grows: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ContactInput {
    pub facets: Option<String>,
    pub against: Option<String>,
    pub point: Option<Vec<f64>>,
    pub normal: Option<Vec<f64>>,
    pub gap: Option<f64>,
    pub friction: Option<f64>,
    pub friction_by_slip: Option<Vec<(f64, f64)>>,
    pub friction_across: Option<f64>,
    pub shear_limit: Option<f64>,
    pub tension: Option<f64>,
    /// An area per force: the depth of wear is this times pressure times slip.
    pub wear: Option<f64>,
    #[serde(default)]
    pub bonded: bool,
    /// Of a layer between both sides, per area: normal, tangential.
    pub stiffness: Option<[f64; 2]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunInput {
    pub levels: Option<Vec<f64>>,
    pub follow: Option<[f64; 2]>,
    #[serde(default)]
    pub route: Route,
}

/// The unknowns in which the problem is solved.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Route {
    /// Chosen by the size of the body.
    #[default]
    Auto,
    /// The contact forces, after one factorisation of the stiffness matrix.
    Condensed,
    /// The displacements, with multigrid.
    Reduced,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct OutputInput {
    pub folder: String,
    pub fields: bool,
    pub pictures: bool,
}

impl Default for OutputInput {
    fn default() -> Self {
        Self {
            folder: "out".to_owned(),
            fields: true,
            pictures: true,
        }
    }
}
