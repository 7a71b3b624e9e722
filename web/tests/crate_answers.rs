//! Questions with the answers of the crate in native code, for the test in the browser: written to the file in `CRATE_ANSWERS`.

use serde_json::{Value, json};

fn questions() -> Vec<Value> {
    let mut questions = Vec::new();
    for (load, rate, friction, friction_rate, range) in [
        (
            json!([1.5, 7.0]),
            json!([0.0, 0.0]),
            json!([0.0]),
            json!([1.0]),
            json!([-0.5, 10.0]),
        ),
        (
            json!([1.5, -4.0]),
            json!([0.0, 0.0]),
            json!([0.0]),
            json!([1.0]),
            json!([-0.5, 10.0]),
        ),
        (
            json!([1.0, -2.0]),
            json!([0.0, 0.0]),
            json!([0.0]),
            json!([1.0]),
            json!([-0.5, 10.0]),
        ),
        (
            json!([0.92, -2.0]),
            json!([0.0, 0.0]),
            json!([0.0]),
            json!([1.0]),
            json!([-0.5, 10.0]),
        ),
        (
            json!([0.4, -2.1417, 1.3717, -2.1417]),
            json!([0.0, 0.0, 0.0, 0.0]),
            json!([0.0, 0.0]),
            json!([1.0, 1.0]),
            json!([-0.5, 10.0]),
        ),
        (
            json!([0.4, 0.2, 1.8, -0.1]),
            json!([-0.1, 1.1, 0.2, 0.8]),
            json!([4.0, 4.0]),
            json!([0.0, 0.0]),
            json!([-6.0, 10.0]),
        ),
    ] {
        let problem = json!({
            "lambda": 1.0, "mu": 1.0, "load": load, "rate": rate, "friction": friction, "friction_rate": friction_rate, "range": range,
        });
        questions.push(json!({"ask": "diagram", "problem": problem}));
        questions.push(json!({"ask": "solutions", "problem": problem, "alpha": 3.1}));
    }
    let formula = |equations: [&str; 2]| json!({"equations": equations, "range": [-1.0, 2.0], "at": 0.5, "reach": 3.0, "diagram": true});
    questions.push(json!({"ask": "formula", "formula": formula(["abs(x) = a", ""])}));
    questions.push(json!({"ask": "formula", "formula": formula(["x = max(", ""])}));
    questions.push(json!({"ask": "transition_set", "plane": {
        "lambda": 1.0, "mu": 1.0, "base": [1.5, 0.0], "direction": [0.0, 1.0], "weights": [1.0], "load": [-8.0, 8.0], "friction": [0.0, 6.0],
    }}));
    questions
}

#[test]
fn the_same_question_has_the_same_answer() {
    let mut cases = Vec::new();
    for question in questions() {
        let answer = semismooth_web::answer(&question.to_string());
        assert_eq!(answer, semismooth_web::answer(&question.to_string()));
        let answer: Value = serde_json::from_str(&answer).unwrap();
        cases.push(json!({"question": question, "answer": answer}));
    }
    if let Some(path) = std::env::var_os("CRATE_ANSWERS") {
        std::fs::write(path, Value::Array(cases).to_string()).unwrap();
    }
}
