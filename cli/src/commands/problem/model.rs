//! From a run file to a map.

use semismooth::contact::{CondensedContact, PlanarCoulomb, read_folder};
use semismooth::piecewise::{Formula, PiecewiseSmooth, Traced};
use serde::de::DeserializeOwned;

use super::input::{Input, options};
use crate::commands::error::CommandError;
use crate::commands::run_file;

pub(super) type RunFile = run_file::RunFile<Input>;

/// The map, and the names of its variables, the parameter last.
pub(super) struct Problem {
    map: Map,
    pub(super) names: Vec<String>,
}

enum Map {
    Formulas(Box<Traced<Formula>>),
    Friction(Box<CondensedContact<PlanarCoulomb>>),
}

impl Problem {
    pub(super) fn map(&self) -> &dyn PiecewiseSmooth {
        match &self.map {
            Map::Formulas(map) => map,
            Map::Friction(map) => map,
        }
    }

    pub(super) fn has_parameter(&self) -> bool {
        self.map().num_vars() > self.map().num_residuals()
    }

    /// The friction problem, if it is one.
    pub(super) fn friction(&self) -> Option<&CondensedContact<PlanarCoulomb>> {
        match &self.map {
            Map::Formulas(_) => None,
            Map::Friction(map) => Some(map),
        }
    }

    /// What lists and diagrams do not say where tangents are held.
    pub(super) fn remark(&self) -> &'static str {
        match &self.map {
            Map::Friction(map) if map.body().num_held() > 0 => {
                " (symmetric solutions only: tangents are held, as on planes of symmetry)"
            }
            _ => "",
        }
    }

    /// The parameter's name.
    pub(super) fn parameter(&self) -> &str {
        self.names.last().map_or("", String::as_str)
    }

    /// A solution at a value of the parameter, for problems that have a method to find one.
    pub(super) fn solve(&self, alpha: f64) -> Option<Result<Vec<f64>, CommandError>> {
        match &self.map {
            Map::Formulas(_) => None,
            Map::Friction(map) => {
                let failed = |e| CommandError::failed(format!("the start at α = {alpha}"), e);
                Some(map.solve(alpha, None).map_err(failed))
            }
        }
    }

    /// The number of a variable.
    pub(super) fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }
}

impl RunFile {
    pub(super) fn problem(&self) -> Result<Problem, CommandError> {
        let place = &self.input.problem;
        let given = place.get_ref();
        match (&given.folder, &given.equations, &given.unknowns) {
            (Some(folder), None, None) => self.friction(folder),
            (None, Some(equations), Some(unknowns)) => self.formulas(equations, unknowns),
            _ => {
                let what = "unknowns and equations are wanted, or a folder";
                Err(self.wrong(place, "problem", what))
            }
        }
    }

    fn friction(&self, folder: &toml::Spanned<String>) -> Result<Problem, CommandError> {
        let read = read_folder(self.relative(folder.get_ref()));
        let map = read
            .and_then(|folder| Ok(folder.condensed()?))
            .map_err(|e| self.wrong(folder, "problem.folder", e))?;
        let p = map.num_contacts();
        let numbered = |name: &str| (0..p).map(|i| format!("{name} {i}")).collect::<Vec<_>>();
        let mut names = [numbered("normal force"), numbered("tangential force")].concat();
        names.push("α".to_owned());
        Ok(Problem {
            names,
            map: Map::Friction(Box::new(map)),
        })
    }

    fn formulas(
        &self,
        equations: &[toml::Spanned<String>],
        unknowns: &[String],
    ) -> Result<Problem, CommandError> {
        let place = &self.input.problem;
        let mut names = unknowns.to_vec();
        names.extend(place.get_ref().parameter.clone());
        if let Some(k) = (1..names.len()).find(|&k| names[..k].contains(&names[k])) {
            let what = format!("there are two variables \"{}\"", names[k]);
            return Err(self.wrong(place, "problem", what));
        }
        let constants = &place.get_ref().constants;
        if let Some(name) = names.iter().find(|n| constants.contains_key(n.as_str())) {
            let what = format!("\"{name}\" is a variable and a constant");
            return Err(self.wrong(place, "problem.constants", what));
        }
        if let Some((name, value)) = constants.iter().find(|(_, v)| !v.is_finite()) {
            return Err(self.wrong(
                place,
                "problem.constants",
                format!("{name} = {value} is not finite"),
            ));
        }
        let constants: Vec<(&str, f64)> = constants.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        let count = unknowns.len();
        if equations.len() != count || count == 0 {
            let what = format!("{} equations for {count} unknowns", equations.len());
            return Err(self.wrong(place, "problem.equations", what));
        }
        let variables: Vec<&str> = names.iter().map(String::as_str).collect();
        let texts: Vec<&str> = equations.iter().map(|e| e.get_ref().as_str()).collect();
        let formulas = Formula::read_with(&texts, &variables, &constants).map_err(|mistake| {
            let equation = mistake.equation;
            let text: Vec<u16> = texts[equation].encode_utf16().collect();
            let part = |from: usize, to: usize| String::from_utf16_lossy(&text[from.min(to)..to]);
            let (from, to) = (mistake.from.min(text.len()), mistake.to.min(text.len()));
            let what = match from == to {
                true => format!("{mistake}: {}", texts[equation]),
                false => format!(
                    "{mistake}, at \"{}\" behind \"{}\"",
                    part(from, to),
                    part(0, from)
                ),
            };
            self.wrong(&equations[equation], "problem.equations", what)
        })?;
        Ok(Problem {
            map: Map::Formulas(Box::new(Traced::new(formulas))),
            names,
        })
    }

    /// The defaults, overridden by the options in the run file.
    pub(super) fn options<T: DeserializeOwned + Default>(&self) -> Result<T, CommandError> {
        match &self.input.options {
            None => Ok(T::default()),
            Some(table) => options(table.get_ref()).map_err(|e| {
                let message = e.message().to_owned();
                self.wrong(table, "options", message)
            }),
        }
    }

    /// The range of the parameter; an error if it is missing.
    pub(super) fn range(&self, problem: &Problem) -> Result<[f64; 2], CommandError> {
        let run = &self.input.run;
        if problem.map().num_vars() == problem.map().num_residuals() {
            return Err(self.wrong(&self.input.problem, "problem.parameter", "a parameter is wanted"));
        }
        let Some(range) = &run.get_ref().range else {
            return Err(self.wrong(run, "run.range", "the range of the parameter is wanted"));
        };
        match *range.get_ref() {
            [a, b] if a != b && a.is_finite() && b.is_finite() => Ok([a, b]),
            _ => Err(self.wrong(range, "run.range", "two different values are wanted")),
        }
    }

    /// The unknowns that are drawn: those in the run file, or the first two.
    pub(super) fn plotted(&self, problem: &Problem) -> Result<Vec<usize>, CommandError> {
        let Some(plot) = &self.input.output.plot else {
            return Ok((0..(problem.names.len() - 1).min(2)).collect());
        };
        let find = |name: &String| {
            problem.index(name).ok_or_else(|| {
                let what = format!("there is no variable \"{name}\"");
                self.wrong(plot, "output.plot", what)
            })
        };
        plot.get_ref().iter().map(find).collect()
    }
}
