//! From a run file to a problem.

use std::error::Error;

use semismooth::contact::{CondensedContact, ContactForm, ReducedContact, ReducedOptions};
use semismooth::fem::{
    ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh, Mortar, PlaneModel, Spring, read_gmsh,
};
use semismooth::interface::{LoadCase, LoadPath};
use toml::Spanned;

use super::input::{BlockInput, Component, Input, MeshInput, Plane, Route, RunInput};
use super::law::Law;
use crate::commands::error::CommandError;
use crate::commands::run_file;

/// The data of a body in contact other than its stiffness and its law.
pub(super) struct Traces {
    rows: ContactRows,
    load: LoadPath,
}

impl Traces {
    /// Areas of the contact nodes.
    pub(super) fn areas(&self) -> &[f64] {
        &self.rows.areas
    }

    /// Number of contact nodes with a tangent that is held.
    pub(super) fn num_held(&self) -> usize {
        self.rows.num_held()
    }
}

pub(super) type RunFile = run_file::RunFile<Input>;

impl RunFile {
    /// The components of a vector; those that are not given are 0.
    fn vector<T>(
        &self,
        place: &Spanned<T>,
        key: &str,
        given: &[f64],
        count: usize,
    ) -> Result<[f64; 3], CommandError> {
        if !given.is_empty() && given.len() != count {
            let what = format!("{} numbers, expected {count}", given.len());
            return Err(self.wrong(place, key, what));
        }
        if let Some(wrong) = given.iter().find(|v| !v.is_finite()) {
            return Err(self.wrong(place, key, format!("{wrong} is not finite")));
        }
        let mut out = [0.0; 3];
        out[..given.len()].copy_from_slice(given);
        Ok(out)
    }

