//! Bodies that contact alone holds, from bodies on soft springs.

use std::sync::Arc;

use super::reduced::ReducedNewton;
use super::tries::Observer;
use crate::contact::law::NodeLaw;
use crate::contact::{CondensedContact, Contact, ContactBody, ContactError, ContactOptions};
use crate::interface::{LoadPath, View};
use crate::linear::LinearError;
use crate::sparse::Matrix;

/// Stiffness of a spring in units of the diagonal of A: any one will do, a soft one pulls at little.
const SOFT: f64 = 1e-4;

/// A body with a spring at each displacement.
pub(super) struct OnSprings {
    body: ContactBody,
    load: Vec<f64>,
    springs: Vec<f64>,
    /// Where the springs pull at nothing.
    at_rest: Vec<f64>,
}

impl<V: View> Contact<V, &dyn NodeLaw> {
    /// This body on springs, under the load at α.
    pub(super) fn on_springs(&self, alpha: f64) -> Result<OnSprings, ContactError> {
        let (body, n) = (self.body(), self.num_displacements());
        let mut entries: Vec<_> = body.operator.a.triplets().collect();
        let mut springs = vec![0.0; n];
        let diagonal = entries.iter().filter(|e| e.0 == e.1);
        diagonal.for_each(|e| springs[e.0] = SOFT * e.2);
        entries.extend(springs.iter().enumerate().map(|(i, s)| (i, i, *s)));
        let mut operator = (*body.operator).clone();
        operator.a = Arc::new(Matrix::from_triplets(n, n, &entries).map_err(LinearError::from)?);
        Ok(OnSprings {
            body: ContactBody {
                operator: Arc::new(operator),
                ..body.clone()
            },
            load: self.operator.load_at(&[alpha]),
            springs,
            at_rest: vec![0.0; n],
        })
    }

    /// A solution (u, λ, α) on these springs, which then are fixed where it is: so they pull at less the next time, which is left to contact.
    /// Points at which they pull at nothing are solutions without them (R. T. Rockafellar, SIAM J. Control Optim. 14 (1976), where the
    /// problem is monotone).
    pub(super) fn next_on(
        &self,
        on: &mut OnSprings,
        alpha: f64,
        options: &ContactOptions,
        observe: &mut Observer<'_>,
    ) -> Result<Vec<f64>, ContactError> {
        let pulls = on.springs.iter().zip(&on.at_rest).map(|(s, u)| s * u);
        let load: Vec<f64> = on.load.iter().zip(pulls).map(|(f, pull)| f + pull).collect();
        let mut condensed = CondensedContact::new(on.body.under(LoadPath::constant(load))?, self.law.law)?;
        condensed.law.reference.clone_from(&self.law.reference);
        condensed.law.history.clone_from(&self.law.history);
        let quick = &mut ReducedNewton::default();
        let found = condensed.solve_again(alpha, None, options, quick, observe)?;
        let x = condensed.expand(&found.x)?;
        on.at_rest.copy_from_slice(&x[..on.springs.len()]);
        Ok(x)
    }
}
