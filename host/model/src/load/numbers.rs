//! Numbers in controllers' files: plain decimals, which every one of them reads.

use super::LoadError;

/// Returns a number as a decimal without exponent, nine digits behind the point at most.
pub(super) fn plain(value: f64) -> String {
    let text = format!("{value:.9}");
    let short = text.trim_end_matches('0');
    let short = if short.ends_with('.') { format!("{short}0") } else { short.to_owned() };
    if short == "-0.0" { "0.0".to_owned() } else { short }
}

/// Returns numbers with commas between them.
pub(super) fn list(values: &[f64]) -> String {
    values.iter().map(|v| plain(*v)).collect::<Vec<_>>().join(", ")
}

/// Returns the numbers of a text, whatever is between them, from the first place after `word` on.
pub(super) fn after(text: &str, word: &str, count: usize) -> Result<Vec<f64>, LoadError> {
    let start = text.find(word).ok_or_else(|| LoadError::Read(format!("there is no {word} in it")))?;
    let rest = text.get(start + word.len()..).unwrap_or_default();
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E');
    let numbers: Vec<f64> = rest
        .split(|c: char| !is_part(c))
        .filter_map(|word| word.parse().ok())
        .filter(|v: &f64| v.is_finite())
        .take(count)
        .collect();
    if numbers.len() == count {
        Ok(numbers)
    } else {
        Err(LoadError::Read(format!("{word} needs {count} numbers, and there are {}", numbers.len())))
    }
}

/// Returns the tensor elements Ixx, Iyy, Izz, Iyz, Izx, Ixy of nine numbers of a symmetric matrix.
pub(super) fn symmetric(m: &[f64]) -> Result<[f64; 6], LoadError> {
    let &[xx, xy, xz, yx, yy, yz, zx, zy, zz] = m else {
        return Err(LoadError::Read("the tensor needs nine numbers".to_owned()));
    };
    if xy == yx && xz == zx && yz == zy {
        Ok([xx, yy, zz, yz, zx, xy])
    } else {
        Err(LoadError::Read("the tensor is not symmetric".to_owned()))
    }
}
