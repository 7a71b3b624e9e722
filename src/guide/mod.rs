//! The guide: eleven pages, to be read in order or where you need them.
//!
//! To learn the subject, begin with the [book](../../../book/index.html): twelve lessons with figures, exercises and solutions. Links to
//! it, here and at the ends of the pages, work where it was built beside this documentation (`cargo doc`, then `mdbook build book` in the
//! repository); elsewhere, on docs.rs too, they are broken: its text is in `book/lessons`.
//!
//! 1. [What a piecewise-smooth map is](pieces)
//! 2. [Solve](solve)
//! 3. [Follow a curve and read its transitions](follow)
//! 4. [Complementarity](complementarity)
//! 5. [Friction from a mesh](friction)
//! 6. [Write your own map](your_own_map)
//! 7. [Options, reports, failures](options)
//! 8. [Large problems and your own linear solver](large)
//! 9. [Limits of time and memory, and of the results](limits)
//! 10. [Relation to other programs, references](other_programs)
//! 11. [Words: ours beside those of the literature](words)

#[doc = include_str!("pieces.md")]
pub mod pieces {}

#[doc = include_str!("solve.md")]
pub mod solve {}

#[doc = include_str!("follow.md")]
pub mod follow {}

#[doc = include_str!("complementarity.md")]
pub mod complementarity {}

#[doc = include_str!("friction.md")]
pub mod friction {}

#[doc = include_str!("your_own_map.md")]
pub mod your_own_map {}

#[doc = include_str!("options.md")]
pub mod options {}

#[doc = include_str!("large.md")]
pub mod large {}

#[doc = include_str!("limits.md")]
pub mod limits {}

#[doc = include_str!("other_programs.md")]
pub mod other_programs {}

#[doc = include_str!("words.md")]
pub mod words {}
