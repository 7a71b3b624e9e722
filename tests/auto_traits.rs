//! Public types can be sent and shared between threads: all are `Send + Sync` except those listed with a reason. The tables are complete.

use std::collections::BTreeSet;

use semismooth::InputError;
use semismooth::complementarity::{AffineFunction as F, ComplementarityError};
use semismooth::contact::{ContactError, OrthotropicCoulomb, PlanarCoulomb};
use semismooth::continuation::ContinuationError;
use semismooth::linear::AutoSolver;
use semismooth::piecewise::{MinMap, PiecewiseError};
use semismooth::sparse::Matrix;

type Map = MinMap<fn(&[f64], &mut [f64], &mut [f64])>;

#[cfg(feature = "autodiff")]
mod traced {
    use semismooth::complementarity::SmoothFunction;
    use semismooth::piecewise::{Kinks, NonsmoothFunction, Real};

    pub(super) struct Smooth;
    impl SmoothFunction for Smooth {
        fn num_vars(&self) -> usize {
            0
        }
        fn eval<T: Real>(&self, _: &[T], _: &mut [T]) {}
    }

    pub(super) struct Kinked;
    impl NonsmoothFunction for Kinked {
        fn num_vars(&self) -> usize {
            0
        }
        fn num_residuals(&self) -> usize {
            0
        }
        fn eval<T: Real>(&self, _: &[T], _: &mut Kinks<'_, T>, _: &mut [T]) {}
    }
}
#[cfg(feature = "autodiff")]
use traced::{Kinked, Smooth};

fn shared<T: Send + Sync>() {}
fn sent<T: Send>() {}
fn error<T: std::error::Error + Clone + PartialEq + Send + Sync + 'static>() {}

/// Names of the types; compiling the expansion checks each of them.
macro_rules! all_shared {
    ($($name:literal: $type:ty,)*) => {
        vec![$({
            shared::<$type>();
            $name
        }),*]
    };
}

fn of_every_build() -> Vec<&'static str> {
    use semismooth::*;
    all_shared! {
        "complementarity::AffineFunction": complementarity::AffineFunction,
        "Cause": Cause,
        "InputError": InputError,
        "complementarity::Block": complementarity::Block,
        "complementarity::Variables": complementarity::Variables,
        "complementarity::VariablesView": complementarity::VariablesView<'static, f64>,
        "complementarity::BoundState": complementarity::BoundState,
        "complementarity::ComplementarityError": complementarity::ComplementarityError,
        "complementarity::ConstraintKind": complementarity::ConstraintKind,
        "complementarity::Differenced": complementarity::Differenced<fn(&[f64], &mut [f64])>,
        "complementarity::Fallback": complementarity::Fallback,
        "complementarity::FischerBurmeister": complementarity::FischerBurmeister<'static, F>,
        "complementarity::JacobianCheck": complementarity::JacobianCheck,
        "complementarity::Lcp": complementarity::Lcp,
        "complementarity::Mcp": complementarity::Mcp<F>,
        "complementarity::McpIteration": complementarity::McpIteration,
        "complementarity::McpOptions": complementarity::McpOptions,
        "complementarity::McpReport": complementarity::McpReport,
        "complementarity::McpSolver": complementarity::McpSolver,
        "complementarity::McpStep": complementarity::McpStep,
        "complementarity::McpStrategy": complementarity::McpStrategy,
        "complementarity::NormalMap": complementarity::NormalMap<'static, F>,
        "complementarity::WithJacobian": complementarity::WithJacobian<fn(&[f64], &mut [f64]), fn(&[f64], &mut Matrix)>,
        "complementarity::active_set::ActiveSetIteration": complementarity::active_set::ActiveSetIteration,
        "complementarity::active_set::ActiveSetOptions": complementarity::active_set::ActiveSetOptions,
        "complementarity::active_set::ActiveSetReport": complementarity::active_set::ActiveSetReport,
        "complementarity::active_set::ActiveSetSolver": complementarity::active_set::ActiveSetSolver,
        "complementarity::active_set::AutoReduced": complementarity::active_set::AutoReduced,
        "complementarity::active_set::DirectReduced": complementarity::active_set::DirectReduced,
        "complementarity::active_set::Exchange": complementarity::active_set::Exchange,
        "complementarity::active_set::GmresReduced": complementarity::active_set::GmresReduced,
        "complementarity::active_set::LevelReport": complementarity::active_set::LevelReport,
        "complementarity::active_set::MultigridReduced": complementarity::active_set::MultigridReduced,
        "complementarity::active_set::Nested": complementarity::active_set::Nested,
        "complementarity::active_set::Start": complementarity::active_set::Start,
        "complementarity::active_set::NestedReport": complementarity::active_set::NestedReport,
        "complementarity::pivoting::Lemke": complementarity::pivoting::Lemke,
        "complementarity::pivoting::LemkeOptions": complementarity::pivoting::LemkeOptions,
        "complementarity::pivoting::LemkeReport": complementarity::pivoting::LemkeReport,
        "contact::Arrival": contact::Arrival,
        "contact::CondensedContact": contact::CondensedContact<PlanarCoulomb>,
        "contact::ContactAttempt": contact::ContactAttempt,
        "contact::ContactBody": contact::ContactBody,
        "contact::ContactChange": contact::ContactChange,
        "contact::ContactParameters": contact::ContactParameters,
        "contact::ContactSensitivity": contact::ContactSensitivity<interface::CondensedView>,
        "contact::ContactProgress": contact::ContactProgress,
        "contact::ContactReport": contact::ContactReport,
        "contact::ContactStrategy": contact::ContactStrategy,
        "contact::ContactEnergy": contact::ContactEnergy,
        "contact::ContactEquilibrium": contact::ContactEquilibrium,
        "contact::ContactError": contact::ContactError,
        "contact::ContactForm": contact::ContactForm,
        "contact::ContactProblem": contact::ContactProblem<OrthotropicCoulomb>,
        "contact::ContactResiduals": contact::ContactResiduals,
        "contact::ContactSolution": contact::ContactSolution,
        "contact::ContactState": contact::ContactState,
        "ContactError": ContactError,
        "contact::DelassusIteration": contact::DelassusIteration,
        "contact::DelassusOptions": contact::DelassusOptions,
        "contact::DelassusPhase": contact::DelassusPhase,
        "contact::DelassusProblem": contact::DelassusProblem,
        "contact::DelassusReport": contact::DelassusReport,
        "contact::DelassusSolver": contact::DelassusSolver,
        "contact::EvolutionProgress": contact::EvolutionProgress<'static>,
        "contact::EvolutionStep": contact::EvolutionStep,
        "contact::FixedPointOptions": contact::FixedPointOptions,
        "contact::ContactOptions": contact::ContactOptions,
        "contact::EvolutionOptions": contact::EvolutionOptions,
        "complementarity::pivoting::LemkePivot": complementarity::pivoting::LemkePivot,
        "contact::FixedPointReport": contact::FixedPointReport,
        "contact::FrictionCoefficient": contact::FrictionCoefficient,
        "contact::FrictionCurve": contact::FrictionCurve,
        "contact::Frictionless": contact::Frictionless,
        "contact::FullContact": contact::FullContact<OrthotropicCoulomb>,
        "contact::GivenBound": contact::GivenBound,
        "contact::Bonded": contact::Bonded,
        "contact::Cohesive": contact::Cohesive<contact::PlanarCoulomb>,
        "contact::Worn": contact::Worn<contact::PlanarCoulomb>,
        "contact::LimitedShear": contact::LimitedShear,
        "contact::HildRenard": contact::HildRenard,
        "contact::HistorySensitivity": contact::HistorySensitivity<interface::CondensedView, PlanarCoulomb>,
        "contact::HildRenardBranch": contact::HildRenardBranch,
        "contact::HildRenardCase": contact::HildRenardCase,
        "contact::LoadPath": contact::LoadPath,
        "contact::LocalRow": contact::LocalRow,
        "contact::LocalValues": contact::LocalValues,
        "contact::MultiplierCoulomb": contact::MultiplierCoulomb,
        "contact::PerNode": contact::PerNode<PlanarCoulomb>,
        "contact::Contact": contact::Contact<interface::FullView, PlanarCoulomb>,
        "contact::LoadCase": contact::LoadCase,
        "contact::OrthotropicCoulomb": contact::OrthotropicCoulomb,
        "contact::PlanarCoulomb": contact::PlanarCoulomb,
        "contact::FixedPointBound": contact::FixedPointBound,
        "contact::ReducedBody": contact::ReducedBody,
        "contact::ReducedContact": contact::ReducedContact<OrthotropicCoulomb>,
        "contact::ReducedError": contact::ReducedError<ContactError>,
        "contact::ReducedIteration": contact::ReducedIteration,
        "contact::ReducedLevel": contact::ReducedLevel,
        "contact::ReducedNodes": contact::ReducedNodes<'static>,
        "contact::ReducedOptions": contact::ReducedOptions,
        "contact::ReducedProgress": contact::ReducedProgress,
        "contact::ReducedReport": contact::ReducedReport,
        "contact::ReducedSensitivity": contact::ReducedSensitivity<'static>,
        "contact::ReducedStep": contact::ReducedStep<'static>,
        "contact::ReducedTimes": contact::ReducedTimes,
        "contact::UniquenessConstants": contact::UniquenessConstants,
        "continuation::Arm": continuation::Arm,
        "continuation::PointDoubt": continuation::PointDoubt,
        "continuation::PointAnalysis": continuation::PointAnalysis,
        "continuation::Certainty": continuation::Certainty,
        "continuation::Branch": continuation::Branch,
        "continuation::BranchPoint": continuation::BranchPoint,
        "continuation::BranchVertex": continuation::BranchVertex<'static>,
        "continuation::CharacterChange": continuation::CharacterChange,
        "continuation::DiagramCompleteness": continuation::DiagramCompleteness,
        "continuation::ContinuationError": continuation::ContinuationError,
        "continuation::ContinuationOptions": continuation::ContinuationOptions,
        "continuation::Diagram": continuation::Diagram,
        "continuation::DiagramBranch": continuation::DiagramBranch,
        "continuation::DiagramEdge": continuation::DiagramEdge,
        "continuation::DiagramFold": continuation::DiagramFold,
        "continuation::DiagramOptions": continuation::DiagramOptions,
        "continuation::DiagramVertex": continuation::DiagramVertex,
        "continuation::Direction": continuation::Direction,
        "continuation::EdgeEnd": continuation::EdgeEnd,
        "continuation::Event": continuation::Event,
        "continuation::FoldSet": continuation::FoldSet<Map>,
        "continuation::FoundBy": continuation::FoundBy,
        "continuation::FoundSolution": continuation::FoundSolution,
        "continuation::FoundSolutions": continuation::FoundSolutions,
        "continuation::Limit": continuation::Limit,
        "continuation::MonitorCrossing": continuation::MonitorCrossing,
        "continuation::Point": continuation::Point,
        "continuation::PointKind": continuation::PointKind,
        "continuation::Progress": continuation::Progress<'static>,
        "continuation::SavedRun": continuation::SavedRun,
        "continuation::SearchOptions": continuation::SearchOptions,
        "continuation::SolutionList": continuation::SolutionList,
        "continuation::SectionProgress": continuation::SectionProgress<'static>,
        "continuation::SiteChange": continuation::SiteChange,
        "continuation::DiagramSolution": continuation::DiagramSolution,
        "continuation::SolutionsAt": continuation::SolutionsAt,
        "continuation::StepRule": continuation::StepRule,
        "continuation::Strategy": continuation::Strategy,
        "continuation::Termination": continuation::Termination,
        "continuation::Transition": continuation::Transition,
        "continuation::TransitionKind": continuation::TransitionKind,
        "continuation::TransitionSet": continuation::TransitionSet<Map>,
        "continuation::VertexArm": continuation::VertexArm,
        "continuation::VertexKind": continuation::VertexKind,
        "enumeration::Completeness": enumeration::Completeness,
        "enumeration::Continuum": enumeration::Continuum,
        "enumeration::DirectionalArm": enumeration::DirectionalArm,
        "enumeration::DirectionalArms": enumeration::DirectionalArms,
        "enumeration::Doubt": enumeration::Doubt,
        "enumeration::EnumerationError": enumeration::EnumerationError,
        "enumeration::EnumerationOptions": enumeration::EnumerationOptions,
        "enumeration::Solution": enumeration::Solution,
        "enumeration::SolutionSet": enumeration::SolutionSet,
        "fallible::Failed": fallible::Failed<std::io::Error, ()>,
        "fallible::FirstError": fallible::FirstError<std::io::Error>,
        "fem::BoundaryFacet": fem::BoundaryFacet,
        "fem::CellKind": fem::CellKind,
        "fem::ContactRows": fem::ContactRows,
        "fem::Dilatation": fem::Dilatation,
        "fem::ElasticSystem": fem::ElasticSystem,
        "fem::Elasticity": fem::Elasticity,
        "fem::FemError": fem::FemError,
        "fem::Foundation": fem::Foundation,
        "fem::MaterialConstant": fem::MaterialConstant,
        "fem::Material": fem::Material,
        "fem::Mesh": fem::Mesh,
        "fem::Mortar": fem::Mortar,
        "fem::MultiplierSpace": fem::MultiplierSpace,
        "fem::Degree": fem::Degree,
        "fem::Partition": fem::Partition,
        "fem::PlaneModel": fem::PlaneModel,
        "fem::PlasticBody": fem::PlasticBody,
        "fem::PlasticEnergies": fem::PlasticEnergies,
        "fem::PlasticResponse": fem::PlasticResponse,
        "fem::PlasticState": fem::PlasticState,
        "fem::Spring": fem::Spring,
        "fem::TraceSpace": fem::TraceSpace<'static>,
        "fem::VonMises": fem::VonMises,
        "interface::CondensedInterface": interface::CondensedInterface<Map>,
        "PiecewiseError": PiecewiseError,
        "interface::LoadPath": interface::LoadPath,
        "interface::LoadCase": interface::LoadCase,
        "interface::Interface": interface::Interface<interface::FullView, Map>,
        "interface::FullView": interface::FullView,
        "interface::CondensedView": interface::CondensedView,
        "interface::InterfaceProblem": interface::InterfaceProblem<Map>,
        "linear::AutoSolver": linear::AutoSolver,
        "linear::BlockDiagonal": linear::BlockDiagonal,
        "linear::Bordered": linear::Bordered,
        "linear::Cholesky": linear::Cholesky,
        "linear::Condensation": linear::Condensation,
        "linear::DenseLu": linear::DenseLu,
        "linear::IncompleteLu": linear::IncompleteLu,
        "linear::Krylov": linear::Krylov,
        "linear::KrylovMethod": linear::KrylovMethod,
        "linear::KrylovReport": linear::KrylovReport,
        "linear::LinearError": linear::LinearError,
        "linear::Multigrid": linear::Multigrid,
        "linear::NullSpace": linear::NullSpace,
        "linear::Preconditioned": linear::Preconditioned<'static, linear::IncompleteLu>,
        "linear::Prolongation": linear::Prolongation,
        "linear::SparseLu": linear::SparseLu,
        "newton::Convergence": newton::Convergence,
        "newton::Correction": newton::Correction,
        "newton::Damping": newton::Damping,
        "newton::Forcing": newton::Forcing,
        "newton::Iteration": newton::Iteration,
        "newton::Linearisation": newton::Linearisation<'static, AutoSolver>,
        "newton::MoorePenrose": newton::MoorePenrose<AutoSolver>,
        "newton::Newton": newton::Newton,
        "newton::NewtonError": newton::NewtonError,
        "newton::NewtonKrylov": newton::NewtonKrylov,
        "newton::NewtonKrylovOptions": newton::NewtonKrylovOptions,
        "newton::NewtonOptions": newton::NewtonOptions,
        "newton::Report": newton::Report,
        "newton::Step": newton::Step,
        "newton::Unsolved": newton::Unsolved,
        "output::Field": output::Field,
        "output::OutputError": output::OutputError,
        "piecewise::ActiveSet": piecewise::ActiveSet,
        "piecewise::Activity": piecewise::Activity,
        "piecewise::Assembled": piecewise::Assembled<'static, complementarity::FischerBurmeister<'static, F>, linear::IncompleteLu>,
        "piecewise::BElement": piecewise::BElement,
        "piecewise::CoherentOrientation": piecewise::CoherentOrientation,
        "piecewise::Exact": piecewise::Exact,
        "piecewise::ExactConditions": piecewise::ExactConditions,
        "piecewise::ExactForm": piecewise::ExactForm,
        "piecewise::ExactPiece": piecewise::ExactPiece,
        "piecewise::ExactSite": piecewise::ExactSite,
        "piecewise::Facet": piecewise::Facet,
        "piecewise::CertificateDoubt": piecewise::CertificateDoubt,
        "piecewise::ImplicitFunction": piecewise::ImplicitFunction,
        "piecewise::LocalUniqueness": piecewise::LocalUniqueness,
        "piecewise::MinMap": piecewise::MinMap<fn(&[f64], &mut [f64], &mut [f64])>,
        "piecewise::PiecewiseError": piecewise::PiecewiseError,
        "piecewise::Regularity": piecewise::Regularity,
        "piecewise::RegularityOptions": piecewise::RegularityOptions,
        "piecewise::RegularityReport": piecewise::RegularityReport,
        "piecewise::Selection": piecewise::Selection,
        "piecewise::Selections": piecewise::Selections,
        "piecewise::TestLayout": piecewise::TestLayout,
        "piecewise::check::CheckError": piecewise::check::CheckError,
        "piecewise::check::CheckOptions": piecewise::check::CheckOptions,
        "piecewise::check::CheckReport": piecewise::check::CheckReport,
        "piecewise::check::Finding": piecewise::check::Finding,
        "piecewise::check::FindingKind": piecewise::check::FindingKind,
        "sparse::Matrix": sparse::Matrix,
        "sparse::MatrixRef": sparse::MatrixRef<'static>,
        "cones::Cone": cones::Cone,
        "ComplementarityError": ComplementarityError,
        "cones::ConeIteration": cones::ConeIteration,
        "cones::ConeMap": cones::ConeMap<'static, F>,
        "cones::ConeOptions": cones::ConeOptions,
        "cones::ConePieces": cones::ConePieces<F>,
        "cones::ConeProblem": cones::ConeProblem<F>,
        "cones::ConeRay": cones::ConeRay,
        "cones::ConeReport": cones::ConeReport,
        "cones::ConeSolver": cones::ConeSolver,
        "cones::ConeStrategy": cones::ConeStrategy,
        "variational::Infeasibility": variational::Infeasibility,
        "variational::Multipliers": variational::Multipliers,
        "variational::Nearest": variational::Nearest,
        "variational::Polyhedron": variational::Polyhedron,
        "variational::Projection": variational::Projection,
        "variational::Ray": variational::Ray,
        "ComplementarityError": ComplementarityError,
        "variational::Vi": variational::Vi<F>,
        "variational::ViReport": variational::ViReport,
        "variational::ViSolutions": variational::ViSolutions,
        "variational::ViSolver": variational::ViSolver,
        "optimise::Bundle": optimise::Bundle,
        "optimise::BundleIteration": optimise::BundleIteration,
        "optimise::BundleOptions": optimise::BundleOptions,
        "optimise::BundleReport": optimise::BundleReport,
        "optimise::BundleStep": optimise::BundleStep,
        "optimise::Implicit": optimise::Implicit<F, Map, F>,
        "optimise::OptimiseError": optimise::OptimiseError,
        "run::Status": run::Status,
        "sensitivity::DerivativeDoubt": sensitivity::DerivativeDoubt,
        "sensitivity::Differentiability": sensitivity::Differentiability,
        "sensitivity::Directional": sensitivity::Directional,
        "sensitivity::Element": sensitivity::Element,
        "sensitivity::Loaded": sensitivity::Loaded<Map>,
        "sensitivity::Sensitivity": sensitivity::Sensitivity<Map>,
        "sensitivity::SensitivityError": sensitivity::SensitivityError,
        "sensitivity::Validity": sensitivity::Validity,
        "stability::BoundaryEquilibrium": stability::BoundaryEquilibrium,
        "stability::BoundaryKind": stability::BoundaryKind,
        "stability::Dynamics": stability::Dynamics<'static, Map>,
        "stability::Hopf": stability::Hopf,
        "stability::Ritz": stability::Ritz,
        "stability::Spectrum": stability::Spectrum,
        "stability::StabilityBranch": stability::StabilityBranch,
        "stability::StabilityError": stability::StabilityError,
        "stability::Stretch": stability::Stretch,
        "sparse::Substructure": sparse::Substructure,
        "sparse::NodalMatrix": sparse::NodalMatrix,
        "sparse::Pattern": sparse::Pattern,
        "sparse::PatternRef": sparse::PatternRef<'static>,
    }
}

