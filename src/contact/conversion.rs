//! Contact problems in Delassus form.

use super::law::{LocalValues, NodeLaw};
use super::{CondensedContact, ContactError, DelassusProblem};
use crate::input::{check_finite, check_vector};
use crate::sparse::{Matrix, Pattern};

impl<L: NodeLaw> CondensedContact<L> {
    /// The problem at α in Delassus form: r = (λν, −λt) and u = (gap − u_ν, u_t less its reference) node by node. Where F differs along t₁
    /// and t₂, the components of r are divided by F, those of u multiplied by it, and the coefficient is 1.
    /// [`point_of_reactions`](Self::point_of_reactions) maps solutions back.
    ///
    /// # Complexity
    /// O(q²) operations; the matrix is dense and takes 16 q² bytes.
    ///
    /// # Errors
    /// [`ContactError::NotCoulomb`] unless the law is Coulomb's with coefficients that do not depend on the slip.
    pub fn delassus(&self, alpha: f64) -> Result<DelassusProblem, ContactError> {
        check_finite("the parameter", &[alpha])?;
        self.check_supported()?;
        let (p, q, blocks) = (self.num_contacts(), self.num_traces(), self.law().directions());
        let (friction, scale) = self.delassus_scale(alpha)?;
        let free = self.free_motion(alpha)?;
        let values = self.compliance().values();
        let row = |k: usize| &values[k * q..(k + 1) * q];
        let place = |k: usize| (k % p) * blocks + k / p;
        let sign = |k: usize| if k < p { -scale[k] } else { scale[k] };
        let mut matrix = Matrix::zeros(Pattern::full(q, q));
        let mut load = vec![0.0; q];
        for k in 0..q {
            let column = place(k) * q;
            for (j, c) in row(k).iter().enumerate() {
                matrix.values_mut()[column + place(j)] = sign(j) * sign(k) * c;
            }
            let at_rest = if k < p {
                self.body().gap()[k]
            } else {
                self.law().reference[k - p]
            };
            load[place(k)] = sign(k) * (free[k] - at_rest);
        }
        DelassusProblem::new(blocks, matrix, load, friction)
    }

    /// The point x = (λν, λt, α) of reactions r of the Delassus form.
    ///
    /// # Errors
    /// As [`delassus`](Self::delassus); wrong length, values that are not finite.
    pub fn point_of_reactions(&self, alpha: f64, r: &[f64]) -> Result<Vec<f64>, ContactError> {
        let (p, q, blocks) = (self.num_contacts(), self.num_traces(), self.law().directions());
        self.check_supported()?;
        check_vector("the reactions", r, q)?;
        check_finite("alpha", &[alpha])?;
        let (_, scale) = self.delassus_scale(alpha)?;
        let force = |k: usize| scale[k] * r[(k % p) * blocks + k / p];
        let forces = (0..q).map(|k| if k < p { force(k) } else { -force(k) });
        Ok(forces.chain([alpha]).collect())
    }

    /// Coefficients of the Delassus form, and the factor of each component.
    fn delassus_scale(&self, alpha: f64) -> Result<(Vec<f64>, Vec<f64>), ContactError> {
        if !self.node_law().is_coulomb() {
            return Err(ContactError::NotCoulomb);
        }
        let p = self.num_contacts();
        let (mut friction, mut scale) = (vec![1.0; p], vec![1.0; self.num_traces()]);
        for i in 0..p {
            let v = LocalValues {
                node: i,
                parameter: alpha,
                ..LocalValues::default()
            };
            self.node_law().check(&v)?;
            let f = self.node_law().friction(&v);
            if self.body().num_tangents() == 1 || f[0] == f[1] {
                friction[i] = f[0];
            } else {
                (scale[p + i], scale[2 * p + i]) = (f[0], f[1]);
            }
        }
        Ok((friction, scale))
    }
}
