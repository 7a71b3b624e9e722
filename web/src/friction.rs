//! The models of the talk with one and two contact nodes, with any load, stiffness and friction.

use semismooth::contact::{
    ContactState, FrictionCoefficient, FullContact, HildRenard, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{Diagram, DiagramOptions};
use semismooth::enumeration::{EnumerationError, EnumerationOptions, all_solutions};
use semismooth::piecewise::{PiecewiseSmooth, Selection, select, value};
use semismooth::sparse::Matrix;
use serde::{Deserialize, Serialize};

use crate::drawing::{Drawing, Words};
use crate::error::{Error, interval, within};

pub(crate) type Map = FullContact<PlanarCoulomb>;

/// The augmentation parameter of the talk.
const R: f64 = 1.0;
/// Longest step of a curve, in widths of the range.
const STEP: f64 = 0.02;
/// Sections at which all solutions are listed as starts, in widths of the range from its upper end. The values are not round, to avoid
/// transitions.
const SECTIONS: [f64; 5] = [0.0, 0.237_3, 0.481_9, 0.723_1, 0.941_7];

/// A u + Bνᵀ λν + Btᵀ λt = load + α rate, with the coefficients of friction F = friction + α friction_rate.
///
/// One contact node (Hild and Renard 2005) or two, as many as there are coefficients; x = (u, λν, λt, α) with the displacements
/// (u_ν, u_t) of each node in turn.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Problem {
    pub(crate) lambda: f64,
    pub(crate) mu: f64,
    pub(crate) load: Vec<f64>,
    pub(crate) rate: Vec<f64>,
    pub(crate) friction: Vec<f64>,
    pub(crate) friction_rate: Vec<f64>,
    /// The range of α.
    pub(crate) range: [f64; 2],
}

/// All solutions at one α.
#[derive(Debug, Serialize)]
pub(crate) struct Solutions {
    solutions: Vec<Solution>,
    /// Segments and rays of solutions.
    continua: Vec<Continuum>,
    index_sum: Option<i64>,
    complete: bool,
    /// What is known of the completeness, in the words of the library.
    completeness: String,
}

#[derive(Debug, Serialize)]
struct Solution {
    x: Vec<f64>,
    /// The pieces of a selection that is active there, and the number of active selections.
    pieces: Vec<String>,
    selections: f64,
    /// Signs of the determinants of the active selections that the library lists.
    det: Vec<Option<i8>>,
    index: Option<i8>,
}

#[derive(Debug, Serialize)]
struct Continuum {
    pieces: Vec<Vec<String>>,
    dimension: usize,
    ends: Vec<Vec<f64>>,
}

/// States, test functions and residual at a point.
#[derive(Debug, Serialize)]
pub(crate) struct At {
    pieces: Vec<String>,
    theta: Vec<[f64; 3]>,
    /// ‖H(x)‖₂.
    residual: f64,
}

impl Words for Map {
    fn pieces(&self, selection: &Selection, grazing: &[usize]) -> Vec<String> {
        let word = |(node, state): (usize, ContactState)| match grazing.contains(&node) {
            true => "grazing".to_owned(),
            false => state.name().to_owned(),
        };
        self.states(selection).into_iter().enumerate().map(word).collect()
    }

    fn theta(&self, x: &[f64]) -> Vec<[f64; 3]> {
        Map::theta(self, x)
    }
}

/// All solutions at one α, with the labels of the problem.
pub(crate) fn listed(
    map: &dyn PiecewiseSmooth,
    words: &impl Words,
    alpha: f64,
) -> Result<Solutions, EnumerationError> {
    let set = all_solutions(map, alpha, &EnumerationOptions::default())?;
    let pieces = |s: &Selection| words.pieces(s, &[]);
    Ok(Solutions {
        solutions: (set.solutions.iter())
            .map(|s| Solution {
                x: s.x.clone(),
                pieces: s.selections.first().map_or_else(Vec::new, pieces),
                selections: s.num_selections,
                det: s.det_signs.clone(),
                index: s.index,
            })
            .collect(),
        continua: (set.continua.iter())
            .map(|c| Continuum {
                pieces: c.selections.iter().map(pieces).collect(),
                dimension: c.dimension,
                ends: c.ends.clone(),
            })
            .collect(),
        index_sum: set.index_sum,
        complete: set.completeness.is_complete(),
        completeness: set.completeness.to_string(),
    })
}

