//! The law of contact in a run file.

use std::sync::Arc;

use semismooth::contact::{
    Bonded, Cohesive, ContactBody, FrictionCoefficient, FrictionCurve, LimitedShear, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, Worn,
};

use super::input::ContactInput;
use super::model::RunFile;
use crate::commands::error::CommandError;

pub(super) type Law = Arc<dyn NodeLaw + Send + Sync>;

impl RunFile {
    /// The law in a dimension at nodes with these areas (1 where they are not known).
    pub(super) fn law(&self, dim: usize, areas: &[f64]) -> Result<Law, CommandError> {
        let place = &self.input.contact;
        let contact = place.get_ref();
        if contact.bonded {
            return self.bonded(dim);
        }
        let of_friction = match (contact.shear_limit, dim) {
            (Some(limit), _) => self.limited(dim, limit, areas)?,
            (None, 2) => Arc::new(self.planar()?) as Law,
            (None, _) => Arc::new(self.orthotropic()?),
        };
        let law: Law = match contact.tension {
            None => of_friction,
            Some(tension) => {
                let tension = areas.iter().map(|a| tension * a).collect();
                let law = Cohesive::new(of_friction, tension);
                Arc::new(law.map_err(|e| self.wrong(place, "contact.tension", e))?)
            }
        };
        let Some(wear) = contact.wear else {
            return Ok(law);
        };
        if self.input.run.get_ref().follow.is_some() {
            let what = "surfaces wear along histories: write run.levels in place of run.follow";
            return Err(self.wrong(place, "contact.wear", what));
        }
        let rates = areas.iter().map(|a| wear / a).collect();
        let law = Worn::new(law, rates).map_err(|e| self.wrong(place, "contact.wear", e))?;
        Ok(Arc::new(law))
    }

    fn bonded(&self, dim: usize) -> Result<Law, CommandError> {
        let place = &self.input.contact;
        let contact = place.get_ref();
        let others = [
            contact.friction,
            contact.friction_across,
            contact.shear_limit,
            contact.tension,
            contact.wear,
        ];
        if others.iter().any(Option::is_some) || contact.friction_by_slip.is_some() {
            let what = "bonded nodes have no friction, limit of shear, tension or wear";
            return Err(self.wrong(place, "contact.bonded", what));
        }
        Ok(match dim {
            2 => Arc::new(Bonded::plane()),
            _ => Arc::new(Bonded::space()),
        })
    }

    fn limited(&self, dim: usize, limit: f64, areas: &[f64]) -> Result<Law, CommandError> {
        let place = &self.input.contact;
        let contact = place.get_ref();
        let (Some(friction), None, None) = (
            contact.friction,
            &contact.friction_by_slip,
            contact.friction_across,
        ) else {
            let what = "with a limit of shear, friction is one number";
            return Err(self.wrong(place, "contact.shear_limit", what));
        };
        let limits = areas.iter().map(|a| limit * a).collect();
        let law = LimitedShear::new(dim - 1, vec![friction; areas.len()], limits)
            .map_err(|e| self.wrong(place, "contact.shear_limit", e))?;
        Ok(Arc::new(law))
    }

    /// The body with the layer between both sides.
    pub(super) fn layered(&self, body: ContactBody, areas: &[f64]) -> Result<ContactBody, CommandError> {
        let place = &self.input.contact;
        let Some(stiffness) = place.get_ref().stiffness else {
            return Ok(body);
        };
        if let Some(wrong) = stiffness.iter().find(|k| !(**k > 0.0 && k.is_finite())) {
            let what = format!("{wrong} must be positive and finite");
            return Err(self.wrong(place, "contact.stiffness", what));
        }
        let [normal, tangential] = stiffness.map(|k| areas.iter().map(|a| 1.0 / (k * a)).collect::<Vec<_>>());
        body.with_compliance(&normal, &tangential)
            .map_err(|e| self.wrong(place, "contact.stiffness", e))
    }

    fn friction(&self) -> Result<FrictionCoefficient, CommandError> {
        let place = &self.input.contact;
        let ContactInput {
            friction,
            friction_by_slip,
            ..
        } = place.get_ref();
        let coefficient = match (friction, friction_by_slip) {
            (Some(friction), None) => FrictionCoefficient::constant(*friction),
            (None, Some(table)) => FrictionCurve::table(table).map(FrictionCoefficient::uniform),
            _ => {
                let what = "one of friction and friction_by_slip is wanted";
                return Err(self.wrong(place, "contact", what));
            }
        };
        coefficient.map_err(|e| self.wrong(place, "contact.friction", e))
    }

    fn planar(&self) -> Result<PlanarCoulomb, CommandError> {
        let place = &self.input.contact;
        if place.get_ref().friction_across.is_some() {
            return Err(self.wrong(
                place,
                "contact.friction_across",
                "there is one tangent in the plane",
            ));
        }
        Ok(PlanarCoulomb::new(self.friction()?))
    }

    fn orthotropic(&self) -> Result<OrthotropicCoulomb, CommandError> {
        let (place, first) = (&self.input.contact, self.friction()?);
        Ok(match place.get_ref().friction_across {
            None => OrthotropicCoulomb::isotropic(first),
            Some(across) => {
                let second = FrictionCoefficient::constant(across)
                    .map_err(|e| self.wrong(place, "contact.friction_across", e))?;
                OrthotropicCoulomb::new(first, second)
            }
        })
    }
}
