//! The `cullmark` program: argv in, exit code out.

fn main() -> std::process::ExitCode {
    cullmark::cli::main()
}
