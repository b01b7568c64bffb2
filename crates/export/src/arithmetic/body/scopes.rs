//! Scopes in which results are needed: everywhere, or in one arm of a choice only.

use ohmstrain_ekf::record::{Operation, Place};

/// Smallest cost of an arm that is worth a branch; a sum or a product costs one.
const WORTH: usize = 10;

/// Arms of choices, and the arm in which each result is needed.
pub struct Scopes {
    /// Scope of each operation that is needed; the first scope is the whole function.
    of: Vec<usize>,
    /// Enclosing scope of each scope.
    around: Vec<usize>,
    /// The branch of each choice, if it is worth one.
    branch: Vec<Option<usize>>,
    branches: Vec<Branch>,
}

/// Choices by the same truth value in the same scope, made together.
pub struct Branch {
    mask: Place,
    around: usize,
    /// Scopes of both arms.
    pub arms: [usize; 2],
    /// The choices, none of which uses another one's result.
    pub choices: Vec<Place>,
}

impl Scopes {
    /// Finds the scopes of operations, given how often each is used and the results.
    pub fn new(operations: &[Operation], uses: &[usize], results: &[Place]) -> Self {
        let all = Self::of_all(operations, uses, results, |_| true);
        let costs = all.costs(operations, uses);
        Self::of_all(operations, uses, results, |place| {
            all.branch_of(place).is_some_and(|branch| branch.arms.iter().any(|arm| costs[*arm] >= WORTH))
        })
    }

    /// Finds the scopes with branches at the choices for which `worth` holds.
    fn of_all(operations: &[Operation], uses: &[usize], results: &[Place], worth: impl Fn(Place) -> bool) -> Self {
        let (of, branch) = (vec![0; operations.len()], vec![None; operations.len()]);
        let mut scopes = Self { of, around: vec![0], branch, branches: Vec::new() };
        let mut met = vec![false; operations.len()];
        results.iter().for_each(|place| met[*place] = true);
        for place in (0..operations.len()).rev().filter(|place| uses[*place] > 0) {
            let own = scopes.of[place];
            let mut needed = vec![own; 3];
            if let Operation::Pick(mask, ..) = operations[place]
                && worth(place)
            {
                needed[1..].copy_from_slice(&scopes.join(operations, place, mask, own));
            }
            for (operand, scope) in operations[place].operands().zip(needed) {
                scopes.of[operand] = if met[operand] { scopes.both(scopes.of[operand], scope) } else { scope };
                met[operand] = true;
            }
        }
        scopes
    }

    /// Returns the arms of a choice: those of an earlier choice by the same truth value, if they can be made together.
    fn join(&mut self, operations: &[Operation], choice: Place, mask: Place, around: usize) -> [usize; 2] {
        let is_like = |branch: &Branch| {
            (branch.mask, branch.around) == (mask, around)
                && !branch.choices.iter().any(|other| takes(operations, *other, choice))
        };
        let found = self.branches.iter().position(is_like);
        let number = found.unwrap_or_else(|| {
            let arms = [self.inside(around), self.inside(around)];
            self.branches.push(Branch { mask, around, arms, choices: Vec::new() });
            self.branches.len() - 1
        });
        self.branch[choice] = Some(number);
        self.branches[number].choices.push(choice);
        self.branches[number].arms
    }

    /// Creates a scope inside another one.
    fn inside(&mut self, around: usize) -> usize {
        self.around.push(around);
        self.around.len() - 1
    }

    /// Returns the innermost scope that encloses both; a scope comes after those that enclose it.
    fn both(&self, mut a: usize, mut b: usize) -> usize {
        while a != b {
            if a > b {
                a = self.around[a];
            } else {
                b = self.around[b];
            }
        }
        a
    }

    /// Computes the cost of each scope, including those within it.
    fn costs(&self, operations: &[Operation], uses: &[usize]) -> Vec<usize> {
        let mut costs = vec![0; self.around.len()];
        for (place, operation) in operations.iter().enumerate().filter(|(place, _)| uses[*place] > 0) {
            costs[self.of[place]] += cost(*operation);
        }
        for scope in (1..costs.len()).rev() {
            costs[self.around[scope]] += costs[scope];
        }
        costs
    }

    /// Returns the branch of a choice, if it is worth one.
    pub fn branch_of(&self, choice: Place) -> Option<&Branch> {
        self.branch.get(choice).copied().flatten().and_then(|number| self.branches.get(number))
    }

    /// Returns the operations that the arms of a branch use and that others use, too.
    pub fn shared(&self, operations: &[Operation], uses: &[usize], branch: &Branch) -> Vec<Place> {
        let within = |place: Place| branch.arms.iter().any(|arm| self.both(self.of[place], *arm) == *arm);
        let last = branch.choices.iter().copied().max().unwrap_or(0);
        let inner = (0..last).filter(|place| uses[*place] > 0 && within(*place));
        let ways = branch.choices.iter().flat_map(|choice| operations[*choice].operands().skip(1));
        let taken = inner.flat_map(|place| operations[place].operands()).chain(ways);
        let mut shared: Vec<Place> = taken.filter(|place| !within(*place)).collect();
        shared.sort_unstable();
        shared.dedup();
        shared
    }
}

/// True if a result is needed for another one.
fn takes(operations: &[Operation], result: Place, needed: Place) -> bool {
    result == needed
        || result > needed && operations[result].operands().any(|operand| takes(operations, operand, needed))
}

/// Returns the approximate time of an operation, in sums.
const fn cost(operation: Operation) -> usize {
    match operation {
        Operation::Input(_)
        | Operation::Flag(_)
        | Operation::Constant(_)
        | Operation::Known(_)
        | Operation::Hazard(_) => 0,
        Operation::Exponential(_)
        | Operation::ExponentialLessOne(_)
        | Operation::Tangent(_)
        | Operation::Falling(_) => 30,
        Operation::Tail(_) => 80,
        Operation::Root(_) | Operation::Divide(..) => 14,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::record::Operation;

    use super::Scopes;

    /// Tests `input 0 < 0 ? exp(input 1) : sqrt(input 2 + input 1)`, with that sum used once more; one result lies in an arm,
    /// too.
    #[test]
    fn what_one_way_needs_is_done_there() {
        let operations = [
            Operation::Input(0),
            Operation::Constant(0.0),
            Operation::Less(0, 1),
            Operation::Input(1),
            Operation::Exponential(3),
            Operation::Input(2),
            Operation::Add(5, 3),
            Operation::Root(6),
            Operation::Pick(2, 4, 7),
            Operation::Add(8, 6),
        ];
        let uses = [1, 1, 1, 2, 1, 1, 2, 1, 1, 1];
        let scopes = Scopes::new(&operations, &uses, &[9]);
        let branch = scopes.branch_of(8).unwrap();
        let [yes, no] = branch.arms;
        assert_eq!((scopes.of[4], scopes.of[7], scopes.of[6], scopes.of[3]), (yes, no, 0, 0));
        assert_eq!(scopes.shared(&operations, &uses, branch), [3, 6]);
        assert_eq!(Scopes::new(&operations, &uses, &[9, 4]).of[4], 0);
    }

    #[test]
    fn a_choice_of_what_is_there_is_no_branch() {
        let operations = [Operation::Input(0), Operation::Input(1), Operation::Less(0, 1), Operation::Pick(2, 0, 1)];
        assert!(Scopes::new(&operations, &[2, 2, 1, 1], &[3]).branch_of(3).is_none());
    }
}