/// Options for curves that look smooth over a range, with bounds on their length.
pub(crate) fn options([lower, upper]: [f64; 2]) -> DiagramOptions {
    let mut options = DiagramOptions::default()
        .with_parameter_range((lower, upper))
        .with_max_edges(400)
        .with_max_points(40_000);
    let step = STEP * (upper - lower);
    options.continuation = (options.continuation)
        .with_max_step(step)
        .with_step(0.25 * step)
        .with_min_step((1e-8_f64).min(1e-4 * step))
        .with_max_points(4_000);
    options
}

/// The values of α at which solutions are listed.
pub(crate) fn sections([lower, upper]: [f64; 2]) -> [f64; 5] {
    SECTIONS.map(|s| upper - s * (upper - lower))
}

impl Problem {
    pub(crate) fn map(&self) -> Result<Map, Error> {
        let p = self.friction.len();
        within("the number of contact nodes", p as f64, (1.0, 2.0), "1 or 2")?;
        interval("the range of the parameter", self.range)?;
        for (what, list, expected) in [
            ("the load", &self.load, 2 * p),
            ("the rate of the load", &self.rate, 2 * p),
            ("the friction", &self.friction, p),
            ("the rate of the friction", &self.friction_rate, p),
        ] {
            if list.len() != expected {
                let found = list.len();
                return Err(Error::Length {
                    what,
                    expected,
                    found,
                });
            }
            for value in list {
                within(what, *value, (-1e6, 1e6), "between -1e6 and 1e6")?;
            }
        }
        for (what, value) in [("λ", self.lambda), ("μ", self.mu)] {
            within(what, value, (1e-6, 1e6), "between 1e-6 and 1e6")?;
        }
        let load = LoadPath::affine(self.load.clone(), self.rate.clone());
        let law = FrictionCoefficient::affine(self.friction.clone(), self.friction_rate.clone())?;
        let map = match p {
            1 => HildRenard::new(0.0, 0.0, self.lambda, self.mu)?
                .problem()?
                .with_load(load)?
                .with_law(PlanarCoulomb::new(law))?,
            _ => FullContact::planar(
                two_nodes(self.lambda, self.mu)?,
                Matrix::from_triplets(2, 4, &[(0, 0, 1.0), (1, 2, 1.0)])?,
                Matrix::from_triplets(2, 4, &[(0, 1, 1.0), (1, 3, 1.0)])?,
                load,
                law,
            )?,
        };
        Ok(map.with_r(R)?)
    }

    pub(crate) fn diagram(&self) -> Result<Drawing, Error> {
        let map = self.map()?;
        Ok(Drawing::new(&self.explore(&map)?, &map))
    }

    pub(crate) fn explore(&self, map: &Map) -> Result<Diagram, Error> {
        let (sections, options) = (sections(self.range), options(self.range));
        Ok(Diagram::explore_sections(
            map,
            &sections,
            &options,
            &EnumerationOptions::default(),
        )?)
    }

    pub(crate) fn solutions(&self, alpha: f64) -> Result<Solutions, Error> {
        within("the parameter", alpha, (-1e6, 1e6), "between -1e6 and 1e6")?;
        let map = self.map()?;
        Ok(listed(&map, &map, alpha)?)
    }

    pub(crate) fn point(&self, x: &[f64]) -> Result<At, Error> {
        let map = self.map()?;
        let expected = map.num_vars();
        if x.len() != expected {
            let found = x.len();
            return Err(Error::Length {
                what: "x",
                expected,
                found,
            });
        }
        let mut residual = vec![0.0; map.num_residuals()];
        value(&map, x, &mut residual);
        Ok(At {
            pieces: map.pieces(&select(&map, x), &[]),
            theta: map.theta(x),
            residual: residual.iter().map(|r| r * r).sum::<f64>().sqrt(),
        })
    }
}

/// The stiffness matrix of the model with two contact nodes, as printed in the talk.
fn two_nodes(lambda: f64, mu: f64) -> Result<Matrix, Error> {
    let (shear, half, normal) = (0.5 * mu, 0.5 * lambda, 0.5 * (lambda + 2.0 * mu));
    let both = lambda + 3.0 * mu;
    Ok(Matrix::from_rows(&[
        [shear, 0.0, -shear, -shear],
        [0.0, normal, -half, -normal],
        [-shear, -half, both, 0.0],
        [-shear, -normal, 0.0, both],
    ])?)
}
