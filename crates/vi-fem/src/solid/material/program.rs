//! Formulas of the invariants I₁, I₂, J as programs for SIMD lanes.
//!
//! A [`Program`] is a list of steps. Constants are folded, and a part that occurs several times is one step. The value and
//! the second derivatives are computed forward, in jets. The first derivatives alone are computed backward: each step passes
//! the derivative by its result on to its operands (reverse mode; Griewank, Walther 2008, §3.2), which takes about as long
//! as the value.

use super::jet::Jet;
use crate::error::FemError;
use crate::lanes::real::Real;
use crate::path::expression::{Code, Expression, Unary};

/// Largest number of intermediate values of a formula; more would not stay in the first cache.
const SLOTS: usize = 16;

/// Largest number of steps whose derivatives are computed backward, which keeps the values of all steps.
const SHORT: usize = 24;

#[derive(Debug, Clone, Copy)]
enum Operation {
    Constant(f64),
    Variable(usize),
    Shift(f64),
    Scale(f64),
    Reciprocal,
    /// xⁿ with n ≥ 2.
    Raise(u32),
    /// x^p for x > 0, NaN elsewhere.
    Power(f64),
    Unary(&'static Unary),
    Add,
    Subtract,
    Multiply,
    Larger,
    Smaller,
}

impl Operation {
    /// Returns the number of operands.
    fn arity(self) -> usize {
        match self {
            Self::Constant(_) | Self::Variable(_) => 0,
            Self::Add | Self::Subtract | Self::Multiply | Self::Larger | Self::Smaller => 2,
            _ => 1,
        }
    }

    /// Returns whether both give the same result for the same operands.
    fn is(self, other: Self) -> bool {
        match (self, other) {
            (Self::Constant(a), Self::Constant(b))
            | (Self::Shift(a), Self::Shift(b))
            | (Self::Scale(a), Self::Scale(b))
            | (Self::Power(a), Self::Power(b)) => a.to_bits() == b.to_bits(),
            (Self::Variable(a), Self::Variable(b)) => a == b,
            (Self::Raise(a), Self::Raise(b)) => a == b,
            (Self::Unary(a), Self::Unary(b)) => a.name == b.name,
            _ => std::mem::discriminant(&self) == std::mem::discriminant(&other),
        }
    }

