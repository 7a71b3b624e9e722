//! Answers to the questions of the page, JSON in and JSON out: diagrams, complete lists, points and transition sets of friction problems
//! with one and two contact nodes, and diagrams of formulas. [`answer`] is the only public function; `border` connects it to the browser.

mod border;
mod drawing;
mod error;
mod formula;
mod friction;
mod plane;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// A question of the page.
#[derive(Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
enum Request {
    /// The diagram of a friction problem over its range of α.
    Diagram { problem: friction::Problem },
    /// All solutions of a friction problem at one α.
    Solutions { problem: friction::Problem, alpha: f64 },
    /// States, test functions and residuals at a point of a friction problem.
    Point { problem: friction::Problem, x: Vec<f64> },
    /// The transition sets of a friction problem in the plane of a load and the coefficient of friction.
    TransitionSet { plane: plane::Plane },
    /// The diagram of a formula, and its solutions at one value of the parameter.
    Formula { formula: formula::Formula },
}

#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum Answer<T> {
    Ok(T),
    Error(error::Told),
}

/// Answers a question: an object `{"ok": …}` or `{"error": {"message", …}}`.
#[must_use]
pub fn answer(question: &str) -> String {
    match serde_json::from_str(question) {
        Err(e) => text::<()>(Err(Error::Question(e))),
        Ok(Request::Diagram { problem }) => text(problem.diagram()),
        Ok(Request::Solutions { problem, alpha }) => text(problem.solutions(alpha)),
        Ok(Request::Point { problem, x }) => text(problem.point(&x)),
        Ok(Request::TransitionSet { plane }) => text(plane.lines()),
        Ok(Request::Formula { formula }) => text(formula.explore()),
    }
}

fn text<T: Serialize>(outcome: Result<T, Error>) -> String {
    let answer = match outcome {
        Ok(value) => Answer::Ok(value),
        Err(error) => Answer::Error(error.into()),
    };
    // Serialising strings, numbers and lists to JSON cannot fail otherwise.
    serde_json::to_string(&answer).unwrap_or_else(|e| format!(r#"{{"error":{{"message":"{e}"}}}}"#))
}