    /// A section that a body with a mesh has.
    fn wanted<'a, T>(
        &self,
        key: &str,
        given: Option<&'a Spanned<T>>,
    ) -> Result<&'a Spanned<T>, CommandError> {
        given.ok_or_else(|| {
            let what = "there is none: a mesh and a material are wanted, or matrices";
            self.wrong(&self.input.contact, key, what)
        })
    }

    /// The mesh with names for points.
    fn mesh(&self) -> Result<Mesh, CommandError> {
        let place = self.wanted("mesh", self.input.mesh.as_ref())?;
        let mut mesh = self.first_mesh(place)?;
        if let Some(order) = &place.get_ref().order {
            mesh = match order.get_ref() {
                1 => mesh,
                2 => mesh
                    .second_order()
                    .map_err(|e| self.wrong(order, "mesh.order", e))?,
                _ => return Err(self.wrong(order, "mesh.order", "the order of cells is 1 or 2")),
            };
        }
        for place in &self.input.point {
            let point = place.get_ref();
            if point.at.len() != mesh.dim() {
                let what = format!("{} numbers, expected {}", point.at.len(), mesh.dim());
                return Err(self.wrong(place, "point.at", what));
            }
            let node = self.node_at(place, &mesh, &point.at)?;
            mesh.add_node_group(point.name.clone(), vec![node])
                .map_err(|e| self.wrong(place, "point", e))?;
        }
        Ok(mesh)
    }

    /// The node at a position, up to rounding of the size of the body.
    fn node_at<T>(&self, place: &Spanned<T>, mesh: &Mesh, at: &[f64]) -> Result<usize, CommandError> {
        let distance = |p: &[f64; 3]| p.iter().zip(at).map(|(p, x)| (p - x).powi(2)).sum::<f64>().sqrt();
        let size = mesh.points().iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        let nodes = mesh.points().iter().map(distance).enumerate();
        match nodes.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((node, d)) if d <= 1e-9 * size => Ok(node),
            nearest => {
                let nearest = nearest.map_or_else(String::new, |(node, _)| {
                    format!(
                        "; the nearest one lies at {:?}",
                        &mesh.points()[node][..mesh.dim()]
                    )
                });
                Err(self.wrong(place, "point.at", format!("there is no node{nearest}")))
            }
        }
    }

    fn first_mesh(&self, place: &Spanned<MeshInput>) -> Result<Mesh, CommandError> {
        let MeshInput { file, block, .. } = place.get_ref();
        match (file, block) {
            (Some(file), None) => {
                read_gmsh(self.relative(file.get_ref())).map_err(|e| self.wrong(file, "mesh.file", e))
            }
            (None, Some(block)) => {
                let BlockInput { lower, upper, cells } = block.get_ref();
                let wrong = |e: Box<dyn Error + Send + Sync>| self.wrong(block, "mesh.block", e);
                match (lower.as_slice(), upper.as_slice(), cells.as_slice()) {
                    (&[a, b], &[c, d], &[m, n]) => {
                        Mesh::rectangle([a, b], [c, d], [m, n]).map_err(|e| wrong(e.into()))
                    }
                    (&[a, b, c], &[d, e, f], &[l, m, n]) => {
                        Mesh::block([a, b, c], [d, e, f], [l, m, n]).map_err(|e| wrong(e.into()))
                    }
                    _ => Err(wrong(
                        "lower, upper and cells have two numbers each, or three".into(),
                    )),
                }
            }
            _ => Err(self.wrong(place, "mesh", "one of file and block is wanted")),
        }
    }

    /// The elastic body on its supports, and the prescribed displacements as functions of α.
    pub(super) fn system(&self) -> Result<(ElasticSystem, Option<LoadCase>), CommandError> {
        let mesh = self.mesh()?;
        let dim = mesh.dim();
        let place = self.wanted("material", self.input.material.as_ref())?;
        let material = place.get_ref();
        let of_body = Material::isotropic(material.young, material.poisson)
            .map_err(|e| self.wrong(place, "material", e))?;
        let plane = match material.plane {
            Plane::Strain => PlaneModel::Strain,
            Plane::Stress => PlaneModel::Stress,
            Plane::Axisymmetric => PlaneModel::Axisymmetric,
        };
        let mut elasticity = Elasticity::new(mesh, of_body).with_plane_model(plane);
        for place in &self.input.inclusion {
            let inclusion = place.get_ref();
            elasticity
                .mesh()
                .cell_group(&inclusion.cells)
                .map_err(|e| self.wrong(place, "inclusion", e))?;
            let material = Material::isotropic(inclusion.young, inclusion.poisson)
                .map_err(|e| self.wrong(place, "inclusion", e))?;
            elasticity = elasticity.with_material(inclusion.cells.clone(), material);
        }
        let mut moving = Vec::new();
        for place in &self.input.support {
            let support = place.get_ref();
            let group = match (&support.facets, &support.nodes) {
                (Some(facets), None) => elasticity.mesh().facet_group(facets).map(|_| facets),
                (None, Some(nodes)) => elasticity.mesh().node_group(nodes).map(|_| nodes),
                _ => return Err(self.wrong(place, "support", "one of facets and nodes is wanted")),
            };
            let group = group.map_err(|e| self.wrong(place, "support", e))?;
            let all = [Component::X, Component::Y, Component::Z];
            let components = support.components.as_deref().unwrap_or(&all[..dim]);
            if dim == 2 && components.contains(&Component::Z) {
                return Err(self.wrong(place, "support.components", "the plane has no z"));
            }
            let value = self.vector(place, "support.value", &support.value, components.len())?;
            let grows = self.vector(place, "support.grows", &support.grows, components.len())?;
            for (k, component) in components.iter().enumerate() {
                let (v, at) = (value[k], *component as usize);
                elasticity = elasticity.prescribe(group.clone(), at, move |_| v);
                if grows[k] != 0.0 {
                    moving.push((place, group, at, grows[k]));
                }
            }
        }
        elasticity = self.springs(elasticity)?;
        let system = elasticity
            .discretize()
            .map_err(|e| CommandError::failed("the body on its supports", e))?;
        let mut motion: Option<LoadCase> = None;
        for (place, group, component, rate) in moving {
            let case = system
                .motion(group, component, |_| rate)
                .map_err(|e| self.wrong(place, "support.grows", e))?;
            motion = Some(match motion {
                None => case,
                Some(m) => m.plus(case).map_err(|e| self.wrong(place, "support.grows", e))?,
            });
        }
        Ok((system, motion))
    }

    /// With springs and elastic foundations.
    fn springs(&self, mut body: Elasticity) -> Result<Elasticity, CommandError> {
        let dim = body.mesh().dim();
        for place in &self.input.spring {
            let given = place.get_ref();
            for group in [Some(&given.nodes), given.to.as_ref()].into_iter().flatten() {
                let found = body.mesh().node_group(group);
                found.map_err(|e| self.wrong(place, "spring", e))?;
            }
            let stiffness = self.vector(place, "spring.stiffness", &given.stiffness, dim)?;
            let spring = Spring::axes(stiffness).map_err(|e| self.wrong(place, "spring.stiffness", e))?;
            body = match &given.to {
                Some(other) => body.spring_between(given.nodes.clone(), other.clone(), spring),
                None => body.spring(given.nodes.clone(), spring),
            };
        }
        for place in &self.input.elastic_foundation {
            let given = place.get_ref();
            let found = body.mesh().facet_group(&given.facets);
            found.map_err(|e| self.wrong(place, "elastic_foundation", e))?;
            if let Some(k) = [given.normal, given.tangential]
                .iter()
                .find(|k| !(**k >= 0.0 && k.is_finite()))
            {
                let what = format!("the stiffness is {k}; it must be finite and not negative");
                return Err(self.wrong(place, "elastic_foundation", what));
            }
            body = body.elastic_foundation(given.facets.clone(), given.normal, given.tangential);
        }
        Ok(body)
    }

    /// The loads: f₀ + α f₁.
    fn load(&self, system: &ElasticSystem, motion: Option<LoadCase>) -> Result<LoadPath, CommandError> {
        let dim = system.mesh().dim();
        let mut constant = system.supports().clone();
        let mut slope = motion.unwrap_or_else(|| vec![0.0; system.num_free()].into());
        for place in &self.input.traction {
            let traction = place.get_ref();
            for (key, given, case) in [
                ("traction.value", &traction.value, &mut constant),
                ("traction.grows", &traction.grows, &mut slope),
            ] {
                let t = self.vector(place, key, given, dim)?;
                let forces = system
                    .traction(&traction.facets, |_| t)
                    .map_err(|e| self.wrong(place, key, e))?;
                *case = case.clone().plus(forces).map_err(|e| self.wrong(place, key, e))?;
            }
        }
        for place in &self.input.force {
            let force = place.get_ref();
            for (key, given, case) in [
                ("force.value", &force.value, &mut constant),
                ("force.grows", &force.grows, &mut slope),
            ] {
                let f = self.vector(place, key, given, dim)?;
                let forces = system.nodal_force(&force.nodes, |_| f);
                let forces = forces.map_err(|e| self.wrong(place, key, e))?;
                *case = case.clone().plus(forces).map_err(|e| self.wrong(place, key, e))?;
            }
        }
        Ok(LoadPath::affine(constant, slope))
    }

    fn foundation(&self, dim: usize) -> Result<Foundation, CommandError> {
        let place = &self.input.contact;
        let contact = place.get_ref();
        match (&contact.point, &contact.normal, contact.gap) {
            (Some(point), Some(normal), None) => {
                let point = self.vector(place, "contact.point", point, dim)?;
                let normal = self.vector(place, "contact.normal", normal, dim)?;
                Ok(Foundation::plane(point, normal))
            }
            (None, None, Some(gap)) => Ok(Foundation::gap(move |_| gap)),
            _ => {
                let what =
                    "a point and a normal are wanted, or a gap, or the facets of another body (against)";
                Err(self.wrong(place, "contact", what))
            }
        }
    }

    /// The contact rows against a foundation or another boundary.
    fn rows(&self, system: &ElasticSystem) -> Result<ContactRows, CommandError> {
        let place = &self.input.contact;
        let contact = place.get_ref();
        let Some(facets) = &contact.facets else {
            return Err(self.wrong(place, "contact.facets", "the facets in contact are wanted"));
        };
        let rows = match &contact.against {
            None => system.contact(facets, &self.foundation(system.mesh().dim())?),
            Some(_) if contact.point.is_some() || contact.normal.is_some() => {
                return Err(self.wrong(
                    place,
                    "contact",
                    "against another body there is no point or normal",
                ));
            }
            Some(other) => {
                let gap = contact.gap.unwrap_or(0.0);
                system.contact_between(facets, other, &Mortar::default().with_gap(move |_| gap))
            }
        };
        rows.map_err(|e| self.wrong(place, "contact", e))
    }

    /// The contact nodes, their tangential rows, and the load.
    pub(super) fn contact(
        &self,
        system: &ElasticSystem,
        motion: Option<LoadCase>,
    ) -> Result<Traces, CommandError> {
        let place = &self.input.contact;
        let rows = self.rows(system)?;
        if let Some(motion) = &motion {
            rows.check_supports(system, motion)
                .map_err(|e| self.wrong(place, "contact", e))?;
        }
        Ok(Traces {
            load: self.load(system, motion)?,
            rows,
        })
    }

    /// The problem, condensed onto its contact nodes, and these nodes.
    pub(super) fn condensed(
        &self,
        system: &ElasticSystem,
        traces: Traces,
        law: Law,
    ) -> Result<(CondensedContact<Law>, ContactRows), CommandError> {
        let (place, rows) = (&self.input.contact, traces.rows);
        let body = semismooth::contact_body(system, &rows, traces.load)
            .map_err(|e| self.wrong(place, "contact", e))?;
        let body = self.layered(body, &rows.areas)?;
        let problem =
            CondensedContact::new(body, law).map_err(|e| CommandError::failed("the body in contact", e))?;
        Ok((problem, rows))
    }

    /// The problem in its displacements, and its contact nodes.
    pub(super) fn reduced(
        &self,
        system: &ElasticSystem,
        traces: Traces,
        law: Law,
    ) -> Result<(ReducedContact<Law>, ContactRows), CommandError> {
        let (place, rows) = (&self.input.contact, traces.rows);
        let body = semismooth::reduced_body(system, &rows, traces.load)
            .map_err(|e| self.wrong(place, "contact", e))?;
        let problem = ReducedContact::new(body, law, ReducedOptions::default())
            .map_err(|e| CommandError::failed("the body in contact", e))?;
        Ok((problem, rows))
    }

    /// The plan for the route in the run file.
    pub(super) fn routed(&self, plan: Plan, system: &ElasticSystem) -> Result<Plan, CommandError> {
        let place = &self.input.run;
        let contact = self.input.contact.get_ref();
        let condensed = contact.against.is_some() || contact.stiffness.is_some();
        let suited = ContactForm::Auto.suited(system.mesh().dim(), system.num_free(), !condensed);
        match (place.get_ref().route, plan) {
            (Route::Auto, Plan::History(levels)) if suited == ContactForm::Displacements => {
                Ok(Plan::Levels(levels))
            }
            (Route::Reduced, Plan::History(_)) if contact.stiffness.is_some() => {
                let what = "a layer (contact.stiffness) needs the condensed route";
                Err(self.wrong(place, "run.route", what))
            }
            (Route::Reduced, Plan::History(levels)) => Ok(Plan::Levels(levels)),
            (Route::Reduced, Plan::Follow(_)) => {
                let what = "curves need the condensed route";
                Err(self.wrong(place, "run.route", what))
            }
            (_, plan) => Ok(plan),
        }
    }

    /// The plan in the run file, before a route is chosen.
    pub(super) fn plan(&self) -> Result<Plan, CommandError> {
        let place = &self.input.run;
        let RunInput { levels, follow, .. } = place.get_ref();
        let all = levels.iter().flatten().chain(follow.iter().flatten());
        if let Some(wrong) = all.copied().find(|v| !v.is_finite()) {
            let key = if levels.is_some() {
                "run.levels"
            } else {
                "run.follow"
            };
            return Err(self.wrong(place, key, format!("{wrong} is not finite")));
        }
        match (levels, follow) {
            (Some(levels), None) if !levels.is_empty() => Ok(Plan::History(levels.clone())),
            (None, Some([from, to])) if from != to => Ok(Plan::Follow([*from, *to])),
            (Some(_), None) => Err(self.wrong(place, "run.levels", "at least one level is wanted")),
            (None, Some(_)) => Err(self.wrong(place, "run.follow", "two different values are wanted")),
            _ => Err(self.wrong(place, "run", "one of levels and follow is wanted")),
        }
    }
}

/// What a run computes.
pub(super) enum Plan {
    /// A history of loading, with the solution curve followed from level to level.
    History(Vec<f64>),
    /// A history of loading, with one solve per level.
    Levels(Vec<f64>),
    /// The curve of static solutions.
    Follow([f64; 2]),
}
