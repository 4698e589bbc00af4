//! Runs a program of [`super::language`]: values are copied when they are assigned, as the maker's manual has it.

use std::collections::HashMap;

use super::language::{Expression, Operator, Program, Statement};

/// Steps that a program may take in one cycle; one that takes more never gives the arm a command.
const MOST_STEPS: u32 = 200_000;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// The value of functions that return nothing.
    None,
    Integer(i64),
    Float(f64),
    Truth(bool),
    Text(String),
    List(Vec<f64>),
}

/// The reason why a program ends before its end.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The program was taken away.
    Killed,
    /// The program has stopped itself.
    Halted,
    /// The program is wrong.
    Error(String),
}

impl From<String> for Fault {
    fn from(why: String) -> Self {
        Self::Error(why)
    }
}

/// The functions that the controller has.
pub trait Functions {
    /// Calls a function; the arm's time goes on meanwhile if the function takes any.
    ///
    /// # Errors
    /// No such function, arguments that it does not take, or the program was taken away.
    fn call(&mut self, name: &str, arguments: &[Value]) -> Result<Value, Fault>;
    /// Returns how many cycles of the arm have gone by.
    fn cycles(&self) -> u64;
}

impl Value {
    /// Returns a number.
    ///
    /// # Errors
    /// It is none.
    pub fn number(&self) -> Result<f64, Fault> {
        match self {
            Self::Integer(value) => Ok(*value as f64),
            Self::Float(value) => Ok(*value),
            other => Err(Fault::Error(format!("{other:?} is no number"))),
        }
    }

    fn truth(&self) -> Result<bool, Fault> {
        match self {
            Self::Truth(value) => Ok(*value),
            other => Err(Fault::Error(format!("{other:?} is neither True nor False"))),
        }
    }

    fn integer(&self) -> Result<i64, Fault> {
        match self {
            Self::Integer(value) => Ok(*value),
            other => Err(Fault::Error(format!("{other:?} is no integer"))),
        }
    }
}

/// A program that runs.
pub struct Run<'a, F> {
    names: HashMap<String, Value>,
    functions: &'a mut F,
    steps: u32,
    cycle: u64,
}

impl<'a, F: Functions> Run<'a, F> {
    /// Runs a program to its end.
    ///
    /// # Errors
    /// The fault that ended it before.
    pub fn program(program: &Program, functions: &'a mut F) -> Result<(), Fault> {
        let mut run = Self { names: HashMap::new(), functions, steps: 0, cycle: 0 };
        run.block(&program.body)
    }

    fn step(&mut self) -> Result<(), Fault> {
        let cycle = self.functions.cycles();
        if cycle != self.cycle {
            (self.cycle, self.steps) = (cycle, 0);
        }
        self.steps += 1;
        if self.steps > MOST_STEPS {
            return Err(Fault::Error("it takes more than its time without a command to the arm".to_owned()));
        }
        Ok(())
    }

    fn block(&mut self, block: &[Statement]) -> Result<(), Fault> {
        block.iter().try_for_each(|statement| self.statement(statement))
    }

    fn statement(&mut self, statement: &Statement) -> Result<(), Fault> {
        self.step()?;
        match statement {
            Statement::Halt => return Err(Fault::Halted),
            Statement::Call(call) => {
                self.value(call)?;
            }
            Statement::Assign(name, value) => {
                let value = self.value(value)?;
                self.names.insert(name.clone(), value);
            }
            Statement::AssignElement(name, index, value) => {
                let (index, value) = (self.value(index)?.integer()?, self.value(value)?.number()?);
                let Some(Value::List(list)) = self.names.get_mut(name) else {
                    return Err(Fault::Error(format!("{name} is no list")));
                };
                let at = usize::try_from(index).ok().and_then(|k| list.get_mut(k));
                *at.ok_or(Fault::Error(format!("{name} has no element {index}")))? = value;
            }
            Statement::While(condition, block) => {
                while self.value(condition)?.truth()? {
                    self.step()?;
                    self.block(block)?;
                }
            }
            Statement::If(branches, other) => {
                for (condition, block) in branches {
                    if self.value(condition)?.truth()? {
                        return self.block(block);
                    }
                }
                self.block(other)?;
            }
        }
        Ok(())
    }