#[cfg(feature = "autodiff")]
fn of_autodiff() -> Vec<&'static str> {
    use semismooth::*;
    all_shared! {
        "complementarity::Autodiff": complementarity::Autodiff<Smooth>,
        "Solution": Solution<complementarity::McpReport>,
        "SolveError": SolveError<complementarity::ComplementarityError, complementarity::McpReport>,
        "piecewise::Formula": piecewise::Formula,
        "piecewise::FormulaError": piecewise::FormulaError,
        "piecewise::Traced": piecewise::Traced<Kinked>,
    }
}

#[cfg(feature = "svg")]
fn of_svg() -> Vec<&'static str> {
    use semismooth::*;
    all_shared! {
        "output::BodyPicture": output::BodyPicture<'static>,
        "output::BranchDiagram": output::BranchDiagram,
        "output::Colour": output::Colour,
        "output::Curve": output::Curve,
        "output::Marker": output::Marker,
        "output::Panel": output::Panel,
        "output::Report": output::Report,
        "output::ReportOptions": output::ReportOptions,
        "output::SegmentStyle": output::SegmentStyle,
    }
}

/// Types that are not `Send + Sync`, and why.
const NOT_SHARED: [&str; 7] = [
    // The map and closures of the caller, which may be a program of one thread.
    "continuation::BlackBoxCurve",
    // `Send`, not `Sync`: it advances through `&mut self` alone, and owns monitors of the caller.
    "continuation::Continuation",
    // Closures of the caller, which may borrow from the thread; the writers own such columns and a writer of the caller.
    "output::Column",
    "output::CsvWriter",
    "output::JsonLinesWriter",
    // The record of one evaluation, borrowed by the function that is traced.
    "piecewise::Kinks",
    // Writes to the formula that is being recorded.
    "piecewise::Expression",
];

