//! Springs at nodes and elastic foundations below facets: further elements of a body, beside its cells.

use super::elasticity::Elasticity;
use super::element_matrix::ElementMatrix;
use super::facet::integrate_with_normals;
use super::vectors::norm;
use super::{FemError, Mesh};

/// A linear spring, of a node to the ground or between two nodes: it opposes displacements along fixed directions, in the unit of force per
/// displacement (in a body of revolution of the forces on whole rings).
///
/// ```
/// use semismooth::fem::{Elasticity, Material, Mesh, Spring};
/// // A square of E = 1 and ν = 0 on two springs of stiffness 1: a pull of 0.1 moves it by 0.1/2 and stretches it by 0.1.
/// let mut mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [1, 1])?;
/// mesh.mark_nodes("left ends", |x| x[0] == 0.0);
/// let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.0)?)
///     .fix_component("bottom", 1)
///     .spring("left ends", Spring::along([1.0, 0.0, 0.0], 1.0)?)
///     .assemble()?;
/// let load = system.traction("right", |_| [0.1, 0.0, 0.0])?;
/// let mut u = vec![0.0; system.num_free()];
/// for (node, x) in system.mesh().points().iter().enumerate() {
///     u[system.dof(node, 0).unwrap()] = 0.05 + 0.1 * x[0];
/// }
/// let mut force = vec![0.0; u.len()];
/// system.stiffness().mul_vec(&u, &mut force);
/// assert!(force.iter().zip(&load).all(|(a, b)| (a - b).abs() < 1e-16));
/// # Ok::<(), semismooth::fem::FemError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    /// Unit vectors with the stiffness along each.
    along: [([f64; 3], f64); 3],
}

impl Spring {
    /// A stiffness along each axis, 0 where it does not resist; the third one is ignored in the plane.
    ///
    /// # Errors
    /// Stiffnesses that are negative or not finite.
    pub fn axes(stiffness: [f64; 3]) -> Result<Self, FemError> {
        stiffness.iter().try_for_each(|k| check(*k))?;
        let axis = |d: usize| std::array::from_fn(|e| if d == e { 1.0 } else { 0.0 });
        Ok(Self {
            along: [0, 1, 2].map(|d| (axis(d), stiffness[d])),
        })
    }

    /// A stiffness along one direction, which is normalised.
    ///
    /// # Errors
    /// A stiffness that is negative or not finite, a direction that is zero or not finite.
    pub fn along(direction: [f64; 3], stiffness: f64) -> Result<Self, FemError> {
        check(stiffness)?;
        let length = norm(direction);
        if !(length > 0.0 && length.is_finite()) {
            return Err(FemError::Material {
                what: "the length of the direction of a spring",
                value: length,
                rule: "it must be positive and finite",
            });
        }
        let mut along = [([0.0; 3], 0.0); 3];
        along[0] = (direction.map(|x| x / length), stiffness);
        Ok(Self { along })
    }

    fn tensor(&self) -> [[f64; 3]; 3] {
        let sum = |d: usize, e: usize| self.along.iter().map(|(n, k)| k * n[d] * n[e]).sum();
        std::array::from_fn(|d| std::array::from_fn(|e| sum(d, e)))
    }
}

fn check(stiffness: f64) -> Result<(), FemError> {
    if stiffness >= 0.0 && stiffness.is_finite() {
        return Ok(());
    }
    Err(FemError::Material {
        what: "the stiffness of a spring or an elastic foundation",
        value: stiffness,
        rule: "it must be finite and not negative",
    })
}

/// Springs and foundations as they are given.
#[derive(Debug, Clone)]
pub(super) enum Given {
    Grounded(String, Spring),
    Between([String; 2], Spring),
    /// Stiffness per area, normal and tangential.
    Foundation(String, [f64; 2]),
}

/// The stiffness that springs and foundations add to some nodes.
#[derive(Debug, Clone)]
pub(super) struct Attached {
    pub(super) nodes: Vec<usize>,
    pub(super) matrix: ElementMatrix,
    /// Directions of nodes whose displacement it opposes, taken for itself.
    pub(super) held: Vec<(usize, [f64; 3])>,
    /// Whether it depends on positions of nodes.
    pub(super) is_area: bool,
}

impl Elasticity {
    /// A spring to the ground at each node of a group of nodes.
    #[must_use]
    pub fn spring(mut self, nodes: impl Into<String>, spring: Spring) -> Self {
        self.attached.push(Given::Grounded(nodes.into(), spring));
        self
    }

    /// A spring between the nodes of two groups of nodes, of the first of one to the first of the other and so on; each resists the
    /// difference of their displacements. Bodies that these springs alone hold must be accepted as [`floating`](Self::floating).
    #[must_use]
    pub fn spring_between(
        mut self,
        first: impl Into<String>,
        second: impl Into<String>,
        spring: Spring,
    ) -> Self {
        self.attached
            .push(Given::Between([first.into(), second.into()], spring));
        self
    }