    fn value(&mut self, expression: &Expression) -> Result<Value, Fault> {
        Ok(match expression {
            Expression::Integer(value) => Value::Integer(*value),
            Expression::Float(value) => Value::Float(*value),
            Expression::Truth(value) => Value::Truth(*value),
            Expression::Text(text) => Value::Text(text.clone()),
            Expression::Name(name) => self.names.get(name).cloned().ok_or(format!("{name} has no value"))?,
            Expression::List(list) => {
                let values =
                    list.iter().map(|e| self.value(e)?.number()).collect::<Result<Vec<_>, Fault>>()?;
                Value::List(values)
            }
            Expression::Element(list, index) => {
                let (list, index) = (self.value(list)?, self.value(index)?.integer()?);
                let Value::List(list) = list else {
                    return Err("an element of a value that is no list".to_owned().into());
                };
                let at = usize::try_from(index).ok().and_then(|k| list.get(k).copied());
                Value::Float(at.ok_or(format!("there is no element {index}"))?)
            }
            Expression::Call(name, arguments) => {
                let arguments = arguments.iter().map(|e| self.value(e)).collect::<Result<Vec<_>, Fault>>()?;
                self.functions.call(name, &arguments)?
            }
            Expression::Not(inside) => Value::Truth(!self.value(inside)?.truth()?),
            Expression::Minus(inside) => match self.value(inside)? {
                Value::Integer(value) => Value::Integer(-value),
                other => Value::Float(-other.number()?),
            },
            // The second is not evaluated where the first decides.
            Expression::Both(Operator::Or, a, b) => {
                Value::Truth(self.value(a)?.truth()? || self.value(b)?.truth()?)
            }
            Expression::Both(Operator::And, a, b) => {
                Value::Truth(self.value(a)?.truth()? && self.value(b)?.truth()?)
            }
            Expression::Both(operator, a, b) => both(*operator, &self.value(a)?, &self.value(b)?)?,
        })
    }
}

fn both(operator: Operator, a: &Value, b: &Value) -> Result<Value, Fault> {
    use Operator::{Different, Equal, Less, LessOrEqual, Minus, More, MoreOrEqual, Over, Plus, Times};
    if let (Value::Truth(a), Value::Truth(b)) = (a, b) {
        return match operator {
            Equal => Ok(Value::Truth(a == b)),
            Different => Ok(Value::Truth(a != b)),
            _ => Err("truth values are only compared".to_owned().into()),
        };
    }
    let (x, y) = (a.number()?, b.number()?);
    let exact = match (a, b) {
        (Value::Integer(a), Value::Integer(b)) => match operator {
            Plus => a.checked_add(*b),
            Minus => a.checked_sub(*b),
            Times => a.checked_mul(*b),
            _ => None,
        },
        _ => None,
    };
    Ok(match operator {
        Equal => Value::Truth(x == y),
        Different => Value::Truth(x != y),
        Less => Value::Truth(x < y),
        LessOrEqual => Value::Truth(x <= y),
        More => Value::Truth(x > y),
        MoreOrEqual => Value::Truth(x >= y),
        Plus => exact.map_or(Value::Float(x + y), Value::Integer),
        Minus => exact.map_or(Value::Float(x - y), Value::Integer),
        Times => exact.map_or(Value::Float(x * y), Value::Integer),
        Over if y == 0.0 => return Err("a division by zero".to_owned().into()),
        Over => Value::Float(x / y),
        Operator::Or | Operator::And => return Err("or and and take truth values".to_owned().into()),
    })
}
