//! What the crate says of a map, in the words of the catalogue. This file alone knows the types of its answers.

use semismooth::continuation::{
    self, Arm, Branch, ContinuationError, ContinuationOptions, Diagram, DiagramCompleteness, DiagramOptions,
    Direction, Termination, VertexKind, arms_at,
};
use semismooth::piecewise::{PiecewiseSmooth, Selection};

use crate::forms::Kind;

/// How sure the crate is that no arm, or no curve, is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Certainty {
    /// It claims so, within a radius about the point in typical sizes.
    Complete {
        radius: f64,
    },
    /// It found no other and claims nothing.
    Estimated,
    Undecided,
}

#[derive(Clone, Debug)]
pub struct FoundArm {
    pub tangent: Vec<f64>,
    pub selection: Selection,
    /// The sign of α − α* on it, where the crate says it.
    pub side: Option<i8>,
}

/// What the crate says of a point.
#[derive(Clone, Debug)]
pub struct Local {
    pub kind: Option<Kind>,
    pub arms: Vec<FoundArm>,
    pub certainty: Certainty,
    /// The same in its own words.
    pub words: String,
}

/// Why there is no answer.
#[derive(Clone, Debug)]
pub enum Refusal {
    Undecided,
    Error(String),
}

impl From<ContinuationError> for Refusal {
    fn from(error: ContinuationError) -> Self {
        match error {
            ContinuationError::UndecidedArms { .. } => Self::Undecided,
            other => Self::Error(other.to_string()),
        }
    }
}

/// Options in the unit of α, with steps `share` of the default ones.
pub fn options(alpha_unit: f64, range: (f64, f64), share: f64) -> ContinuationOptions {
    let default = ContinuationOptions::default();
    let unit = share * alpha_unit;
    ContinuationOptions::default()
        .with_step(default.step * unit)
        .with_max_step(default.max_step * unit)
        .with_min_step((default.min_step * unit).min(default.min_step))
        .with_max_points(3000)
        .with_parameter_range(range)
}

fn found(arm: &Arm) -> FoundArm {
    FoundArm {
        tangent: arm.tangent.clone(),
        selection: arm.selection.clone(),
        side: Some(arm.direction),
    }
}

fn certainty(said: &continuation::Certainty) -> Certainty {
    match said {
        continuation::Certainty::Proven => Certainty::Complete {
            radius: f64::INFINITY,
        },
        continuation::Certainty::Within { radius } => Certainty::Complete { radius: *radius },
        continuation::Certainty::Estimated => Certainty::Estimated,
        _ => Certainty::Undecided,
    }
}

fn kind_of(kind: VertexKind) -> Option<Kind> {
    match kind {
        VertexKind::PassThrough => Some(Kind::PassThrough),
        VertexKind::Fold => Some(Kind::Fold),
        VertexKind::Vertical => Some(Kind::Vertical),
        VertexKind::Branching | VertexKind::BranchPoint => Some(Kind::Branching),
        VertexKind::End => Some(Kind::End),
        VertexKind::Isolated => Some(Kind::Isolated),
        VertexKind::Continuum => Some(Kind::Continuum),
        _ => None,
    }
}

/// The analysis of a point.
pub fn local(map: &dyn PiecewiseSmooth, x: &[f64], options: &ContinuationOptions) -> Result<Local, Refusal> {
    let found = arms_at(map, x, options)?;
    Ok(Local {
        kind: kind_of(found.kind),
        arms: found.arms.iter().map(self::found).collect(),
        certainty: certainty(&found.certainty),
        words: found.certainty.to_string(),
    })
}

/// A diagram with its vertices and folds.
pub struct Explored {
    pub diagram: Diagram,
    pub vertices: Vec<(Vec<f64>, Local)>,
    pub folds: Vec<Vec<f64>>,
    pub certainty: Certainty,
}

pub fn explore(
    map: &dyn PiecewiseSmooth,
    start: &[f64],
    options: ContinuationOptions,
) -> Result<Explored, Refusal> {
    let options = DiagramOptions::default()
        .with_continuation(options)
        .with_max_points(6000)
        .with_max_edges(200);
    let diagram = Diagram::explore(map, &[start], &options)?;
    let vertices = diagram.vertices().iter().map(|v| {
        let kind = kind_of(v.kind);
        let local = Local {
            kind,
            arms: v.arms.iter().map(|a| found(&a.arm)).collect(),
            certainty: certainty(&v.certainty),
            words: v.certainty.to_string(),
        };
        (v.x.clone(), local)
    });
    Ok(Explored {
        vertices: vertices.collect(),
        folds: diagram.folds().into_iter().map(|f| f.x).collect(),
        certainty: match diagram.completeness() {
            DiagramCompleteness::WithinBounds => Certainty::Complete {
                radius: f64::INFINITY,
            },
            DiagramCompleteness::Limited(_) => Certainty::Undecided,
            _ => Certainty::Estimated,
        },
        diagram,
    })
}

impl Explored {
    /// The solutions at a value of the parameter, and the number of continua.
    pub fn solutions(
        &self,
        map: &dyn PiecewiseSmooth,
        alpha: f64,
    ) -> Result<(Vec<Vec<f64>>, usize), Refusal> {
        let found = self.diagram.solutions_at(map, alpha)?;
        let points = found.points.into_iter().map(|p| p.x);
        Ok((points.chain(found.isolated).collect(), found.continua.len()))
    }
}

/// What a run along a curve says.
pub struct Run {
    pub folds: Vec<Vec<f64>>,
    /// The last point if it ended on a bound of the parameter.
    pub end: Option<Vec<f64>>,
    /// Whether it says that it stopped before the curve ended.
    pub stopped: bool,
}

/// Follows a curve.
pub fn run(
    map: &dyn PiecewiseSmooth,
    start: &[f64],
    increasing: bool,
    options: ContinuationOptions,
) -> Result<Run, Refusal> {
    let direction = if increasing {
        Direction::Increasing
    } else {
        Direction::Decreasing
    };
    let branch = Branch::follow(map, start, direction, options)?;
    let kinks = branch
        .transitions
        .iter()
        .filter(|t| t.is_fold())
        .map(|t| t.x.clone());
    let smooth = branch.smooth_folds.iter().map(|f| f.x.clone());
    let bound = branch.termination == Termination::ParameterRange;
    let end = branch.points.last().filter(|_| bound).map(|p| p.x.clone());
    Ok(Run {
        folds: kinks.chain(smooth).collect(),
        end,
        stopped: matches!(
            branch.termination,
            Termination::UnresolvedCrossing | Termination::StepTooSmall | Termination::Undecided
        ),
    })
}
