//! Piecewise-smooth maps: sites, pieces, selections, test functions and active index sets.
//!
//! See [`PiecewiseSmooth`] for the trait and its contract, [`Semismooth`] for maps that have no finite list of pieces,
//! [`check`](mod@check) for testing an implementation, and [`MinMap`] or, with the `autodiff` feature, `Traced`
//! for maps written as minima, maxima and projections of smooth functions.

#[cfg(feature = "autodiff")]
mod abs_normal;
mod active;
#[cfg(feature = "autodiff")]
mod autodiff;
mod cell;
pub mod check;
mod condensed;
mod derivative;
mod determinants;
mod differences;
mod elements;
mod error;
mod essential;
mod exact_pieces;
pub(crate) mod expansion;
mod expansions;
mod extensions;
#[cfg(feature = "autodiff")]
mod formula;
mod hull;
mod implicit;
mod index;
mod layout;
mod map;
mod matrix_free;
mod min_map;
#[cfg(feature = "autodiff")]
mod number;
mod orientation;
mod real;
mod regularity;
mod regularity_report;
mod scaled;
mod selection;
mod selections;
mod semismooth;
mod semismooth_regularity;
#[cfg(feature = "autodiff")]
pub(crate) mod trace;
mod uniqueness;
mod vanishing;

pub use active::{ActiveSet, active_set, select, select_pieces, value};
#[cfg(feature = "autodiff")]
pub use autodiff::{Kinks, NonsmoothFunction, Traced};
pub use cell::{Facet, cell_margin};
pub(crate) use condensed::{Condensed, CondensedJacobian, CondensedPieces, CondensedRoom};
pub use derivative::{CoherentOrientation, b_derivative, coherent_orientation};
pub(crate) use determinants::{ExactSigns, near};
pub use elements::{BElement, b_subdifferential, clarke_element};
pub use error::PiecewiseError;
pub(crate) use error::{carries_maps, check_selection};
pub(crate) use essential::open_cone;
pub use essential::{Activity, essential_activity};
pub use exact_pieces::{ExactConditions, ExactForm, ExactPiece, ExactPieces, ExactSite};
pub use expansions::Expansions;
pub use extensions::{Derivatives, Description, PiecewiseSmoothExt, Structure};
#[cfg(feature = "autodiff")]
pub use formula::{Expression, Formula, FormulaError};
pub(crate) use implicit::implicit_verdict;
pub use implicit::{ImplicitFunction, implicit_function};
pub use index::local_index;
pub use layout::TestLayout;
pub use map::PiecewiseSmooth;
pub use matrix_free::{Assembled, MatrixFree};
pub use min_map::MinMap;
pub use real::Real;
pub(crate) use regularity::{Between, singular, square};
pub use regularity::{Regularity, bd_regularity, cd_regularity};
pub use regularity_report::{RegularityOptions, RegularityReport};
pub(crate) use regularity_report::{regularity_report, semismooth_report};
pub(crate) use scaled::{Scaled, ScaledMap, check_sizes, is_ordinary};
pub use selection::Selection;
pub use selections::Selections;
pub use semismooth::Semismooth;
pub use semismooth_regularity::{bd_regularity_semismooth, cd_regularity_semismooth};
pub use uniqueness::{CertificateDoubt, LocalUniqueness, local_uniqueness, local_uniqueness_with};
pub(crate) use vanishing::pointed_into;
pub(crate) use vanishing::{Vanishing, gradient_of};

pub use crate::exact::Exact;
