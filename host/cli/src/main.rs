//! `rigident`, the command line.

fn main() -> std::process::ExitCode {
    rigident_cli::main()
}
