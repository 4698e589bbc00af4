//! A body, a tree of links and a person, identified by a program that has only the published library. See
//! `tests/`.
