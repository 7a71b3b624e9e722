//! A maximum matching of equations with variables on which they depend.

/// One equation for each of `count` variables; `edges` lists the variables in each of as many equations. Variables outside the maximum
/// matching get the remaining equations.
#[must_use]
pub fn complete(edges: &[Vec<usize>], count: usize) -> Vec<usize> {
    let mut equation_of: Vec<Option<usize>> = vec![None; count];
    let mut variable_of: Vec<Option<usize>> = vec![None; edges.len()];
    for (equation, variables) in edges.iter().enumerate() {
        if let Some(&variable) = variables.iter().find(|&&v| equation_of[v].is_none()) {
            equation_of[variable] = Some(equation);
            variable_of[equation] = Some(variable);
        }
    }
    // Augmenting paths: from an unmatched equation to an unmatched variable, with every second edge in the matching.
    let mut seen = vec![usize::MAX; count];
    let mut from = vec![0; count];
    for start in 0..edges.len() {
        if variable_of[start].is_some() {
            continue;
        }
        let mut queue = vec![start];
        let mut next = 0;
        let mut end = None;
        'search: while let Some(&equation) = queue.get(next) {
            next += 1;
            for &variable in &edges[equation] {
                if std::mem::replace(&mut seen[variable], start) == start {
                    continue;
                }
                from[variable] = equation;
                match equation_of[variable] {
                    Some(other) => queue.push(other),
                    None => {
                        end = Some(variable);
                        break 'search;
                    }
                }
            }
        }
        while let Some(variable) = end {
            let equation = from[variable];
            equation_of[variable] = Some(equation);
            end = variable_of[equation].replace(variable);
        }
    }
    let mut left = (0..edges.len()).filter(|&e| variable_of[e].is_none());
    let pairs = equation_of.into_iter().map(|e| e.or_else(|| left.next()));
    pairs.flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_found_where_the_first_choice_is_taken() {
        let pairs = complete(&[vec![0, 1], vec![0], vec![1, 2]], 3);
        assert_eq!(pairs, [1, 0, 2]);
    }

    #[test]
    fn equations_without_variables_take_what_is_left() {
        let mut pairs = complete(&[vec![1], vec![], vec![1]], 3);
        assert_eq!(pairs[1], 0);
        pairs.sort_unstable();
        assert_eq!(pairs, [0, 1, 2]);
    }

    #[test]
    fn a_long_chain_is_turned_over() {
        // Equation i has variables i and i + 1, taken in this order, the last one variable 0 alone.
        let n = 2000;
        let mut edges: Vec<Vec<usize>> = (0..n - 1).map(|i| vec![i, i + 1]).collect();
        edges.push(vec![0]);
        let pairs = complete(&edges, n);
        assert_eq!(pairs[0], n - 1);
        assert!((1..n).all(|v| pairs[v] == v - 1));
    }
}