#[test]
fn all_types_are_in_the_tables() {
    sent::<semismooth::continuation::Continuation<'static, Map>>();
    let mut known: BTreeSet<&str> = NOT_SHARED.into_iter().collect();
    known.extend(of_every_build());
    #[cfg(feature = "autodiff")]
    known.extend(of_autodiff());
    #[cfg(feature = "svg")]
    known.extend(of_svg());
    let list = include_str!("data/public_api.txt");
    let is_type = |line: &str| {
        let bare = line
            .split_whitespace()
            .find(|w| matches!(*w, "struct" | "enum" | "fn" | "impl" | "trait"));
        matches!(bare, Some("struct" | "enum"))
    };
    let off = |line: &str| {
        [
            ("autodiff", cfg!(feature = "autodiff")),
            ("json", cfg!(feature = "json")),
            ("svg", cfg!(feature = "svg")),
        ]
        .iter()
        .any(|(name, on)| !on && line.contains(&format!("feature = \"{name}\"")))
    };
    let public: BTreeSet<&str> = list
        .lines()
        .filter_map(|line| line.split_once(": "))
        .filter(|(_, line)| is_type(line) && !off(line))
        .map(|(path, _)| path)
        .collect();
    let missing: Vec<_> = public.difference(&known).collect();
    assert!(missing.is_empty(), "not in the tables: {missing:?}");
    assert!(
        public.len() > 150,
        "the list of the public interface was not understood"
    );
}

/// Errors go through `Box<dyn Error + Send + Sync>` and are compared in tests.
#[test]
fn errors_are_data() {
    error::<semismooth::complementarity::ComplementarityError>();
    error::<ContactError>();
    error::<InputError>();
    error::<ContinuationError>();
    error::<semismooth::enumeration::EnumerationError>();
    error::<semismooth::fem::FemError>();
    error::<PiecewiseError>();
    error::<semismooth::linear::LinearError>();
    error::<semismooth::newton::NewtonError>();
    error::<semismooth::optimise::OptimiseError>();
    error::<semismooth::output::OutputError>();
    error::<semismooth::piecewise::check::CheckError>();
    error::<semismooth::sensitivity::SensitivityError>();
    error::<semismooth::stability::StabilityError>();
}
