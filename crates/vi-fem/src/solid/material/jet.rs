//! Formulas of the invariants I₁, I₂, J, evaluated with their derivatives in SIMD lanes.
//!
//! A [`Program`] is a formula with constants folded. A [`Jet`] is a value with G first and H second derivatives:
//! `Jet<R, 0, 0>` is a value alone, `Jet<R, 3, 0>` has the gradient, `Jet<R, 3, 6>` also the packed lower triangle of
//! the second derivatives.

use crate::error::FemError;
use crate::lanes::real::Real;
use crate::path::expression::{Code, Expression, Unary};

/// Largest number of intermediate values of a formula; more would not stay in the first cache.
const DEPTH: usize = 12;

/// A value with derivatives by three variables.
#[derive(Clone, Copy)]
pub(crate) struct Jet<R, const G: usize, const H: usize> {
    pub(crate) value: R,
    /// ∂/∂(variable k).
    pub(crate) first: [R; G],
    /// ∂²/∂(variable i)∂(variable j), packed as (0,0) (1,0) (1,1) (2,0) (2,1) (2,2).
    pub(crate) second: [R; H],
}

/// Rows and columns of the packed second derivatives.
const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

impl<R: Real, const G: usize, const H: usize> Jet<R, G, H> {
    /// Returns a constant.
    #[inline(always)]
    fn constant(value: R) -> Self {
        let zero = value.constant(0.0);
        Self { value, first: [zero; G], second: [zero; H] }
    }

    /// Returns variable number k.
    #[inline(always)]
    fn variable(value: R, k: usize) -> Self {
        let mut jet = Self::constant(value);
        if k < G {
            jet.first[k] = value.constant(1.0);
        }
        jet
    }

    #[inline(always)]
    fn shifted(mut self, by: f64) -> Self {
        self.value = self.value + by;
        self
    }

    #[inline(always)]
    fn scaled(mut self, by: f64) -> Self {
        self.value = self.value * by;
        for k in 0..G {
            self.first[k] = self.first[k] * by;
        }
        for k in 0..H {
            self.second[k] = self.second[k] * by;
        }
        self
    }

    #[inline(always)]
    fn plus(mut self, other: Self, sign: f64) -> Self {
        let sign = self.value.constant(sign);
        self.value = other.value.mul_add(sign, self.value);
        for k in 0..G {
            self.first[k] = other.first[k].mul_add(sign, self.first[k]);
        }
        for k in 0..H {
            self.second[k] = other.second[k].mul_add(sign, self.second[k]);
        }
        self
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let mut out = self;
        out.value = self.value * other.value;
        for k in 0..G {
            out.first[k] = self.first[k].mul_add(other.value, self.value * other.first[k]);
        }
        for k in 0..H {
            let (i, j) = PAIRS[k];
            let mixed = self.first[i].mul_add(other.first[j], self.first[j] * other.first[i]);
            let outer = self.second[k].mul_add(other.value, self.value * other.second[k]);
            out.second[k] = mixed + outer;
        }
        out
    }

    /// Returns f of this value, from f and its derivatives there.
    #[inline(always)]
    fn chained(self, value: R, by: R, by_by: R) -> Self {
        let mut out = self;
        out.value = value;
        for k in 0..G {
            out.first[k] = by * self.first[k];
        }
        for k in 0..H {
            let (i, j) = PAIRS[k];
            out.second[k] = by_by.mul_add(self.first[i] * self.first[j], by * self.second[k]);
        }
        out
    }

    #[inline(always)]
    fn reciprocal(self) -> Self {
        let inverse = self.value.constant(1.0) / self.value;
        let square = inverse * inverse;
        self.chained(inverse, -square, square * inverse * 2.0)
    }

    /// Returns xⁿ.
    #[inline(always)]
    fn raised(self, exponent: u32) -> Self {
        let x = self.value;
        // x^(n − 2), with n ≥ 2
        let mut power = x.constant(1.0);
        for _ in 2..exponent {
            power = power * x;
        }
        let n = f64::from(exponent);
        self.chained(power * x * x, power * x * n, power * (n * (n - 1.0)))
    }

    /// Returns x^p for x > 0, NaN elsewhere.
    #[inline(always)]
    fn power(self, p: f64) -> Self {
        let x = self.value;
        let value = x.map(|x| if x > 0.0 { x.powf(p) } else { f64::NAN });
        let first = value / x * p;
        self.chained(value, first, first / x * (p - 1.0))
    }