    /// Returns the value, the first and the second derivative of an operation with one operand at x.
    #[inline(always)]
    fn chain<R: Real>(self, x: R) -> [R; 3] {
        let number = |value: f64| x.constant(value);
        match self {
            Self::Shift(by) => [x + by, number(1.0), number(0.0)],
            Self::Scale(by) => [x * by, number(by), number(0.0)],
            Self::Reciprocal => {
                let inverse = number(1.0) / x;
                let square = inverse * inverse;
                [inverse, -square, square * inverse * 2.0]
            }
            Self::Raise(exponent) => {
                // x^(n − 2)
                let mut power = number(1.0);
                for _ in 2..exponent {
                    power = power * x;
                }
                let n = f64::from(exponent);
                [power * x * x, power * x * n, power * (n * (n - 1.0))]
            }
            Self::Power(p) => {
                let value = x.map(|x| if x > 0.0 { x.powf(p) } else { f64::NAN });
                let first = value / x * p;
                [value, first, first / x * (p - 1.0)]
            }
            Self::Unary(function) => match (function.name, function.derivatives) {
                ("log", _) => {
                    let inverse = number(1.0) / x;
                    [x.ln(), inverse, -(inverse * inverse)]
                }
                ("sqrt", _) => {
                    let root = x.sqrt();
                    let first = number(0.5) / root;
                    [root, first, first / x * -0.5]
                }
                (_, Some(derivatives)) => {
                    [x.map(function.value), x.map(|x| derivatives(x)[0]), x.map(|x| derivatives(x)[1])]
                }
                // `Program::new` refuses functions with jumps.
                (_, None) => [number(f64::NAN); 3],
            },
            // These have no operand, or two.
            _ => [number(f64::NAN); 3],
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Step {
    operation: Operation,
    /// The steps whose results are the operands; a step with fewer operands repeats its own number.
    operands: [usize; 2],
    /// Where the forward evaluation finds the operands, and where it leaves the result.
    slots: [usize; 3],
}

/// A formula of I₁, I₂ and J with folded constants.
#[derive(Debug, Clone)]
pub(super) struct Program {
    /// In the order of their evaluation; the last one gives the result.
    steps: Vec<Step>,
    /// Whether I₂ occurs.
    pub(super) uses_second: bool,
}

/// A part of a formula while its program is made: a number, or the result of a step.
#[derive(Clone, Copy)]
enum Part {
    Number(f64),
    Step(usize),
}

impl Program {
    /// Makes the program of a formula whose variables 0, 1, 2 are I₁, I₂, J and whose others have these `values`.
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] for a function with jumps, an exponent that is not constant, or a formula that
    /// nests too deeply.
    pub(super) fn new(formula: &Expression, values: &[f64]) -> Result<Self, FemError> {
        let wrong = |problem: String| FemError::Invalid { what: "energy", problem };
        let mut program = Self { steps: Vec::new(), uses_second: false };
        let mut parts: Vec<Part> = Vec::new();
        // The parser gives every operation its operands.
        let nothing = || Part::Number(f64::NAN);
        for code in formula.code() {
            let part = match *code {
                Code::Number(value) => Part::Number(value),
                Code::Variable(k) if k < 3 => program.step(Operation::Variable(k), [0; 2]),
                Code::Variable(k) => Part::Number(values[k - 3]),
                Code::Negate => match parts.pop().unwrap_or_else(nothing) {
                    Part::Number(value) => Part::Number(-value),
                    part => program.then(part, Operation::Scale(-1.0)),
                },
                Code::Unary(function) => match parts.pop().unwrap_or_else(nothing) {
                    Part::Number(value) => Part::Number((function.value)(value)),
                    part if function.derivatives.is_some() => program.then(part, Operation::Unary(function)),
                    _ => return Err(wrong(format!("`{}` jumps, but an energy is smooth", function.name))),
                },
                binary => {
                    let (b, a) = (parts.pop().unwrap_or_else(nothing), parts.pop().unwrap_or_else(nothing));
                    program.combined(a, b, binary).map_err(wrong)?
                }
            };
            parts.push(part);
        }
        let last = parts.pop().unwrap_or_else(nothing);
        let last = program.place(last);
        program.keep_what_reaches(last);
        program.uses_second =
            program.steps.iter().any(|step| matches!(step.operation, Operation::Variable(1)));
        if program.assign_slots() > SLOTS {
            return Err(wrong(format!(
                "the formula has more than {SLOTS} pending values: nest it less deeply"
            )));
        }
        Ok(program)
    }

    /// Returns the program that gives NaN everywhere.
    pub(super) fn undefined() -> Self {
        let step = Step { operation: Operation::Constant(f64::NAN), operands: [0; 2], slots: [0; 3] };
        Self { steps: vec![step], uses_second: false }
    }

    /// Adds a step, unless there is an equal one.
    fn step(&mut self, operation: Operation, operands: [usize; 2]) -> Part {
        let count = operation.arity();
        let is_equal =
            |step: &Step| step.operation.is(operation) && step.operands[..count] == operands[..count];
        Part::Step(self.steps.iter().position(is_equal).unwrap_or_else(|| {
            let number = self.steps.len();
            let operands = [0, 1].map(|k| if k < count { operands[k] } else { number });
            self.steps.push(Step { operation, operands, slots: [0; 3] });
            number
        }))
    }

    /// Returns the number of the step that gives a part.
    fn place(&mut self, part: Part) -> usize {
        match part {
            Part::Step(number) => number,
            Part::Number(value) => match self.step(Operation::Constant(value), [0; 2]) {
                Part::Step(number) => number,
                Part::Number(_) => 0,
            },
        }
    }

    fn then(&mut self, part: Part, operation: Operation) -> Part {
        let operand = self.place(part);
        self.step(operation, [operand; 2])
    }

    fn with(&mut self, a: Part, b: Part, operation: Operation) -> Part {
        let operands = [self.place(a), self.place(b)];
        self.step(operation, operands)
    }

    /// Removes the steps that the result does not need. They remain if a power of zero is folded.
    fn keep_what_reaches(&mut self, last: usize) {
        let mut is_needed = vec![false; self.steps.len()];
        is_needed[last] = true;
        for (number, step) in self.steps.iter().enumerate().rev() {
            if is_needed[number] {
                step.operands.iter().for_each(|&operand| is_needed[operand] = true);
            }
        }
        let mut numbers = vec![0; self.steps.len()];
        let mut kept = Vec::new();
        for (number, step) in self.steps.iter().enumerate().filter(|(number, _)| is_needed[*number]) {
            numbers[number] = kept.len();
            kept.push(Step { operands: step.operands.map(|operand| numbers[operand]), ..*step });
        }
        self.steps = kept;
    }

    /// Gives each result a slot from its step to its last use; returns the number of slots.
    fn assign_slots(&mut self) -> usize {
        let mut last_use: Vec<usize> = (0..self.steps.len()).collect();
        for (number, step) in self.steps.iter().enumerate() {
            step.operands.iter().for_each(|&operand| last_use[operand] = number);
        }
        // Per slot, the step after which it is free.
        let mut taken: Vec<usize> = Vec::new();
        for number in 0..self.steps.len() {
            let [a, b] = self.steps[number].operands.map(|operand| self.steps[operand].slots[2]);
            let is_free = |until: &usize| *until <= number;
            let slot = taken.iter().position(is_free).unwrap_or_else(|| {
                taken.push(0);
                taken.len() - 1
            });
            taken[slot] = last_use[number].max(number + 1);
            self.steps[number].slots = [a, b, slot];
        }
        taken.len()
    }

    /// Returns the value at I₁, I₂, J with its derivatives by them.
    #[inline(always)]
    pub(super) fn at<R: Real, const G: usize, const H: usize>(&self, invariants: [R; 3]) -> Jet<R, G, H> {
        let mut jets: [Jet<R, G, H>; SLOTS] = [Jet::constant(invariants[0]); SLOTS];
        let mut last = 0;
        for &Step { operation, slots: [a, b, slot], .. } in &self.steps {
            let (a, b) = (&jets[a], &jets[b]);
            jets[slot] = match operation {
                Operation::Constant(value) => Jet::constant(invariants[0].constant(value)),
                Operation::Variable(k) => Jet::variable(invariants[k], k),
                Operation::Shift(by) => a.shifted(by),
                Operation::Scale(by) => a.scaled(by),
                Operation::Add => a.plus(*b, 1.0),
                Operation::Subtract => a.plus(*b, -1.0),
                Operation::Multiply => a.times(*b),
                Operation::Larger => a.larger(*b),
                Operation::Smaller => a.scaled(-1.0).larger(b.scaled(-1.0)).scaled(-1.0),
                unary => a.chained(unary.chain(a.value)),
            };
            last = slot;
        }
        jets[last]
    }

    /// Returns the derivatives by I₁, I₂, J there.
    #[inline(always)]
    pub(super) fn gradient<R: Real>(&self, invariants: [R; 3]) -> [R; 3] {
        let count = self.steps.len();
        if count > SHORT {
            return self.at::<R, 3, 0>(invariants).first;
        }
        let zero = invariants[0].constant(0.0);
        let mut values = [zero; SHORT];
        for (number, &Step { operation, operands: [a, b], .. }) in self.steps.iter().enumerate() {
            let (a, b) = (values[a], values[b]);
            values[number] = match operation {
                Operation::Constant(value) => zero + value,
                Operation::Variable(k) => invariants[k],
                Operation::Add => a + b,
                Operation::Subtract => a - b,
                Operation::Multiply => a * b,
                Operation::Larger => (a - b).if_positive(a, b),
                Operation::Smaller => (a - b).if_positive(b, a),
                unary => unary.chain(a)[0],
            };
        }
        // The derivatives of the result by each step.
        let mut by = [zero; SHORT];
        by[count - 1] = zero + 1.0;
        let mut gradient = [zero; 3];
        for (number, &Step { operation, operands: [i, j], .. }) in self.steps.iter().enumerate().rev() {
            let own = by[number];
            let (a, b) = (values[i], values[j]);
            match operation {
                Operation::Constant(_) => {}
                Operation::Variable(k) => gradient[k] = own,
                Operation::Add => {
                    by[i] = by[i] + own;
                    by[j] = by[j] + own;
                }
                Operation::Subtract => {
                    by[i] = by[i] + own;
                    by[j] = by[j] - own;
                }
                Operation::Multiply => {
                    by[i] = own.mul_add(b, by[i]);
                    by[j] = own.mul_add(a, by[j]);
                }
                Operation::Larger => {
                    by[i] = by[i] + (a - b).if_positive(own, zero);
                    by[j] = by[j] + (a - b).if_positive(zero, own);
                }
                Operation::Smaller => {
                    by[i] = by[i] + (a - b).if_positive(zero, own);
                    by[j] = by[j] + (a - b).if_positive(own, zero);
                }
                unary => by[i] = own.mul_add(unary.chain(a)[1], by[i]),
            }
        }
        gradient
    }

    /// Combines two parts by a binary operation, with constants folded.
    fn combined(&mut self, a: Part, b: Part, code: Code) -> Result<Part, String> {
        use Part::Number;
        let is_power = matches!(code, Code::Power) || matches!(code, Code::Binary(f) if f.name == "pow");
        if is_power {
            return match (a, b) {
                (Number(a), Number(b)) => Ok(Number(a.powf(b))),
                (a, Number(p)) => Ok(match p {
                    0.0 => Number(1.0),
                    1.0 => a,
                    p if p.fract() == 0.0 && (2.0..=8.0).contains(&p) => {
                        self.then(a, Operation::Raise(p as u32))
                    }
                    -1.0 => self.then(a, Operation::Reciprocal),
                    p if p.fract() == 0.0 && (-8.0..=-2.0).contains(&p) => {
                        let a = self.then(a, Operation::Raise(-p as u32));
                        self.then(a, Operation::Reciprocal)
                    }
                    p => self.then(a, Operation::Power(p)),
                }),
                _ => Err("an exponent must be a constant".to_owned()),
            };
        }
        Ok(match (a, code, b) {
            (Number(a), Code::Add, Number(b)) => Number(a + b),
            (Number(a), Code::Subtract, Number(b)) => Number(a - b),
            (Number(a), Code::Multiply, Number(b)) => Number(a * b),
            (Number(a), Code::Divide, Number(b)) => Number(a / b),
            (Number(a), Code::Binary(f), Number(b)) => Number((f.value)(a, b)),
            (a, Code::Add, Number(b)) => self.then(a, Operation::Shift(b)),
            (Number(a), Code::Add, b) => self.then(b, Operation::Shift(a)),
            (a, Code::Subtract, Number(b)) => self.then(a, Operation::Shift(-b)),
            (Number(a), Code::Subtract, b) => {
                let b = self.then(b, Operation::Scale(-1.0));
                self.then(b, Operation::Shift(a))
            }
            (a, Code::Multiply, Number(b)) => self.then(a, Operation::Scale(b)),
            (Number(a), Code::Multiply, b) => self.then(b, Operation::Scale(a)),
            (a, Code::Divide, Number(b)) => self.then(a, Operation::Scale(1.0 / b)),
            (Number(a), Code::Divide, b) => {
                let b = self.then(b, Operation::Reciprocal);
                self.then(b, Operation::Scale(a))
            }
            (a, Code::Add, b) => self.with(a, b, Operation::Add),
            (a, Code::Subtract, b) => self.with(a, b, Operation::Subtract),
            (a, Code::Multiply, b) => self.with(a, b, Operation::Multiply),
            (a, Code::Divide, b) => {
                let b = self.then(b, Operation::Reciprocal);
                self.with(a, b, Operation::Multiply)
            }
            (a, Code::Binary(f), b) if f.name == "max" => self.with(a, b, Operation::Larger),
            (a, Code::Binary(f), b) if f.name == "min" => self.with(a, b, Operation::Smaller),
            (_, Code::Binary(f), _) => return Err(format!("`{}` is not allowed in an energy", f.name)),
            _ => return Err("an operation that is not binary".to_owned()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::jet::PAIRS;
    use super::*;

    /// First and second derivatives agree with differences of the values and of the first derivatives.
    #[test]
    fn derivatives_are_those_of_the_value() {
        for source in [
            "a*I1^3 - I2/J + 2",
            "exp(-I1/J)*sin(I2) + cos(J)*tan(I1/10)",
            "log(I1*J) + sqrt(I2 + I1) - J^(-2/3)*I1",
            "max(I1, 2*I2)^2 + min(J, I1)*tanh(I2)",
            "asin(J/4) + acos(J/5) + atan(I1) + sinh(J) + cosh(I2/3) - pow(I1, -2) + abs(I2 - 9)^3",
        ] {
            let formula = Expression::parse(source, &["I1", "I2", "J", "a"]).unwrap();
            let program = Program::new(&formula, &[0.7]).unwrap();
            let at = [3.1, 2.9, 0.8];
            let jet: Jet<f64, 3, 6> = program.at(at);
            let gradient = program.gradient(at);
            assert!(
                (0..3).all(|k| (gradient[k] - jet.first[k]).abs() <= 1e-13 * jet.first[k].abs()),
                "{source}"
            );
            assert!((jet.value - formula.evaluate(&[3.1, 2.9, 0.8, 0.7])).abs() < 1e-13, "{source}");
            for k in 0..3 {
                let moved = |by: f64| {
                    let mut at = at;
                    at[k] += by;
                    program.at::<f64, 3, 6>(at)
                };
                let (ahead, behind) = (moved(1e-5), moved(-1e-5));
                let slope = (ahead.value - behind.value) / 2e-5;
                assert!((slope - jet.first[k]).abs() < 1e-7 * slope.abs().max(1.0), "{source}: {k}");
                for (entry, &(i, j)) in PAIRS.iter().enumerate().filter(|(_, (_, j))| *j == k) {
                    let slope = (ahead.first[i] - behind.first[i]) / 2e-5;
                    let found = jet.second[entry];
                    assert!((slope - found).abs() < 1e-7 * slope.abs().max(1.0), "{source}: {i} {j}");
                }
            }
        }
    }

    #[test]
    fn parts_that_occur_several_times_are_computed_once() {
        let count = |source| {
            let formula = Expression::parse(source, &["I1", "I2", "J"]).unwrap();
            Program::new(&formula, &[]).unwrap().steps.len()
        };
        assert_eq!(count("log(J)^2 + 3*log(J)"), count("log(J)^2 + 3*J"));
        assert_eq!(count("(I1 - I2*J)*(I1 - I2*J)"), count("(I1 - I2*J)^2"));
        // A power of zero is one, whatever its base is.
        assert_eq!(count("I1 + log(I2)^0"), count("I1 + 1"));
    }

    /// A formula with more steps than are differentiated backward.
    #[test]
    fn long_formulas_have_the_derivatives_of_their_parts() {
        let parts: Vec<String> = (2..9).map(|n| format!("{n}*(I1*I2 - J/{n})^{n}")).collect();
        let program = |source: &str| {
            Program::new(&Expression::parse(source, &["I1", "I2", "J"]).unwrap(), &[]).unwrap()
        };
        let whole = program(&parts.join(" + "));
        assert!(whole.steps.len() > SHORT);
        let at = [1.1, 0.9, 0.8];
        let mut sum = [0.0; 3];
        for part in &parts {
            let part = program(part);
            assert!(part.steps.len() < SHORT);
            part.gradient(at).iter().zip(&mut sum).for_each(|(part, sum)| *sum += part);
        }
        let gradient = whole.gradient(at);
        assert!((0..3).all(|k| (gradient[k] - sum[k]).abs() < 1e-13 * sum[k].abs()), "{gradient:?} {sum:?}");
    }

    #[test]
    fn formulas_without_two_derivatives_are_refused() {
        for (source, part) in
            [("floor(J)", "`floor` jumps"), ("2^J", "exponent"), ("atan2(J, I1)", "`atan2`")]
        {
            let formula = Expression::parse(source, &["I1", "I2", "J"]).unwrap();
            let error = Program::new(&formula, &[]).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
