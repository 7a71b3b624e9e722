//! Solutions as fields on the mesh, and as pictures of the body.

use std::path::Path;

use semismooth::contact::ContactSolution;
use semismooth::fem::von_mises_stress;
use semismooth::output::{BodyPicture, Field, write_vtu};

use super::Case;
use super::matrices::write_nodes;
use crate::commands::error::CommandError;

impl<P> Case<'_, P> {
    /// Displacements, stresses, and at contact nodes states, pressures, tractions (force per area) and slips; elsewhere the state is −1 and
    /// the others are 0. Without a mesh, a table of the contact nodes.
    fn write_fields(
        &self,
        path: &Path,
        solution: &ContactSolution,
        [free, supports]: [&[f64]; 2],
    ) -> Result<(), CommandError> {
        let Some((system, rows)) = &self.mesh else {
            return write_nodes(&path.with_extension("csv"), solution);
        };
        let mesh = system.mesh();
        let n = mesh.num_nodes();
        let (mut state, mut pressure) = (vec![-1.0; n], vec![0.0; n]);
        let (mut traction, mut slip) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
        for (i, &node) in rows.nodes.iter().enumerate() {
            let (v, area) = (&solution.nodes[i], rows.areas[i]);
            state[node] = f64::from(solution.states[i].piece() as u32);
            pressure[node] = v.pressure / area;
            for d in 0..3 {
                for (t, axis) in rows.tangents[i].iter().enumerate() {
                    traction[3 * node + d] -= v.traction[t] / area * axis[d];
                    slip[3 * node + d] += v.slip[t] * axis[d];
                }
                traction[3 * node + d] -= pressure[node] * rows.normals[i][d];
            }
        }
        let failed = |e| CommandError::failed("the fields", e);
        let stress = system.stresses(free, supports).map_err(failed)?;
        let at_nodes = [
            Field::new(
                "displacement",
                mesh.dim(),
                system.displacements(free, supports).map_err(failed)?,
            ),
            Field::new("contact state", 1, state),
            Field::new("pressure", 1, pressure),
            Field::new("traction", 3, traction),
            Field::new("slip", 3, slip),
        ];
        let von_mises = stress.iter().map(von_mises_stress).collect();
        let in_cells = [
            Field::new("stress", 6, stress.iter().flatten().copied().collect()),
            Field::new("von Mises stress", 1, von_mises),
        ];
        write_vtu(path, mesh, &at_nodes, &in_cells).map_err(|e| CommandError::failed("the fields", e))
    }

    /// The fields, and a picture of the deformed body with the states of its contact nodes.
    pub(super) fn write_body(
        &self,
        name: &str,
        solution: &ContactSolution,
        displacements: [&[f64]; 2],
        alpha: f64,
    ) -> Result<(), CommandError> {
        if self.fields {
            self.write_fields(&self.file(&format!("{name}.vtu")), solution, displacements)?;
        }
        let Some((system, rows)) = self.mesh.as_ref().filter(|_| self.pictures) else {
            return Ok(());
        };
        let picture = BodyPicture::of_contact(system, &rows.nodes, &solution.states, displacements, None)
            .map_err(|e| CommandError::failed("the picture", e))?;
        let title = format!("α = {alpha}, displacements × {}", picture.magnification());
        let picture = picture.with_title(title);
        self.arguments
            .draw(&self.folder, name, |path| picture.write(path))
    }
}
