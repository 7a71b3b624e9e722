//! Named groups of nodes, and the nodes of supports.

use super::mesh::{NodeGroups, check_nodes, join, lookup};
use super::{FemError, Mesh};

impl Mesh {
    /// Adds nodes to a group, which is created if it does not exist: for supports and springs at points, and forces there. Nodes keep the
    /// order in which they are given.
    ///
    /// # Errors
    /// Nodes that do not exist, or that are in the group already.
    ///
    /// ```
    /// use semismooth::fem::{Elasticity, Material, Mesh};
    /// // A plate on three points: all of its displacement is determined, and no more.
    /// let mut mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2])?;
    /// mesh.add_node_group("corner", vec![0])?;
    /// mesh.mark_nodes("other corner", |x| x == [2.0, 0.0, 0.0]);
    /// assert_eq!(mesh.node_group("other corner")?, [4]);
    /// let plate = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?);
    /// assert!(plate.clone().fix("corner").assemble().is_err());
    /// assert!(plate.fix("corner").fix_component("other corner", 1).assemble().is_ok());
    /// # Ok::<(), semismooth::fem::FemError>(())
    /// ```
    pub fn add_node_group(&mut self, name: impl Into<String>, nodes: Vec<usize>) -> Result<(), FemError> {
        let name = name.into();
        let count = self.num_nodes();
        let mut seen: std::collections::BTreeSet<usize> = match self.node_groups().get(&name) {
            Some(old) => old.iter().copied().collect(),
            None => Default::default(),
        };
        for (index, &node) in nodes.iter().enumerate() {
            check_nodes("place", index, &[node], count)?;
            if !seen.insert(node) {
                return Err(FemError::NodeTwice { group: name, node });
            }
        }
        self.node_groups_mut().entry(name).or_default().extend(nodes);
        Ok(())
    }

    /// Adds the nodes for which `choose(position)` is true to a group, in the order of their numbers. Returns how many there are.
    pub fn mark_nodes(&mut self, name: impl Into<String>, choose: impl Fn([f64; 3]) -> bool) -> usize {
        let chosen: Vec<usize> = (0..self.num_nodes())
            .filter(|&n| choose(self.points()[n]))
            .collect();
        let count = chosen.len();
        join(
            self.node_groups_mut().entry(name.into()).or_default(),
            chosen,
            |n| *n,
        );
        count
    }

    /// Nodes of a group.
    ///
    /// # Errors
    /// A group that does not exist or, unless the mesh is a [part](Self::into_part), is empty.
    pub fn node_group(&self, name: &str) -> Result<&[usize], FemError> {
        lookup("nodes", name, self.node_groups(), self.is_part())
    }

    /// Names of the groups of nodes.
    pub fn node_group_names(&self) -> impl Iterator<Item = &str> {
        self.node_groups().keys().map(String::as_str)
    }

    /// The nodes of a support: those of the group of facets of that name, and of the group of nodes of that name.
    pub(super) fn supported(&self, name: &str) -> Result<Vec<usize>, FemError> {
        let (facets, nodes) = (self.groups().0, self.node_groups());
        if !nodes.contains_key(name) {
            if nodes.is_empty() || facets.contains_key(name) {
                return Ok(self.facet_group(name)?.iter().flatten().copied().collect());
            }
            // For the names in the message.
            let all: std::collections::BTreeMap<String, Vec<()>> = facets
                .keys()
                .chain(nodes.keys())
                .map(|k| (k.clone(), Vec::new()))
                .collect();
            lookup("facets or nodes", name, &all, self.is_part())?;
        }
        let mut all = self.node_group(name)?.to_vec();
        if let Some(list) = facets.get(name) {
            all.extend(list.iter().flatten());
        }
        Ok(all)
    }

    pub(super) fn with_node_groups(mut self, groups: &NodeGroups) -> Self {
        self.node_groups_mut().clone_from(groups);
        self
    }
}
