//! `cullmark token`: who may ask a server what.

use crate::error::Error;
use crate::store::tokens::Role;
use crate::store::{DEFAULT_DB, Store, block_on};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Subcommand)]
pub enum Verb {
    /// Make a token and print it: this once, only its hash is kept
    Add {
        /// Who or what it is for
        name: String,
        /// read; submit (studies and files); admin (also deletes, and rules the pool)
        #[arg(long, default_value = "submit", value_parser = role)]
        role: Role,
        #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
        db: PathBuf,
    },
    /// List tokens by name
    List {
        #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
        db: PathBuf,
    },
    /// Remove a token: it is refused at once
    Remove {
        name: String,
        #[arg(long, value_name = "FILE", default_value = DEFAULT_DB)]
        db: PathBuf,
    },
}

fn role(text: &str) -> Result<Role, String> {
    Role::of(text).ok_or_else(|| "must be read, submit or admin".to_string())
}

pub fn run(verb: Verb) -> anyhow::Result<ExitCode> {
    match verb {
        Verb::Add { name, role, db } => {
            let plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | '@');
            if name.is_empty() || name.len() > 60 || !name.chars().all(plain) {
                return Err(Error::new(format!("`{name}` is no name for a token"))
                    .help("letters, digits and -_.@, at most 60")
                    .into());
            }
            let token = block_on(async {
                let store = Store::open(&db).await?;
                let token = store.add_token(&name, role).await;
                store.close().await;
                token
            })?;
            eprintln!("token `{name}` with the role `{}`; it is shown this once:", role.word());
            println!("{token}");
        }
        Verb::List { db } => {
            let tokens = block_on(async {
                let store = Store::open_existing(&db).await?;
                let tokens = store.tokens().await;
                store.close().await;
                tokens
            })?;
            for t in &tokens {
                println!(
                    "{:20} {:7} made {} used {}",
                    t.name,
                    t.role.word(),
                    t.created,
                    t.used.as_deref().unwrap_or("never")
                );
            }
            if tokens.is_empty() {
                eprintln!("no tokens: a server on this database asks for none");
            }
        }
        Verb::Remove { name, db } => {
            block_on(async {
                let store = Store::open_existing(&db).await?;
                let done = store.remove_token(&name).await;
                store.close().await;
                done
            })?;
            println!("token `{name}` is removed");
        }
    }
    Ok(ExitCode::SUCCESS)
}
