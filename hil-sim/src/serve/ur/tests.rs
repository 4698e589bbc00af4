//! The controller by its ports, with a client that is written here.

use super::language::{Expression, Statement, is_whole, read};

#[test]
fn a_program_is_whole_when_its_blocks_are_closed() {
    let text = "def f():\n  while True:\n    if a < 1: # no end\n      sync()\n    end\n  end\nend\n";
    assert!(is_whole(text));
    for (k, _) in text.char_indices() {
        assert!(!is_whole(&text[..k]), "{}", &text[..k]);
    }
    let program = read(text).unwrap();
    assert_eq!(program.name, "f");
    assert!(matches!(&program.body[..], [Statement::While(Expression::Truth(true), _)]));
}

#[test]
fn faults_of_a_program_are_named_with_their_line() {
    for (text, words) in [
        ("def f():\n  a = \nend\n", "line 2: a value is missing"),
        ("def f():\n  a\nend\n", "does nothing"),
        ("def f():\n  else:\n  end\nend\n", "else without if"),
        ("def f(x):\nend\n", "line 1: ) is missing"),
        ("def f():\n  a = \"b\nend\n", "a text without an end"),
    ] {
        let error = read(text).unwrap_err();
        assert!(error.contains(words), "{text}: {error}");
    }
    let deep = format!("def f():\n  a = {}1{}\nend\n", "(".repeat(500), ")".repeat(500));
    assert!(read(&deep).unwrap_err().contains("too deeply"));
}
