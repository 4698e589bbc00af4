//! URScript, as far as programs that follow set points need it: words and the tree that they make.
//!
//! By the maker's script manual: `def name(): … end`, assignments (also of one element of a list, `global`
//! and `local`), `if`, `elif`, `else`, `while`, calls, numbers, truth values, texts and lists; blocks end
//! with `end`, a comment begins with `#`.

/// Blocks and brackets may be nested as deep as this.
const DEEPEST: usize = 64;

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    Integer(i64),
    Float(f64),
    Truth(bool),
    Text(String),
    Name(String),
    List(Vec<Expression>),
    Element(Box<Expression>, Box<Expression>),
    Call(String, Vec<Expression>),
    Not(Box<Expression>),
    Minus(Box<Expression>),
    Both(Operator, Box<Expression>, Box<Expression>),
}

/// An operator between two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    Or,
    And,
    Equal,
    Different,
    Less,
    LessOrEqual,
    More,
    MoreOrEqual,
    Plus,
    Minus,
    Times,
    Over,
}

/// A statement.
#[derive(Clone, Debug, PartialEq)]
pub enum Statement {
    Assign(String, Expression),
    AssignElement(String, Expression, Expression),
    Call(Expression),
    If(Vec<(Expression, Vec<Statement>)>, Vec<Statement>),
    While(Expression, Vec<Statement>),
    Halt,
}

/// A program: its name and its statements.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    pub name: String,
    pub body: Vec<Statement>,
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(String),
    Word(String),
    Text(String),
    Sign(&'static str),
    End,
}

const SIGNS: [&str; 20] =
    ["==", "!=", "<=", ">=", "<", ">", "=", "+", "-", "*", "/", "(", ")", "[", "]", ",", ":", ".", "%", ";"];

fn tokens(line: &str) -> Result<Vec<Token>, String> {
    let mut tokens = Vec::new();
    let mut rest = line.trim_start();
    while let Some(first) = rest.chars().next().filter(|c| *c != '#') {
        let length = |wanted: &dyn Fn(char) -> bool| rest.find(|c| !wanted(c)).unwrap_or(rest.len());
        let used = if first.is_ascii_digit() {
            let mut used = length(&|c| c.is_ascii_digit() || c == '.');
            let exponent = rest.get(used..).unwrap_or_default();
            if let Some(digits) = exponent.strip_prefix(['e', 'E']) {
                let sign = usize::from(digits.starts_with(['+', '-']));
                let digits = digits.get(sign..).unwrap_or_default();
                used += 1 + sign + digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
            }
            tokens.push(Token::Number(rest.get(..used).unwrap_or_default().to_owned()));
            used
        } else if first.is_ascii_alphabetic() || first == '_' {
            let used = length(&|c| c.is_ascii_alphanumeric() || c == '_');
            tokens.push(Token::Word(rest.get(..used).unwrap_or_default().to_owned()));
            used
        } else if first == '"' {
            let inside = rest.get(1..).unwrap_or_default();
            let end = inside.find('"').ok_or("a text without an end")?;
            tokens.push(Token::Text(inside.get(..end).unwrap_or_default().to_owned()));
            end + 2
        } else {
            let sign =
                SIGNS.iter().find(|sign| rest.starts_with(**sign)).ok_or(format!("{first:?} is no sign"))?;
            tokens.push(Token::Sign(sign));
            sign.len()
        };
        rest = rest.get(used..).unwrap_or_default().trim_start();
    }
    tokens.push(Token::End);
    Ok(tokens)
}

/// Reads the expressions of one line.
struct Line {
    tokens: Vec<Token>,
    at: usize,
    depth: usize,
}

impl Line {
    fn peek(&self) -> &Token {
        self.tokens.get(self.at).unwrap_or(&Token::End)
    }

    fn take(&mut self) -> Token {
        let token = self.peek().clone();
        self.at += 1;
        token
    }

    fn is(&mut self, sign: &str) -> bool {
        let is = matches!(self.peek(), Token::Sign(s) if *s == sign);
        self.at += usize::from(is);
        is
    }

    fn word(&mut self, word: &str) -> bool {
        let is = matches!(self.peek(), Token::Word(w) if w == word);
        self.at += usize::from(is);
        is
    }

    fn expect(&mut self, sign: &str) -> Result<(), String> {
        if self.is(sign) { Ok(()) } else { Err(format!("{sign} is missing before {:?}", self.peek())) }
    }