    #[inline(always)]
    fn of(self, function: &Unary) -> Self {
        let x = self.value;
        match (function.name, function.derivatives) {
            ("log", _) => {
                let inverse = x.constant(1.0) / x;
                self.chained(x.ln(), inverse, -(inverse * inverse))
            }
            ("sqrt", _) => {
                let root = x.sqrt();
                let first = x.constant(0.5) / root;
                self.chained(root, first, first / x * -0.5)
            }
            (_, Some(derivatives)) => {
                let (first, second) = (x.map(|x| derivatives(x)[0]), x.map(|x| derivatives(x)[1]));
                self.chained(x.map(function.value), first, second)
            }
            // `Program::new` refuses functions with jumps.
            (_, None) => Self::constant(x.constant(f64::NAN)),
        }
    }

    /// Returns the larger value with its derivatives.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        let ahead = self.value - other.value;
        let mut out = self;
        out.value = ahead.if_positive(self.value, other.value);
        for k in 0..G {
            out.first[k] = ahead.if_positive(self.first[k], other.first[k]);
        }
        for k in 0..H {
            out.second[k] = ahead.if_positive(self.second[k], other.second[k]);
        }
        out
    }
}

#[derive(Debug, Clone, Copy)]
enum Operation {
    Constant(f64),
    Variable(usize),
    Shift(f64),
    Scale(f64),
    Add,
    Subtract,
    Multiply,
    Reciprocal,
    Raise(u32),
    Power(f64),
    Unary(&'static Unary),
    Larger,
    Smaller,
}

/// A formula of I₁, I₂ and J with folded constants.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    operations: Vec<Operation>,
    /// Whether I₂ occurs.
    pub(crate) uses_second: bool,
}

/// A part of a formula while its program is made.
enum Part {
    Number(f64),
    Code(Vec<Operation>),
}

impl Part {
    fn code(self) -> Vec<Operation> {
        match self {
            Self::Number(value) => vec![Operation::Constant(value)],
            Self::Code(code) => code,
        }
    }

    fn then(self, operation: Operation) -> Self {
        let mut code = self.code();
        code.push(operation);
        Self::Code(code)
    }

    fn with(self, other: Self, operation: Operation) -> Self {
        let mut code = self.code();
        code.extend(other.code());
        code.push(operation);
        Self::Code(code)
    }
}

impl Program {
    /// Makes the program of a formula whose variables 0, 1, 2 are I₁, I₂, J and whose others have these `values`.
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] for a function with jumps, an exponent that is not constant, or a formula that
    /// nests too deeply.
    pub(crate) fn new(formula: &Expression, values: &[f64]) -> Result<Self, FemError> {
        let wrong = |problem: String| FemError::Invalid { what: "energy", problem };
        let mut parts: Vec<Part> = Vec::new();
        // The parser gives every operation its operands.
        let nothing = || Part::Number(f64::NAN);
        for code in formula.code() {
            let part = match *code {
                Code::Number(value) => Part::Number(value),
                Code::Variable(k) if k < 3 => Part::Code(vec![Operation::Variable(k)]),
                Code::Variable(k) => Part::Number(values[k - 3]),
                Code::Negate => match parts.pop().unwrap_or_else(nothing) {
                    Part::Number(value) => Part::Number(-value),
                    part => part.then(Operation::Scale(-1.0)),
                },
                Code::Unary(function) => match parts.pop().unwrap_or_else(nothing) {
                    Part::Number(value) => Part::Number((function.value)(value)),
                    part if function.derivatives.is_some() => part.then(Operation::Unary(function)),
                    _ => return Err(wrong(format!("`{}` jumps, but an energy is smooth", function.name))),
                },
                binary => {
                    let (b, a) = (parts.pop().unwrap_or_else(nothing), parts.pop().unwrap_or_else(nothing));
                    combined(a, b, binary).map_err(wrong)?
                }
            };
            parts.push(part);
        }
        let operations = parts.pop().unwrap_or_else(nothing).code();
        let uses_second = operations.iter().any(|operation| matches!(operation, Operation::Variable(1)));
        let program = Self { operations, uses_second };
        if program.depth() > DEPTH {
            return Err(wrong(format!(
                "the formula has more than {DEPTH} pending values: nest it less deeply"
            )));
        }
        Ok(program)
    }

    /// Returns the program that gives NaN everywhere.
    pub(crate) fn undefined() -> Self {
        Self { operations: vec![Operation::Constant(f64::NAN)], uses_second: false }
    }

    /// Returns the largest number of values on the stack.
    fn depth(&self) -> usize {
        let (mut now, mut most) = (0_usize, 0);
        for operation in &self.operations {
            match operation {
                Operation::Constant(_) | Operation::Variable(_) => now += 1,
                Operation::Add
                | Operation::Subtract
                | Operation::Multiply
                | Operation::Larger
                | Operation::Smaller => now -= 1,
                _ => {}
            }
            most = most.max(now);
        }
        most
    }

    /// Returns the value at I₁, I₂, J with its derivatives by them.
    #[inline(always)]
    pub(crate) fn at<R: Real, const G: usize, const H: usize>(&self, invariants: [R; 3]) -> Jet<R, G, H> {
        let mut stack = [Jet::constant(invariants[0]); DEPTH];
        let mut top = 0;
        for operation in &self.operations {
            match *operation {
                Operation::Constant(value) => {
                    stack[top] = Jet::constant(invariants[0].constant(value));
                    top += 1;
                }
                Operation::Variable(k) => {
                    stack[top] = Jet::variable(invariants[k], k);
                    top += 1;
                }
                Operation::Shift(by) => stack[top - 1] = stack[top - 1].shifted(by),
                Operation::Scale(by) => stack[top - 1] = stack[top - 1].scaled(by),
                Operation::Reciprocal => stack[top - 1] = stack[top - 1].reciprocal(),
                Operation::Raise(exponent) => stack[top - 1] = stack[top - 1].raised(exponent),
                Operation::Power(exponent) => stack[top - 1] = stack[top - 1].power(exponent),
                Operation::Unary(function) => stack[top - 1] = stack[top - 1].of(function),
                Operation::Add => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].plus(stack[top], 1.0);
                }
                Operation::Subtract => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].plus(stack[top], -1.0);
                }
                Operation::Multiply => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].times(stack[top]);
                }
                Operation::Larger => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].larger(stack[top]);
                }
                Operation::Smaller => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].scaled(-1.0).larger(stack[top].scaled(-1.0)).scaled(-1.0);
                }
            }
        }
        stack[0]
    }
}

