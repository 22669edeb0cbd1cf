//! Parses formulas of scene files such as `"sin(2*pi*t)"` once, and evaluates them fast. Formulas can do arithmetic
//! only.
//!
//! The grammar, from the weakest to the strongest binding: `+ -`, `* /`, unary `-`, `^` (right-associative: 2^3^2 =
//! 512, and -x^2 = -(x^2)), then numbers, names, calls and parentheses.

use crate::error::FemError;

/// Maximum depth of nested parentheses and calls.
const MAX_DEPTH: usize = 100;

/// Maximum number of intermediate values that a formula may need at the same time.
const MAX_STACK: usize = 64;

/// A function of one argument.
#[derive(Debug)]
pub(crate) struct Unary {
    pub(crate) name: &'static str,
    pub(crate) value: fn(f64) -> f64,
    /// First and second derivative at x; `None` for a function with jumps.
    pub(crate) derivatives: Option<fn(f64) -> [f64; 2]>,
}

const fn smooth(name: &'static str, value: fn(f64) -> f64, derivatives: fn(f64) -> [f64; 2]) -> Unary {
    Unary { name, value, derivatives: Some(derivatives) }
}

const fn jumping(name: &'static str, value: fn(f64) -> f64) -> Unary {
    Unary { name, value, derivatives: None }
}

/// The functions of one argument that a formula may call.
static UNARY: [Unary; 15] = [
    smooth("sin", f64::sin, |x| [x.cos(), -x.sin()]),
    smooth("cos", f64::cos, |x| [-x.sin(), -x.cos()]),
    smooth("tan", f64::tan, |x| {
        let first = 1.0 + x.tan() * x.tan();
        [first, 2.0 * x.tan() * first]
    }),
    smooth("asin", f64::asin, |x| {
        let first = 1.0 / (1.0 - x * x).sqrt();
        [first, x * first * first * first]
    }),
    smooth("acos", f64::acos, |x| {
        let first = -1.0 / (1.0 - x * x).sqrt();
        [first, x * first * first * first]
    }),
    smooth("atan", f64::atan, |x| {
        let first = 1.0 / (1.0 + x * x);
        [first, -2.0 * x * first * first]
    }),
    smooth("sinh", f64::sinh, |x| [x.cosh(), x.sinh()]),
    smooth("cosh", f64::cosh, |x| [x.sinh(), x.cosh()]),
    smooth("tanh", f64::tanh, |x| {
        let first = 1.0 - x.tanh() * x.tanh();
        [first, -2.0 * x.tanh() * first]
    }),
    smooth("exp", f64::exp, |x| [x.exp(), x.exp()]),
    smooth("log", f64::ln, |x| [1.0 / x, -1.0 / (x * x)]),
    smooth("sqrt", f64::sqrt, |x| [0.5 / x.sqrt(), -0.25 / (x * x.sqrt())]),
    smooth("abs", f64::abs, |x| [x.signum(), 0.0]),
    jumping("floor", f64::floor),
    jumping("step", |x| if x >= 0.0 { 1.0 } else { 0.0 }),
];

/// A function of two arguments.
#[derive(Debug)]
pub(crate) struct Binary {
    pub(crate) name: &'static str,
    pub(crate) value: fn(f64, f64) -> f64,
}

/// The functions of two arguments that a formula may call.
static BINARY: [Binary; 4] = [
    Binary { name: "min", value: f64::min },
    Binary { name: "max", value: f64::max },
    Binary { name: "atan2", value: f64::atan2 },
    Binary { name: "pow", value: f64::powf },
];

/// An operation of a formula in reverse Polish notation.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Code {
    Number(f64),
    Variable(usize),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Unary(&'static Unary),
    Binary(&'static Binary),
}

/// A formula in named variables.
///
/// ```
/// let ramp = vi_fem::Expression::parse("min(t / 0.5, 1)", &["t"])?;
/// assert_eq!(ramp.evaluate(&[0.25]), 0.5);
/// # Ok::<(), vi_fem::FemError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Expression {
    source: String,
    /// The operations in reverse Polish notation.
    code: Vec<Code>,
}