    fn end(&self) -> Result<(), String> {
        match self.peek() {
            Token::End => Ok(()),
            other => Err(format!("{other:?} is too much")),
        }
    }

    fn name(&mut self) -> Result<String, String> {
        match self.take() {
            Token::Word(name) => Ok(name),
            other => Err(format!("a name is missing before {other:?}")),
        }
    }

    fn expression(&mut self) -> Result<Expression, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err("brackets are nested too deeply".to_owned());
        }
        let found = self.or();
        self.depth -= 1;
        found
    }

    fn or(&mut self) -> Result<Expression, String> {
        let mut left = self.and()?;
        while self.word("or") {
            left = Expression::Both(Operator::Or, Box::new(left), Box::new(self.and()?));
        }
        Ok(left)
    }

    fn and(&mut self) -> Result<Expression, String> {
        let mut left = self.comparison()?;
        while self.word("and") {
            left = Expression::Both(Operator::And, Box::new(left), Box::new(self.comparison()?));
        }
        Ok(left)
    }

    fn comparison(&mut self) -> Result<Expression, String> {
        if self.word("not") {
            return Ok(Expression::Not(Box::new(self.comparison()?)));
        }
        let left = self.sum()?;
        let operators = [
            ("==", Operator::Equal),
            ("!=", Operator::Different),
            ("<=", Operator::LessOrEqual),
            (">=", Operator::MoreOrEqual),
            ("<", Operator::Less),
            (">", Operator::More),
        ];
        for (sign, operator) in operators {
            if self.is(sign) {
                return Ok(Expression::Both(operator, Box::new(left), Box::new(self.sum()?)));
            }
        }
        Ok(left)
    }

    fn sum(&mut self) -> Result<Expression, String> {
        let mut left = self.product()?;
        loop {
            let operator = match () {
                () if self.is("+") => Operator::Plus,
                () if self.is("-") => Operator::Minus,
                () => return Ok(left),
            };
            left = Expression::Both(operator, Box::new(left), Box::new(self.product()?));
        }
    }

    fn product(&mut self) -> Result<Expression, String> {
        let mut left = self.unary()?;
        loop {
            let operator = match () {
                () if self.is("*") => Operator::Times,
                () if self.is("/") => Operator::Over,
                () => return Ok(left),
            };
            left = Expression::Both(operator, Box::new(left), Box::new(self.unary()?));
        }
    }

    fn unary(&mut self) -> Result<Expression, String> {
        if self.is("-") {
            return Ok(Expression::Minus(Box::new(self.atom()?)));
        }
        self.atom()
    }

    fn atom(&mut self) -> Result<Expression, String> {
        let mut found = match self.take() {
            Token::Number(text) => match text.parse::<i64>() {
                Ok(integer) => Expression::Integer(integer),
                Err(_) => {
                    let float = text.parse::<f64>().ok().filter(|v| v.is_finite());
                    Expression::Float(float.ok_or(format!("{text} is no number"))?)
                }
            },
            Token::Text(text) => Expression::Text(text),
            Token::Word(word) if word == "True" => Expression::Truth(true),
            Token::Word(word) if word == "False" => Expression::Truth(false),
            Token::Word(name) if self.is("(") => Expression::Call(name, self.list(")")?),
            Token::Word(name) => Expression::Name(name),
            Token::Sign("[") => Expression::List(self.list("]")?),
            Token::Sign("(") => {
                let inside = self.expression()?;
                self.expect(")")?;
                inside
            }
            other => return Err(format!("a value is missing before {other:?}")),
        };
        while self.is("[") {
            let index = self.expression()?;
            self.expect("]")?;
            found = Expression::Element(Box::new(found), Box::new(index));
        }
        Ok(found)
    }

    fn list(&mut self, end: &str) -> Result<Vec<Expression>, String> {
        let mut list = Vec::new();
        if self.is(end) {
            return Ok(list);
        }
        loop {
            list.push(self.expression()?);
            if !self.is(",") {
                self.expect(end)?;
                return Ok(list);
            }
        }
    }

    fn statement(&mut self) -> Result<Statement, String> {
        let declared = self.word("global") || self.word("local");
        if !declared && self.word("halt") {
            self.end()?;
            return Ok(Statement::Halt);
        }
        let left = self.expression()?;
        let statement = match left {
            Expression::Name(name) if self.is("=") => Statement::Assign(name, self.expression()?),
            Expression::Element(list, index) if self.is("=") => match *list {
                Expression::Name(name) => Statement::AssignElement(name, *index, self.expression()?),
                _ => return Err("only elements of named lists take a value".to_owned()),
            },
            call @ Expression::Call(..) => Statement::Call(call),
            other => return Err(format!("{other:?} does nothing")),
        };
        self.end()?;
        Ok(statement)
    }
}