    /// An elastic foundation (of Winkler) below a group of facets, which stays in contact under tension too: at each point it exerts the
    /// traction −k_n u_ν ν − k_t u_t, with stiffnesses per area (per length in the plane).
    #[must_use]
    pub fn elastic_foundation(mut self, facets: impl Into<String>, normal: f64, tangential: f64) -> Self {
        self.attached
            .push(Given::Foundation(facets.into(), [normal, tangential]));
        self
    }

    /// The elements of springs and foundations; `round(x)` is the length of the ring through a point of a body of revolution.
    pub(super) fn attachments(&self, round: impl Fn([f64; 3]) -> f64) -> Result<Vec<Attached>, FemError> {
        let mut all = Vec::new();
        for given in &self.attached {
            match given {
                Given::Grounded(group, spring) => {
                    let nodes = self.mesh.node_group(group)?.iter();
                    all.extend(nodes.map(|&n| of_spring(self.mesh.dim(), vec![n], spring)));
                }
                Given::Between([first, second], spring) => {
                    let (a, b) = (self.mesh.node_group(first)?, self.mesh.node_group(second)?);
                    if a.len() != b.len() {
                        return Err(FemError::Pairs {
                            first: first.clone(),
                            second: second.clone(),
                            nodes: [a.len(), b.len()],
                        });
                    }
                    let pairs = a.iter().zip(b);
                    all.extend(pairs.map(|(&a, &b)| of_spring(self.mesh.dim(), vec![a, b], spring)));
                }
                Given::Foundation(group, stiffness) => {
                    stiffness.iter().try_for_each(|k| check(*k))?;
                    let facets = self.mesh.facet_group(group)?.iter();
                    all.extend(facets.map(|f| of_facet(&self.mesh, f, *stiffness, &round)));
                }
            }
        }
        Ok(all)
    }
}

fn of_spring(dim: usize, nodes: Vec<usize>, spring: &Spring) -> Attached {
    let (tensor, mut matrix) = (spring.tensor(), ElementMatrix::zeros(dim * nodes.len()));
    for (a, b) in (0..nodes.len()).flat_map(|a| (0..nodes.len()).map(move |b| (a, b))) {
        for (d, e) in (0..dim).flat_map(|d| (0..dim).map(move |e| (d, e))) {
            let sign = if a == b { 1.0 } else { -1.0 };
            matrix.add(dim * a + d, dim * b + e, sign * tensor[d][e]);
        }
    }
    // Between two nodes nothing is held in place.
    let held = spring.along.iter().filter(|(_, k)| *k > 0.0 && nodes.len() == 1);
    Attached {
        held: held.map(|(n, _)| (nodes[0], *n)).collect(),
        nodes,
        matrix,
        is_area: false,
    }
}

fn of_facet(
    mesh: &Mesh,
    nodes: &[usize],
    [normal, tangential]: [f64; 2],
    round: &impl Fn([f64; 3]) -> f64,
) -> Attached {
    let dim = mesh.dim();
    let mut matrix = ElementMatrix::zeros(dim * nodes.len());
    let mut held = Vec::new();
    integrate_with_normals(mesh, nodes, |at, shape, measure, nu| {
        let measure = measure * round(at);
        let tensor = |d: usize, e: usize| {
            let across = if d == e { 1.0 } else { 0.0 } - nu[d] * nu[e];
            normal * nu[d] * nu[e] + tangential * across
        };
        for a in 0..nodes.len() {
            for b in 0..nodes.len() {
                let weight = measure * shape[a] * shape[b];
                for (d, e) in (0..dim).flat_map(|d| (0..dim).map(move |e| (d, e))) {
                    matrix.add(dim * a + d, dim * b + e, weight * tensor(d, e));
                }
            }
            for d in (0..dim).filter(|_| tangential > 0.0) {
                let mut way = nu.map(|n| -n * nu[d]);
                way[d] += 1.0;
                held.push((nodes[a], way));
            }
            if normal > 0.0 {
                held.push((nodes[a], nu));
            }
        }
    });
    Attached {
        nodes: nodes.to_vec(),
        matrix,
        held,
        is_area: true,
    }
}

/// What couples nodes: the cells of a mesh, then what is attached to it.
#[derive(Clone, Copy)]
pub(super) struct Coupled<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) attached: &'a [Attached],
}

impl<'a> Coupled<'a> {
    /// The cells alone.
    pub(super) fn cells(mesh: &'a Mesh) -> Self {
        Self { mesh, attached: &[] }
    }

    pub(super) fn len(&self) -> usize {
        self.mesh.num_cells() + self.attached.len()
    }

    pub(super) fn nodes(&self, element: usize) -> &'a [usize] {
        match element.checked_sub(self.mesh.num_cells()) {
            Some(k) => &self.attached[k].nodes,
            None => self.mesh.cell(element),
        }
    }
}
