//! Bodies given by matrices in files.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

use semismooth::InputError;
use semismooth::contact::{CondensedContact, ContactBody, ContactSolution, LoadPath};
use semismooth::sparse::{Matrix, read_matrix_market, read_substructure, read_vector};
use toml::Spanned;

use super::input::{MatricesInput, Route};
use super::law::Law;
use super::model::{Plan, RunFile};
use super::{Case, follow, history, tell_held};
use crate::commands::error::CommandError;
use crate::commands::run_file::{RunArgs, write_failed};
use crate::commands::text::wrapped;

pub(super) fn run(
    file: &RunFile,
    place: &Spanned<MatricesInput>,
    plan: &Plan,
    arguments: &RunArgs,
    out: &mut dyn Write,
) -> Result<(), CommandError> {
    let (problem, note, held) = problem(file, place)?;
    if !arguments.json && !arguments.quiet {
        if let Some(note) = &note {
            writeln!(out, "{}", wrapped(&format!("note: {note}")))?;
        }
        tell_held(held, out)?;
    }
    let output = &file.input.output;
    let case = Case {
        problem,
        mesh: None,
        folder: file.results(arguments.out.as_ref(), &output.folder)?,
        fields: output.fields,
        pictures: output.pictures,
        arguments,
    };
    match plan {
        Plan::History(levels) | Plan::Levels(levels) => history::run(case, levels, out),
        Plan::Follow(range) => follow::run(&case, *range, out),
    }
}

/// The problem, what had to be changed in its matrices, and the number of nodes with held tangents.
pub(super) fn problem(
    file: &RunFile,
    place: &Spanned<MatricesInput>,
) -> Result<(CondensedContact<Law>, Option<String>, usize), CommandError> {
    file.check_matrices_alone()?;
    let (body, note) = file.given(place)?;
    let held = body.num_held();
    let areas = vec![1.0; body.num_contacts()];
    let law = file.law(1 + body.num_tangents(), &areas)?;
    let body = file.layered(body, &areas)?;
    let problem =
        CondensedContact::new(body, law).map_err(|e| CommandError::failed("the body in contact", e))?;
    Ok((problem, note, held))
}

impl RunFile {
    /// Refuses what belongs to a mesh.
    fn check_matrices_alone(&self) -> Result<(), CommandError> {
        let (input, contact) = (&self.input, self.input.contact.get_ref());
        let of_mesh = [
            ("mesh", input.mesh.is_some()),
            ("material", input.material.is_some()),
            ("inclusion", !input.inclusion.is_empty()),
            ("point", !input.point.is_empty()),
            ("support", !input.support.is_empty()),
            ("spring", !input.spring.is_empty()),
            ("elastic_foundation", !input.elastic_foundation.is_empty()),
            ("traction", !input.traction.is_empty()),
            ("force", !input.force.is_empty()),
            ("contact.facets", contact.facets.is_some()),
            ("contact.against", contact.against.is_some()),
            ("contact.point", contact.point.is_some()),
            ("contact.normal", contact.normal.is_some()),
            ("contact.gap", contact.gap.is_some()),
        ];
        if let Some((key, _)) = of_mesh.iter().find(|k| k.1) {
            let what = "a body given by matrices has none: its loads and gaps are in files";
            return Err(self.wrong(&self.input.contact, key, what));
        }
        if self.input.run.get_ref().route == Route::Reduced {
            let what = "the reduced route needs a mesh";
            return Err(self.wrong(&self.input.run, "run.route", what));
        }
        Ok(())
    }

    fn given(&self, place: &Spanned<MatricesInput>) -> Result<(ContactBody, Option<String>), CommandError> {
        let given = place.get_ref();
        let matrix = |key: &str, name: &Spanned<String>| {
            let read = read_matrix_market(self.relative(name.get_ref()));
            read.map_err(|e| self.wrong(name, key, e))
        };
        let path = self.relative(given.stiffness.get_ref());
        let stiffness =
            stiffness(&path).map_err(|e| self.wrong(&given.stiffness, "matrices.stiffness", e))?;
        let n = stiffness.nrows();
        let vector = |key: &str, name: Option<&Spanned<String>>, length: usize| match name {
            None => Ok(vec![0.0; length]),
            Some(name) => {
                let read = read_vector(self.relative(name.get_ref()));
                read.map_err(|e| self.wrong(name, key, e))
            }
        };
        let normal = matrix("matrices.normal", &given.normal)?;
        let tangential = given.tangential.iter().map(|t| matrix("matrices.tangential", t));
        let tangential = tangential.collect::<Result<Vec<_>, _>>()?;
        let load = vector("matrices.load", given.load.as_ref(), n)?;
        let grows = vector("matrices.grows", given.grows.as_ref(), n)?;
        let gap = vector("matrices.gap", given.gap.as_ref(), normal.nrows())?;
        ContactBody::exported(stiffness, normal, tangential, LoadPath::affine(load, grows))
            .and_then(|(body, note)| Ok((body.with_gap(gap)?, note)))
            .map_err(|e| self.wrong(place, "matrices", e))
    }
}

/// A Matrix Market file, which begins with two percent signs, or a substructure.
fn stiffness(path: &Path) -> Result<Matrix, InputError> {
    let mut first = String::new();
    let opened = std::fs::File::open(path).map(BufReader::new);
    // Errors come again, with their words, where the file is read.
    if let Ok(mut file) = opened
        && file.read_line(&mut first).is_ok()
        && first.starts_with('*')
    {
        return Ok(read_substructure(path)?.stiffness);
    }
    read_matrix_market(path)
}

/// A table of the contact nodes.
pub(super) fn write_nodes(path: &Path, solution: &ContactSolution) -> Result<(), CommandError> {
    let mut text = String::from("node,state,penetration,pressure,slip 1,slip 2,traction 1,traction 2\n");
    for (i, (v, state)) in solution.nodes.iter().zip(&solution.states).enumerate() {
        let ([s1, s2], [t1, t2]) = (v.slip, v.traction);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{i},{},{:?},{:?},{s1:?},{s2:?},{t1:?},{t2:?}",
            state.name(),
            v.penetration,
            v.pressure
        );
    }
    std::fs::write(path, text).map_err(write_failed(path))
}
