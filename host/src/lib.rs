//! Library of the host command line.
