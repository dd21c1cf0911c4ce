//! Arithmetic expressions: numbers, names, `+ - * / ^`, parentheses and a few functions. An expression has no loops, so
//! that its value takes time linear in its length.

use crate::diagnostic::closest_word;
use std::fmt::Write;

/// The deepest nesting of parentheses.
const MAX_DEPTH: usize = 64;
/// The longest expression in bytes.
const MAX_LENGTH: usize = 4096;

/// A mistake in an expression, with the bytes of the text that it is about.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ExpressionError {
    pub(crate) start: usize,
    pub(crate) end: usize,
    pub(crate) message: String,
    pub(crate) help: String,
}

/// An expression whose names are places in a list of numbers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Expression {
    /// The steps of a stack machine, each with the bytes of the text that it comes from.
    steps: Vec<(Step, [u32; 2])>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    /// The number at this place of the list.
    Name(u32),
    Negate,
    Operator(Operator),
    Call(&'static Function),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
}

/// A function of expressions.
#[derive(Debug)]
pub(crate) struct Function {
    pub(crate) name: &'static str,
    pub(crate) arguments: usize,
    pub(crate) doc: &'static str,
    value: fn(&[f64]) -> f64,
}

impl PartialEq for Function {
    fn eq(&self, other: &Function) -> bool {
        self.name == other.name
    }
}

/// The functions, in the order of the reference.
pub(crate) static FUNCTIONS: &[Function] = &[
    Function { name: "sin", arguments: 1, doc: "sine of degrees", value: |v| sine(v[0]) },
    Function { name: "cos", arguments: 1, doc: "cosine of degrees", value: |v| sine(v[0] + 90.0) },
    Function { name: "tan", arguments: 1, doc: "tangent of degrees", value: |v| sine(v[0]) / sine(v[0] + 90.0) },
    Function { name: "asin", arguments: 1, doc: "degrees of a sine", value: |v| libm::asin(v[0]).to_degrees() },
    Function { name: "acos", arguments: 1, doc: "degrees of a cosine", value: |v| libm::acos(v[0]).to_degrees() },
    Function {
        name: "atan2",
        arguments: 2,
        doc: "degrees from the x axis to a point, given y and then x",
        value: |v| libm::atan2(v[0], v[1]).to_degrees(),
    },
    Function { name: "sqrt", arguments: 1, doc: "square root", value: |v| v[0].sqrt() },
    Function { name: "exp", arguments: 1, doc: "e to this power", value: |v| libm::exp(v[0]) },
    Function { name: "ln", arguments: 1, doc: "natural logarithm", value: |v| libm::log(v[0]) },
    Function { name: "abs", arguments: 1, doc: "without its sign", value: |v| v[0].abs() },
    Function { name: "floor", arguments: 1, doc: "the next whole number below", value: |v| v[0].floor() },
    Function { name: "round", arguments: 1, doc: "the nearest whole number", value: |v| v[0].round() },
    Function {
        name: "mod",
        arguments: 2,
        doc: "the remainder of a division, from 0 up to the divisor",
        value: |v| v[0] - v[1] * (v[0] / v[1]).floor(),
    },
    Function { name: "min", arguments: 2, doc: "the smaller of two", value: |v| v[0].min(v[1]) },
    Function { name: "max", arguments: 2, doc: "the larger of two", value: |v| v[0].max(v[1]) },
    Function {
        name: "random",
        arguments: 1,
        doc: "a number from 0 to 1 that looks random; the same for the same argument",
        value: |v| random(v[0]),
    },
];

/// The names of constants with their values.
pub(crate) const CONSTANTS: &[(&str, f64)] = &[("pi", std::f64::consts::PI)];

/// The sine of degrees. Multiples of 90 degrees have exact values.
fn sine(degrees: f64) -> f64 {
    let turn = degrees % 360.0;
    let quarter = (turn / 90.0).round();
    let rest = (turn - quarter * 90.0).to_radians();
    match quarter as i32 & 3 {
        0 => libm::sin(rest),
        1 => libm::cos(rest),
        2 => -libm::sin(rest),
        _ => -libm::cos(rest),
    }
}