impl Expression {
    /// Parses `source`. The name `variables[k]` stands for argument k of [`Expression::evaluate`]. A formula may also
    /// use `pi` and the functions `sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs floor step min max
    /// atan2 pow`; `step(x)` is 0 for x < 0 and 1 otherwise.
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] with the position in the formula and what is allowed there.
    pub fn parse(source: &str, variables: &[&str]) -> Result<Self, FemError> {
        let mut parser = Parser { source, rest: source, variables, code: Vec::new(), depth: 0 };
        parser.sum()?;
        parser.skip_space();
        if !parser.rest.is_empty() {
            return Err(parser.error("an operator or the end"));
        }
        if stack_needed(&parser.code) > MAX_STACK {
            return Err(parser.error("a formula with fewer pending operations (at most 64)"));
        }
        Ok(Self { source: source.into(), code: parser.code })
    }

    /// Returns the operations in reverse Polish notation.
    pub(crate) fn code(&self) -> &[Code] {
        &self.code
    }

    /// Returns the text that the formula was parsed from.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Returns whether the formula reads variable number k.
    pub fn uses(&self, variable: usize) -> bool {
        self.code.iter().any(|code| matches!(code, Code::Variable(k) if *k == variable))
    }

    /// Returns the value; NaN where a function is not defined.
    pub fn evaluate(&self, variables: &[f64]) -> f64 {
        let mut stack = [0.0; MAX_STACK];
        let mut top = 0;
        for code in &self.code {
            match *code {
                Code::Number(value) => {
                    stack[top] = value;
                    top += 1;
                }
                Code::Variable(k) => {
                    stack[top] = variables[k];
                    top += 1;
                }
                Code::Negate => stack[top - 1] = -stack[top - 1],
                Code::Unary(f) => stack[top - 1] = (f.value)(stack[top - 1]),
                binary => {
                    let (a, b) = (stack[top - 2], stack[top - 1]);
                    top -= 1;
                    stack[top - 1] = match binary {
                        Code::Add => a + b,
                        Code::Subtract => a - b,
                        Code::Multiply => a * b,
                        Code::Divide => a / b,
                        Code::Binary(f) => (f.value)(a, b),
                        _ => a.powf(b),
                    };
                }
            }
        }
        stack[0]
    }
}

/// Returns the largest number of values on the stack during the evaluation of `code`.
fn stack_needed(code: &[Code]) -> usize {
    let (mut now, mut most) = (0_usize, 0);
    for code in code {
        match code {
            Code::Number(_) | Code::Variable(_) => now += 1,
            Code::Negate | Code::Unary(_) => {}
            _ => now -= 1,
        }
        most = most.max(now);
    }
    most
}

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.source == other.source
    }
}

/// Number of characters that a message shows on each side of a fault in a long formula.
const NEAR: usize = 40;

struct Parser<'a> {
    source: &'a str,
    rest: &'a str,
    variables: &'a [&'a str],
    code: Vec<Code>,
    depth: usize,
}

impl<'a> Parser<'a> {
    fn error(&self, expected: &str) -> FemError {
        let place = self.source[..self.source.len() - self.rest.len()].chars().count() + 1;
        let found = self.rest.chars().next().map_or("the end".to_owned(), |c| format!("'{c}'"));
        let problem =
            format!("\"{}\", character {place}: expected {expected}, found {found}", self.excerpt(place));
        FemError::Invalid { what: "expression", problem }
    }

    /// Returns the formula, or of a long one what is near this character, counted from 1.
    fn excerpt(&self, place: usize) -> String {
        let count = self.source.chars().count();
        if count <= 4 * NEAR {
            return self.source.to_owned();
        }
        let (first, last) = (place.saturating_sub(NEAR), (place + NEAR).min(count));
        let part: String = self.source.chars().skip(first).take(last - first).collect();
        let [before, after] = [first > 0, last < count].map(|is_cut| if is_cut { "…" } else { "" });
        format!("{before}{part}{after}")
    }

    fn skip_space(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take(&mut self, symbol: char) -> bool {
        self.skip_space();
        match self.rest.strip_prefix(symbol) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn expect(&mut self, symbol: char) -> Result<(), FemError> {
        if self.take(symbol) { Ok(()) } else { Err(self.error(&format!("'{symbol}'"))) }
    }

    fn sum(&mut self) -> Result<(), FemError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(self.error("fewer nested parentheses (at most 100)"));
        }
        self.product()?;
        loop {
            let code = if self.take('+') {
                Code::Add
            } else if self.take('-') {
                Code::Subtract
            } else {
                break;
            };
            self.product()?;
            self.code.push(code);
        }
        self.depth -= 1;
        Ok(())
    }

    fn product(&mut self) -> Result<(), FemError> {
        self.signed()?;
        loop {
            let code = if self.take('*') {
                Code::Multiply
            } else if self.take('/') {
                Code::Divide
            } else {
                return Ok(());
            };
            self.signed()?;
            self.code.push(code);
        }
    }

