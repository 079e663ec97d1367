//! Bearer tokens: who may ask a service what. Only a hash is kept, so that a copy of
//! the database opens nothing. Tokens are 256 random bits, so a plain hash is enough:
//! there is nothing to guess that a slow one would protect.

use super::{Store, now_ms, read::utc};
use crate::error::{Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};

/// What a token allows; each includes those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    Read,
    /// Studies and uploads.
    Submit,
    /// Also deletes, and pauses the pool.
    Admin,
}

impl Role {
    pub const ALL: [Role; 3] = [Role::Read, Role::Submit, Role::Admin];

    pub fn word(self) -> &'static str {
        match self {
            Role::Read => "read",
            Role::Submit => "submit",
            Role::Admin => "admin",
        }
    }

    pub fn of(word: &str) -> Option<Role> {
        Role::ALL.into_iter().find(|r| r.word() == word)
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TokenInfo {
    pub name: String,
    pub role: Role,
    pub created: String,
    /// Of the last use, to the minute.
    pub used: Option<String>,
}

/// How precisely uses are noted: a write a request would be too much.
const USED_MS: i64 = 60_000;

fn hash(token: &str) -> String {
    blake3::hash(token.as_bytes()).to_hex().to_string()
}

impl Store {
    /// Makes a token and returns it: this once, it is stored nowhere.
    ///
    /// # Errors
    /// When the name is taken, no randomness can be had, or the database fails.
    pub async fn add_token(&self, name: &str, role: Role) -> Result<String> {
        let token = format!("cm_{}", random_hex()?);
        let done = sqlx::query(
            "INSERT INTO tokens (name, role, hash, created_ms) VALUES ($1, $2, $3, $4) ON CONFLICT (name) DO NOTHING",
        )
        .bind(name)
        .bind(role.word())
        .bind(hash(&token))
        .bind(now_ms())
        .execute(&self.writer)
        .await
        .map_err(|e| self.explain("a token", &e))?;
        if done.rows_affected() == 0 {
            return Err(Error::new(format!("there is a token `{name}` already"))
                .kind(ErrorKind::Conflict)
                .help("remove it first (`cullmark token remove`), or choose another name"));
        }
        Ok(token)
    }

    /// # Errors
    /// When there is none of this name or the database fails.
    pub async fn remove_token(&self, name: &str) -> Result<()> {
        let done = sqlx::query("DELETE FROM tokens WHERE name = $1")
            .bind(name)
            .execute(&self.writer)
            .await
            .map_err(|e| self.explain("a token", &e))?;
        if done.rows_affected() == 0 {
            return Err(Error::new(format!("there is no token `{name}`"))
                .kind(ErrorKind::Missing)
                .help("`cullmark token list` shows them"));
        }
        Ok(())
    }

    /// # Errors
    /// When the database fails.
    pub async fn tokens(&self) -> Result<Vec<TokenInfo>> {
        let rows: Vec<(String, String, i64, Option<i64>)> =
            sqlx::query_as("SELECT name, role, created_ms, used_ms FROM tokens ORDER BY name")
                .fetch_all(&self.readers)
                .await
                .map_err(|e| self.explain("reading tokens", &e))?;
        let info = |(name, role, created, used): (String, String, i64, Option<i64>)| TokenInfo {
            name,
            role: Role::of(&role).unwrap_or(Role::Read),
            created: utc(created),
            used: used.map(utc),
        };
        Ok(rows.into_iter().map(info).collect())
    }

    /// The role of a token, if it is known; notes that it was used.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn role_of(&self, token: &str) -> Result<Option<Role>> {
        let row: Option<(i64, String, Option<i64>)> =
            sqlx::query_as("SELECT id, role, used_ms FROM tokens WHERE hash = $1")
                .bind(hash(token))
                .fetch_optional(&self.readers)
                .await
                .map_err(|e| self.explain("reading tokens", &e))?;
        let Some((id, role, used)) = row else { return Ok(None) };
        let now = now_ms();
        if used.is_none_or(|u| now - u > USED_MS) {
            // Of no importance: a full disk must not lock readers out.
            let _ = sqlx::query("UPDATE tokens SET used_ms = $2 WHERE id = $1")
                .bind(id)
                .bind(now)
                .execute(&self.writer)
                .await;
        }
        Ok(Role::of(&role))
    }

    /// # Errors
    /// When the database fails.
    pub async fn has_tokens(&self) -> Result<bool> {
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM tokens)")
            .fetch_one(&self.readers)
            .await
            .map_err(|e| self.explain("reading tokens", &e))
    }
}

/// 256 bits of the system's randomness.
fn random_hex() -> Result<String> {
    use std::io::Read;
    let mut bytes = [0u8; 32];
    std::fs::File::open("/dev/urandom")
        .and_then(|mut f| f.read_exact(&mut bytes))
        .map_err(|e| Error::io(std::path::Path::new("/dev/urandom"), "no randomness for a token", &e))?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}