/// A hash of a number's bits as a number from 0 to 1, without 1 (Steele, Lea, Flood 2014: SplitMix64).
fn random(v: f64) -> f64 {
    // −0 and 0 are one number.
    let mut bits = (v + 0.0).to_bits().wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^= bits >> 31;
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Whether a name can stand in expressions: a letter, then letters, digits and `_`.
pub(crate) fn is_name(text: &str) -> bool {
    text.starts_with(is_name_start) && text.chars().all(is_name_part)
}

/// Whether a name means something in every expression.
pub(crate) fn is_taken(name: &str) -> bool {
    CONSTANTS.iter().any(|(known, _)| *known == name) || FUNCTIONS.iter().any(|function| function.name == name)
}

fn is_name_start(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

fn is_name_part(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

impl Expression {
    /// Parses a text. `names` are the names of the list of numbers; of equal names the last one counts.
    pub(crate) fn parse<'n>(
        text: &str,
        names: impl DoubleEndedIterator<Item = &'n str> + ExactSizeIterator + Clone,
    ) -> Result<Expression, ExpressionError> {
        let known = |name: &str| names.clone().rposition(|known| known == name).map(|place| place as u32);
        let list = || names.clone().map(str::to_owned).collect();
        let mut parser = Parser { text, at: 0, depth: 0, steps: Vec::new(), known: &known, list: &list };
        if text.len() > MAX_LENGTH {
            return Err(parser.error(0, text.len(), format!("an expression may have {MAX_LENGTH} bytes"), ""));
        }
        parser.sum()?;
        parser.skip_blanks();
        if parser.at < text.len() {
            let start = parser.at;
            let next = parser.peek().map_or(0, char::len_utf8);
            let found = &text[start..start + next];
            let help = match found {
                ")" => "a ( is missing before it",
                "," => "a comma stands only between the arguments of a function",
                _ if found.starts_with(is_name_part) || found == "(" => {
                    "between two values stands an operator, such as *"
                }
                _ => OPERATORS,
            };
            return Err(parser.error(start, start + next, format!("\"{found}\" can't stand here"), help));
        }
        Ok(Expression { steps: parser.steps })
    }

    /// The expression of one number.
    pub(crate) fn of_number(number: f64) -> Expression {
        Expression { steps: vec![(Step::Number(number), [0; 2])] }
    }

    /// Whether the value depends on numbers of the list from this place on.
    pub(crate) fn needs(&self, place: usize) -> bool {
        self.steps.iter().any(|(step, _)| matches!(step, Step::Name(name) if *name as usize >= place))
    }

    /// The value with these numbers for the names. `stack` is empty, and is empty afterwards.
    pub(crate) fn value(&self, numbers: &[f64], stack: &mut Vec<f64>) -> Result<f64, ExpressionError> {
        stack.clear();
        for (step, span) in &self.steps {
            let value = match step {
                Step::Number(number) => *number,
                Step::Name(place) => numbers[*place as usize],
                Step::Negate => -stack.pop().unwrap_or_default(),
                Step::Operator(operator) => {
                    let (b, a) = (stack.pop().unwrap_or_default(), stack.pop().unwrap_or_default());
                    operator.value(a, b)
                }
                Step::Call(function) => {
                    let arguments = stack.split_off(stack.len() - function.arguments);
                    (function.value)(&arguments)
                }
            };
            if !value.is_finite() {
                stack.clear();
                return Err(undefined(*step, *span));
            }
            stack.push(value);
        }
        Ok(stack.pop().unwrap_or_default())
    }
}

fn undefined(step: Step, [start, end]: [u32; 2]) -> ExpressionError {
    let message = match step {
        Step::Operator(Operator::Divide) => "this divides by 0, or by nearly 0".into(),
        Step::Operator(Operator::Power) => "this power has no value, or is beyond all numbers".into(),
        Step::Call(function) => format!("{} has no value for this number", function.name),
        _ => "this goes beyond all numbers".into(),
    };
    ExpressionError { start: start as usize, end: end as usize, message, help: String::new() }
}

const OPERATORS: &str = "there are + - * / ^, parentheses, names and functions";

impl Operator {
    fn value(self, a: f64, b: f64) -> f64 {
        match self {
            Operator::Add => a + b,
            Operator::Subtract => a - b,
            Operator::Multiply => a * b,
            Operator::Divide => a / b,
            // Squares are products, so that their last bit is right.
            Operator::Power if b == 2.0 => a * a,
            Operator::Power => libm::pow(a, b),
        }
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    steps: Vec<(Step, [u32; 2])>,
    known: &'a dyn Fn(&str) -> Option<u32>,
    /// The known names, for messages.
    list: &'a dyn Fn() -> Vec<String>,
}

impl Parser<'_> {
    fn error(&self, start: usize, end: usize, message: String, help: &str) -> ExpressionError {
        ExpressionError { start, end: end.max(start + 1).min(self.text.len().max(start)), message, help: help.into() }
    }

    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn skip_blanks(&mut self) {
        self.at += self.text[self.at..].find(|c: char| !c.is_whitespace()).unwrap_or(self.text.len() - self.at);
    }

    fn push(&mut self, step: Step, start: usize, end: usize) {
        self.steps.push((step, [start as u32, end as u32]));
    }

    /// The operator that comes next, if it is one of these.
    fn operator(&mut self, of: &[(char, Operator)]) -> Option<(Operator, usize)> {
        self.skip_blanks();
        let next = self.peek()?;
        let (_, operator) = of.iter().find(|(c, _)| *c == next)?;
        let start = self.at;
        self.at += next.len_utf8();
        Some((*operator, start))
    }

    fn sum(&mut self) -> Result<(), ExpressionError> {
        const SUMS: [(char, Operator); 3] =
            [('+', Operator::Add), ('-', Operator::Subtract), ('−', Operator::Subtract)];
        self.product()?;
        while let Some((operator, start)) = self.operator(&SUMS) {
            let end = self.at;
            self.product()?;
            self.push(Step::Operator(operator), start, end);
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), ExpressionError> {
        const PRODUCTS: [(char, Operator); 5] = [
            ('*', Operator::Multiply),
            ('×', Operator::Multiply),
            ('·', Operator::Multiply),
            ('/', Operator::Divide),
            ('÷', Operator::Divide),
        ];
        self.signed()?;
        while let Some((operator, start)) = self.operator(&PRODUCTS) {
            let end = self.at;
            self.signed()?;
            self.push(Step::Operator(operator), start, end);
        }
        Ok(())
    }

    /// A value with signs before it. −2² is −(2²).
    fn signed(&mut self) -> Result<(), ExpressionError> {
        self.skip_blanks();
        let start = self.at;
        let mut negative = false;
        while let Some(sign @ ('+' | '-' | '−')) = self.peek() {
            self.at += sign.len_utf8();
            negative ^= sign != '+';
            self.skip_blanks();
        }
        self.power()?;
        if negative {
            self.push(Step::Negate, start, start + 1);
        }
        Ok(())
    }

    fn power(&mut self) -> Result<(), ExpressionError> {
        self.atom()?;
        if let Some((operator, start)) = self.operator(&[('^', Operator::Power)]) {
            let end = self.at;
            self.enter(start)?;
            self.signed()?;
            self.depth -= 1;
            self.push(Step::Operator(operator), start, end);
        }
        Ok(())
    }

    fn enter(&mut self, start: usize) -> Result<(), ExpressionError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(self.error(
                start,
                start + 1,
                format!("parentheses may stand {MAX_DEPTH} deep in each other"),
                "",
            ));
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), ExpressionError> {
        self.skip_blanks();
        let start = self.at;
        match self.peek() {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(start),
            Some(c) if is_name_start(c) => self.name(start),
            Some('(') => {
                self.at += 1;
                self.enter(start)?;
                self.sum()?;
                self.depth -= 1;
                self.close(start)
            }
            Some(c) => {
                let message = format!("a number is missing before \"{c}\"");
                Err(self.error(start, start + c.len_utf8(), message, OPERATORS))
            }
            None => {
                let end = self.text.trim_end().len();
                let before = self.text[..end].chars().next_back().map_or(0, char::len_utf8);
                Err(self.error(end - before, end, "a number is missing after this".into(), ""))
            }
        }
    }

    fn close(&mut self, open: usize) -> Result<(), ExpressionError> {
        self.skip_blanks();
        if self.peek() == Some(')') {
            self.at += 1;
            return Ok(());
        }
        match self.peek() {
            None => Err(self.error(open, open + 1, "this ( is never closed".into(), "")),
            Some(c) => {
                let message = format!("\"{c}\" can't stand here");
                Err(self.error(self.at, self.at + c.len_utf8(), message, "an operator or a ) is missing before it"))
            }
        }
    }

    fn number(&mut self, start: usize) -> Result<(), ExpressionError> {
        let rest = &self.text[start..];
        let digits = |from: usize| rest[from..].find(|c: char| !c.is_ascii_digit()).map_or(rest.len(), |n| from + n);
        let mut end = digits(0);
        if rest[end..].starts_with('.') {
            end = digits(end + 1);
        }
        let exponent = rest[end..].strip_prefix(['e', 'E']).map(|tail| tail.strip_prefix(['+', '-']).unwrap_or(tail));
        if let Some(tail) = exponent.filter(|tail| tail.starts_with(|c: char| c.is_ascii_digit())) {
            end = digits(rest.len() - tail.len());
        }
        self.at = start + end;
        match rest[..end].parse::<f64>() {
            Ok(number) if number.is_finite() => {
                self.push(Step::Number(number), start, start + end);
                Ok(())
            }
            _ => Err(self.error(start, start + end, format!("\"{}\" isn't a number", &rest[..end]), "")),
        }
    }

    fn name(&mut self, start: usize) -> Result<(), ExpressionError> {
        let rest = &self.text[start..];
        let name = &rest[..rest.find(|c| !is_name_part(c)).unwrap_or(rest.len())];
        let end = start + name.len();
        self.at = end;
        if let Some(function) = FUNCTIONS.iter().find(|function| function.name == name) {
            return self.call(function, start, end);
        }
        if let Some(place) = (self.known)(name) {
            self.push(Step::Name(place), start, end);
            return Ok(());
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|(known, _)| *known == name) {
            self.push(Step::Number(*value), start, end);
            return Ok(());
        }
        let names = (self.list)();
        let all = names.iter().map(String::as_str).chain(CONSTANTS.iter().map(|(name, _)| *name));
        let all = all.chain(FUNCTIONS.iter().map(|function| function.name));
        let help = match closest_word(name, all) {
            Some(right) => format!("did you mean {right}?"),
            None if names.is_empty() => format!("let {name}=1 gives a number this name"),
            None => {
                let mut help = String::from("there are");
                for (index, name) in names.iter().take(20).enumerate() {
                    let _ = write!(help, "{} {name}", if index == 0 { ":" } else { "," });
                }
                help
            }
        };
        Err(self.error(start, end, format!("no number is called {name}"), &help))
    }

    fn call(&mut self, function: &'static Function, start: usize, end: usize) -> Result<(), ExpressionError> {
        self.skip_blanks();
        let open = self.at;
        if self.peek() != Some('(') {
            let arguments = ["x", "x, y"][function.arguments - 1];
            let message = format!("{} needs its arguments in parentheses", function.name);
            return Err(self.error(start, end, message, &format!("write {}({arguments})", function.name)));
        }
        self.at += 1;
        self.enter(open)?;
        for index in 0..function.arguments {
            self.sum()?;
            if index + 1 < function.arguments {
                self.skip_blanks();
                if self.peek() != Some(',') {
                    let message =
                        format!("{} takes {} numbers, with a comma between them", function.name, function.arguments);
                    return Err(self.error(start, end, message, ""));
                }
                self.at += 1;
            }
        }
        self.skip_blanks();
        if self.peek() == Some(',') {
            let message = format!(
                "{} takes {} number{}",
                function.name,
                function.arguments,
                if function.arguments == 1 { "" } else { "s" }
            );
            return Err(self.error(self.at, self.at + 1, message, ""));
        }
        self.depth -= 1;
        self.close(open)?;
        self.push(Step::Call(function), start, end);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [(&str, f64); 3] = [("r", 2.0), ("i", 5.0), ("größe", 0.5)];

    fn value(text: &str) -> Result<f64, ExpressionError> {
        let expression = Expression::parse(text, NAMES.iter().map(|(name, _)| *name))?;
        expression.value(&NAMES.map(|(_, number)| number), &mut Vec::new())
    }

    #[test]
    fn expressions_have_the_values_of_mathematics() {
        for (text, expected) in [
            ("1", 1.0),
            (" 1 + 2 * 3 ", 7.0),
            ("1 - 2 - 3", -4.0),
            ("8 / 4 / 2", 1.0),
            ("2 × 3 − 8 ÷ 4", 4.0),
            ("-2^2", -4.0),
            ("2^-1", 0.5),
            ("2^3^2", 512.0),
            ("(1 + 2) * -(3 - 4)", 3.0),
            ("--1", 1.0),
            ("r*i", 10.0),
            ("größe · 4", 2.0),
            (".5 + 5e-1 + 2E1", 21.0),
            ("sin(30 * 3)", 1.0),
            ("cos(90)", 0.0),
            ("sin(180) + sin(-720) + cos(270)", 0.0),
            ("cos(60 * 3)", -1.0),
            ("sqrt(r * 8)", 4.0),
            ("mod(-1, i)", 4.0),
            ("min(r, i) + max(r, i) + abs(-1) + floor(1.5) + round(2.5)", 12.0),
            ("atan2(1, 0)", 90.0),
            ("exp(ln(1))", 1.0),
        ] {
            assert_eq!(value(text), Ok(expected), "{text}");
        }
        // Known values (Abramowitz, Stegun), to the last digits.
        assert!((value("sin(30)").unwrap() - 0.5).abs() < 1e-16 && (value("tan(45)").unwrap() - 1.0).abs() < 1e-15);
        assert!((value("sin(1)").unwrap() - 0.017_452_406_437_283_51).abs() < 1e-17);
        assert_eq!(value("2 * pi"), Ok(std::f64::consts::TAU));
    }

    #[test]
    fn random_numbers_are_even_and_the_same() {
        let numbers: Vec<f64> = (0..10_000).map(|i| value(&format!("random({i})")).unwrap()).collect();
        assert_eq!(value("random(0)"), value("random(-0)"));
        assert!(numbers.iter().all(|v| (0.0..1.0).contains(v)));
        let mean = numbers.iter().sum::<f64>() / 1e4;
        let variance = numbers.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 1e4;
        // The mean of uniform numbers is 1/2 ± 1/√(12 n), their variance 1/12 ± 1/√(180 n).
        assert!((mean - 0.5).abs() < 4.0 / 120_000f64.sqrt() && (variance - 1.0 / 12.0).abs() < 4.0 / 1.8e6f64.sqrt());
        let neighbours: f64 = numbers.windows(2).map(|v| (v[0] - 0.5) * (v[1] - 0.5)).sum::<f64>() / 1e4;
        assert!(neighbours.abs() < 4.0 / 12.0 / 100.0);
    }

    #[test]
    fn mistakes_name_their_place() {
        for (text, start, end, message, help) in [
            ("", 0, 0, "a number is missing", ""),
            ("1 +", 2, 3, "a number is missing after this", ""),
            ("1 + * 2", 4, 5, "a number is missing before \"*\"", ""),
            ("2 (3)", 2, 3, "\"(\" can't stand here", "between two values stands an operator"),
            ("2 r", 2, 3, "\"r\" can't stand here", "between two values"),
            ("(1 + 2", 0, 1, "never closed", ""),
            ("1)", 1, 2, "\")\" can't stand here", "a ( is missing"),
            ("3 * radus", 4, 9, "no number is called radus", "there are: r, i"),
            ("2 * größ", 4, 10, "no number is called", "did you mean größe?"),
            ("sin 30", 0, 3, "sin needs its arguments in parentheses", "sin(x)"),
            ("min(1)", 0, 3, "min takes 2 numbers", ""),
            ("sin(1, 2)", 5, 6, "sin takes 1 number", ""),
            ("1 / (2 - r)", 2, 3, "divides by 0", ""),
            ("sqrt(1 - r)", 0, 4, "sqrt has no value", ""),
            ("10^1000", 2, 3, "this power", ""),
            ("1e999", 0, 5, "isn't a number", ""),
            ("1 & 2", 2, 3, "\"&\" can't stand here", "there are + - * /"),
        ] {
            let error = value(text).unwrap_err();
            assert_eq!((error.start, error.end), (start, end), "{text}: {error:?}");
            assert!(error.message.contains(message) && error.help.contains(help), "{text}: {error:?}");
        }
        let deep = format!("{}1{}", "(".repeat(1000), ")".repeat(1000));
        assert!(value(&deep).unwrap_err().message.contains("64 deep"));
        let deep = format!("2{}", "^2".repeat(1000));
        assert!(value(&deep).unwrap_err().message.contains("64 deep"));
        assert!(value(&"1+".repeat(5000)).unwrap_err().message.contains("4096"));
    }
}