/// The lines of a program, and where the reader is.
struct Lines<'a> {
    lines: Vec<(usize, &'a str)>,
    at: usize,
    depth: usize,
}

/// The end of a block.
enum Ending {
    End,
    Elif(Expression),
    Else,
}

impl Lines<'_> {
    fn next(&mut self) -> Result<(usize, Line), String> {
        let (number, text) = self.lines.get(self.at).copied().ok_or("the program has no end")?;
        self.at += 1;
        let tokens = tokens(text).map_err(|why| format!("line {number}: {why}"))?;
        Ok((number, Line { tokens, at: 0, depth: 0 }))
    }

    fn condition(line: &mut Line) -> Result<Expression, String> {
        let condition = line.expression()?;
        line.expect(":")?;
        line.end()?;
        Ok(condition)
    }

    fn block(&mut self) -> Result<(Vec<Statement>, Ending), String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err("blocks are nested too deeply".to_owned());
        }
        let mut block = Vec::new();
        let ending = loop {
            let (number, mut line) = self.next()?;
            let named = |why: String| format!("line {number}: {why}");
            if line.word("end") {
                break Ending::End;
            } else if line.word("elif") {
                break Ending::Elif(Self::condition(&mut line).map_err(named)?);
            } else if line.word("else") {
                line.expect(":").map_err(named)?;
                break Ending::Else;
            } else if line.word("while") {
                let condition = Self::condition(&mut line).map_err(named)?;
                block.push(Statement::While(condition, self.closed()?));
            } else if line.word("if") {
                let condition = Self::condition(&mut line).map_err(named)?;
                block.push(self.branches(condition)?);
            } else {
                block.push(line.statement().map_err(named)?);
            }
        };
        self.depth -= 1;
        Ok((block, ending))
    }

    fn closed(&mut self) -> Result<Vec<Statement>, String> {
        match self.block()? {
            (block, Ending::End) => Ok(block),
            _ => Err(format!("line {}: else without if", self.at)),
        }
    }

    fn branches(&mut self, first: Expression) -> Result<Statement, String> {
        let (mut branches, mut condition) = (Vec::new(), first);
        loop {
            let (block, ending) = self.block()?;
            branches.push((condition, block));
            match ending {
                Ending::End => return Ok(Statement::If(branches, Vec::new())),
                Ending::Else => return Ok(Statement::If(branches, self.closed()?)),
                Ending::Elif(next) => condition = next,
            }
        }
    }
}

/// Returns the lines that are not empty, with their numbers.
fn lines(text: &str) -> Vec<(usize, &str)> {
    let content = |line: &str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    text.lines().enumerate().map(|(k, line)| (k + 1, line)).filter(|(_, line)| content(line)).collect()
}

/// Returns whether a text that is still arriving is whole: its blocks are closed.
pub fn is_whole(text: &str) -> bool {
    if !text.ends_with('\n') {
        return false;
    }
    let mut open = 0_i64;
    for (_, line) in lines(text) {
        let first = line.trim_start().split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next();
        match first {
            Some("def" | "sec" | "thread" | "while" | "if") => open += 1,
            Some("end") => open -= 1,
            _ => {}
        }
    }
    open <= 0 && !lines(text).is_empty()
}

/// Reads a program: one `def` without parameters, or lines by themselves.
///
/// # Errors
/// In words, with the line.
pub fn read(text: &str) -> Result<Program, String> {
    let mut lines = Lines { lines: lines(text), at: 0, depth: 0 };
    let (number, mut line) = lines.next()?;
    if line.word("def") {
        let name = line.name().map_err(|why| format!("line {number}: {why}"))?;
        for sign in ["(", ")", ":"] {
            line.expect(sign).map_err(|why| format!("line {number}: {why}"))?;
        }
        let body = lines.closed()?;
        return match lines.lines.get(lines.at) {
            None => Ok(Program { name, body }),
            Some((number, _)) => Err(format!("line {number}: one program at a time")),
        };
    }
    let statement = line.statement().map_err(|why| format!("line {number}: {why}"))?;
    Ok(Program { name: "line".to_owned(), body: vec![statement] })
}