    /// Parses signs, then a power; the exponent may have signs again.
    fn signed(&mut self) -> Result<(), FemError> {
        let mut negative = false;
        loop {
            if self.take('-') {
                negative = !negative;
            } else if !self.take('+') {
                break;
            }
        }
        self.atom()?;
        if self.take('^') {
            self.depth += 1;
            if self.depth > MAX_DEPTH {
                return Err(self.error("fewer nested powers (at most 100)"));
            }
            self.signed()?;
            self.depth -= 1;
            self.code.push(Code::Power);
        }
        if negative {
            self.code.push(Code::Negate);
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), FemError> {
        if self.take('(') {
            self.sum()?;
            return self.expect(')');
        }
        let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let length = self.rest.find(|c| !word(c)).unwrap_or(self.rest.len());
        match self.rest.chars().next() {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() => self.name(length),
            _ => Err(self.error("a number, a name or '('")),
        }
    }

    fn number(&mut self) -> Result<(), FemError> {
        let bytes = self.rest.as_bytes();
        let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
        let mut length = digits(0);
        if bytes.get(length) == Some(&b'.') {
            length += 1 + digits(length + 1);
        }
        if matches!(bytes.get(length), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
            let exponent = digits((length + 1 + sign).min(bytes.len()));
            if exponent > 0 {
                length += 1 + sign + exponent;
            }
        }
        match self.rest[..length].parse() {
            Ok(value) => {
                self.code.push(Code::Number(value));
                self.rest = &self.rest[length..];
                Ok(())
            }
            Err(_) => Err(self.error("a number")),
        }
    }

    fn name(&mut self, length: usize) -> Result<(), FemError> {
        let name = &self.rest[..length];
        if let Some(k) = self.variables.iter().position(|variable| *variable == name) {
            self.rest = &self.rest[length..];
            self.code.push(Code::Variable(k));
        } else if name == "pi" {
            self.rest = &self.rest[length..];
            self.code.push(Code::Number(std::f64::consts::PI));
        } else if let Some(f) = UNARY.iter().find(|known| known.name == name) {
            self.rest = &self.rest[length..];
            self.expect('(')?;
            self.sum()?;
            self.expect(')')?;
            self.code.push(Code::Unary(f));
        } else if let Some(f) = BINARY.iter().find(|known| known.name == name) {
            self.rest = &self.rest[length..];
            self.expect('(')?;
            self.sum()?;
            self.expect(',')?;
            self.sum()?;
            self.expect(')')?;
            self.code.push(Code::Binary(f));
        } else {
            let functions = UNARY.iter().map(|f| f.name).chain(BINARY.iter().map(|f| f.name));
            let known: Vec<_> = self.variables.iter().copied().chain(["pi"]).chain(functions).collect();
            return Err(self.error(&format!("one of {}, not `{name}`", known.join(" "))));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(source: &str) -> f64 {
        Expression::parse(source, &["t", "x"]).unwrap().evaluate(&[0.5, 3.0])
    }

    #[test]
    fn arithmetic_binds_as_in_mathematics() {
        for (source, expected) in [
            ("1 + 2*3", 7.0),
            ("-x^2", -9.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("x*-2", -6.0),
            ("(1-t)*(1+t)", 0.75),
            ("1 - 2 - 3", -4.0),
            ("8/4/2", 1.0),
            ("min(t, 1) + max(x, 2*t)", 3.5),
            ("1.5e-3*x", 1.5e-3 * 3.0),
            (".5 + 2.", 2.5),
            ("step(t - 0.5) - step(t - 0.6)", 1.0),
            ("--t", 0.5),
        ] {
            assert_eq!(value(source), expected, "{source}");
        }
        assert!((value("sin(pi/6)") - 0.5).abs() < 1e-15);
        assert!((value("exp(log(x))") - 3.0).abs() < 1e-15);
    }

    #[test]
    fn errors_name_the_place_and_what_is_allowed() {
        for (source, part) in [
            ("", "character 1: expected a number"),
            ("t +", "character 4"),
            ("(t", "expected ')'"),
            ("2 t", "expected an operator"),
            ("foo(t)", "not `foo`"),
            ("sin t", "expected '('"),
            ("min(1)", "expected ','"),
            ("1 + ü", "found 'ü'"),
        ] {
            let error = Expression::parse(source, &["t"]).unwrap_err().to_string();
            assert!(error.contains(part), "{source}: {error}");
        }
        for deep in ["(".repeat(100_000), "-".repeat(100_000), "2^".repeat(100_000)] {
            assert!(Expression::parse(&deep, &["t"]).is_err());
        }
    }

    #[test]
    fn a_formula_that_pends_too_much_is_refused() {
        let nested = |depth: usize| "1+2*min(3,".repeat(depth) + "t" + &")".repeat(depth);
        assert!(Expression::parse(&nested(20), &["t"]).unwrap().evaluate(&[1.0]).is_finite());
        assert!(Expression::parse(&nested(40), &["t"]).is_err());
    }
}