/// Combines two parts by a binary operation, with constants folded.
fn combined(a: Part, b: Part, code: Code) -> Result<Part, String> {
    use Part::Number;
    let is_power = matches!(code, Code::Power) || matches!(code, Code::Binary(f) if f.name == "pow");
    if is_power {
        return match (a, b) {
            (Number(a), Number(b)) => Ok(Number(a.powf(b))),
            (a, Number(p)) => Ok(match p {
                0.0 => Number(1.0),
                1.0 => a,
                p if p.fract() == 0.0 && (2.0..=8.0).contains(&p) => a.then(Operation::Raise(p as u32)),
                -1.0 => a.then(Operation::Reciprocal),
                p if p.fract() == 0.0 && (-8.0..=-2.0).contains(&p) => {
                    a.then(Operation::Raise(-p as u32)).then(Operation::Reciprocal)
                }
                p => a.then(Operation::Power(p)),
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
        (a, Code::Add, Number(b)) => a.then(Operation::Shift(b)),
        (Number(a), Code::Add, b) => b.then(Operation::Shift(a)),
        (a, Code::Subtract, Number(b)) => a.then(Operation::Shift(-b)),
        (Number(a), Code::Subtract, b) => b.then(Operation::Scale(-1.0)).then(Operation::Shift(a)),
        (a, Code::Multiply, Number(b)) => a.then(Operation::Scale(b)),
        (Number(a), Code::Multiply, b) => b.then(Operation::Scale(a)),
        (a, Code::Divide, Number(b)) => a.then(Operation::Scale(1.0 / b)),
        (Number(a), Code::Divide, b) => b.then(Operation::Reciprocal).then(Operation::Scale(a)),
        (a, Code::Add, b) => a.with(b, Operation::Add),
        (a, Code::Subtract, b) => a.with(b, Operation::Subtract),
        (a, Code::Multiply, b) => a.with(b, Operation::Multiply),
        (a, Code::Divide, b) => a.with(b.then(Operation::Reciprocal), Operation::Multiply),
        (a, Code::Binary(f), b) if f.name == "max" => a.with(b, Operation::Larger),
        (a, Code::Binary(f), b) if f.name == "min" => a.with(b, Operation::Smaller),
        (_, Code::Binary(f), _) => return Err(format!("`{}` is not allowed in an energy", f.name)),
        _ => return Err("an operation that is not binary".to_owned()),
    })
}

#[cfg(test)]
mod tests {
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
