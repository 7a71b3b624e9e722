//! What should be known of a discretisation.

use std::collections::BTreeMap;

use super::{CellKind, ElasticSystem, PlaneModel};

/// Name and plural of cells, for notes.
fn cells_of(kind: CellKind, count: usize) -> String {
    let plural = match kind {
        CellKind::Hexahedron => "hexahedra",
        CellKind::Tetrahedron => "tetrahedra",
        CellKind::Quadrilateral => "quadrilaterals",
        CellKind::Wedge => "wedges",
        CellKind::Pyramid => "pyramids",
        _ => "triangles",
    };
    match count {
        1 => format!("1 {}", kind.name()),
        _ => format!("{count} {plural}"),
    }
}

impl ElasticSystem {
    /// What should be known of the discretisation, in sentences: where the volumetric strain is a [mean](super::Dilatation), and where
    /// elements lock because the material is nearly incompressible. Empty where there is nothing to say.
    ///
    /// ```
    /// use semismooth::fem::{Elasticity, Material, Mesh};
    /// let rubber = Material::isotropic(1.0, 0.499)?;
    /// let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 2])?;
    /// let notes = |mesh: Mesh| Ok::<_, semismooth::fem::FemError>(Elasticity::new(mesh, rubber.clone()).fix("left").discretize()?.notes());
    /// assert!(notes(mesh.clone())?[0].starts_with("4 quadrilaterals have the mean of their volumetric strain"));
    /// assert!(notes(mesh.simplices()?)?[0].contains("lock"));
    /// # Ok::<(), semismooth::fem::FemError>(())
    /// ```
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let mut counts: BTreeMap<(bool, &'static str), (CellKind, usize)> = BTreeMap::new();
        for cell in 0..self.mesh.num_cells() {
            let (kind, material) = (self.mesh.kind(cell), self.material_of[cell]);
            let mean = self.mean_dilatation[material] && kind.is_box();
            if mean || self.locks(cell) {
                counts.entry((mean, kind.name())).or_insert((kind, 0)).1 += 1;
            }
        }
        let note = |((mean, _), (kind, count)): (&(bool, &str), &(CellKind, usize))| {
            let cells = cells_of(*kind, *count);
            match mean {
                true => format!("{cells} have the mean of their volumetric strain over the cell (B-bar)"),
                false => {
                    let remedy = match kind {
                        CellKind::Triangle => {
                            "mesh with quadrilaterals, or take triangles of second order (Mesh::second_order)"
                        }
                        CellKind::Tetrahedron => {
                            "mesh with hexahedra, or take tetrahedra of second order (Mesh::second_order)"
                        }
                        CellKind::Wedge | CellKind::Pyramid => {
                            "mesh with hexahedra, or raise the order (Mesh::serendipity)"
                        }
                        _ => "take the mean of the volumetric strain (Dilatation::Automatic)",
                    };
                    format!(
                        "{cells} of first order lock, as their Poisson's ratio is above 0.45: displacements are too small and forces too \
                         large, by factors where it is close to 0.5; {remedy}"
                    )
                }
            }
        };
        counts.iter().map(note).collect()
    }

    /// Number of cells that lock; see [`notes`](Self::notes).
    #[must_use]
    pub fn num_locking(&self) -> usize {
        (0..self.mesh.num_cells())
            .filter(|&cell| self.locks(cell))
            .count()
    }

    fn locks(&self, cell: usize) -> bool {
        let (kind, material) = (self.mesh.kind(cell), self.material_of[cell]);
        let compressed = self.mesh.dim() == 3 || self.plane != PlaneModel::Stress;
        let stiff = kind.order() == 1 && !(kind.is_box() && self.mean_dilatation[material]);
        compressed && stiff && self.materials[material].locks()
    }
}
