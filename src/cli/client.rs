//! Talking to a server: one place for addresses, tokens and problem documents.

use crate::error::{Error, ErrorKind, Result};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::time::Duration;

/// Where the server and the token are; flags of every verb that has them.
#[derive(clap::Args, Debug, Clone)]
pub struct Server {
    /// Address of a server, such as http://127.0.0.1:7878
    #[arg(long, value_name = "URL", env = "CULLMARK_SERVER")]
    pub server: Option<String>,
}

/// Never on the command line, where every user of the machine would see it.
const TOKEN: &str = "CULLMARK_TOKEN";
/// An answer may take so long; streams may be silent for half of it.
const LIMIT: Duration = Duration::from_secs(120);

pub struct Client {
    agent: ureq::Agent,
    base: String,
    token: Option<String>,
}

impl Client {
    /// # Errors
    /// For an address that this program cannot speak to.
    pub fn new(server: &str) -> Result<Client> {
        let base = server.trim_end_matches('/').to_string();
        let bad =
            |help: &str| Err(Error::new(format!("`{server}` is no address of a server")).key("--server").help(help));
        if base.starts_with("https://") && !cfg!(feature = "tls") {
            return bad("this build speaks plain HTTP: use a tunnel (`ssh -L`), or build with `--features tls`");
        }
        if !base.starts_with("http://") && !base.starts_with("https://") {
            return bad("write http://HOST:PORT");
        }
        let config = ureq::Agent::config_builder().http_status_as_error(false).timeout_recv_response(Some(LIMIT));
        let token = std::env::var(TOKEN).ok().filter(|t| !t.is_empty());
        Ok(Client { agent: config.build().into(), base, token })
    }

    fn url(&self, path: &str) -> String {
        format!("{}/api/v1{path}", self.base)
    }

    fn bearer(&self) -> String {
        self.token.as_ref().map_or_else(String::new, |t| format!("Bearer {t}"))
    }

    /// # Errors
    /// When the server cannot be reached or answers with a problem.
    pub fn get(&self, path: &str) -> Result<Value> {
        self.json(&self.text(path)?)
    }

    /// # Errors
    /// As [`Client::get`].
    pub fn text(&self, path: &str) -> Result<String> {
        let mut request = self.agent.get(self.url(path));
        if self.token.is_some() {
            request = request.header("authorization", self.bearer());
        }
        self.answer(request.call())
    }

    /// # Errors
    /// As [`Client::get`]; a manifest's mistakes are all in the error's text.
    pub fn post(&self, path: &str, body: &Value) -> Result<Value> {
        let mut request = self.agent.post(self.url(path)).header("content-type", "application/json");
        if self.token.is_some() {
            request = request.header("authorization", self.bearer());
        }
        let text = self.answer(request.send(body.to_string()))?;
        self.json(&text)
    }

    /// Sends a file as it is.
    ///
    /// # Errors
    /// As [`Client::get`], and when the file cannot be read.
    pub fn upload(&self, path: &str, file: std::fs::File) -> Result<Value> {
        let mut request = self.agent.post(self.url(path)).header("content-type", "application/octet-stream");
        if self.token.is_some() {
            request = request.header("authorization", self.bearer());
        }
        let text = self.answer(request.send(file))?;
        self.json(&text)
    }

    fn json(&self, text: &str) -> Result<Value> {
        serde_json::from_str(text).map_err(|e| {
            Error::new(format!("the answer of {} cannot be read: {e}", self.base)).help("is it a cullmark server?")
        })
    }

    fn answer(&self, got: std::result::Result<ureq::http::Response<ureq::Body>, ureq::Error>) -> Result<String> {
        let mut response = got.map_err(|e| self.unreachable(&e))?;
        let status = response.status().as_u16();
        let body = response.body_mut().with_config().limit(1 << 30).read_to_string();
        let text = body.map_err(|e| self.unreachable(&e))?;
        if status < 400 {
            return Ok(text);
        }
        Err(problem(status, &text))
    }

    fn unreachable(&self, e: &ureq::Error) -> Error {
        Error::new(format!("the server at {} cannot be reached: {e}", self.base))
            .kind(ErrorKind::Unavailable)
            .help("is it running? `cullmark serve` starts one")
    }

    /// Server-sent events, one after another, until `on` says to stop or the stream ends.
    ///
    /// # Errors
    /// As [`Client::get`].
    pub fn events(&self, path: &str, mut on: impl FnMut(&str, &Value) -> bool) -> Result<()> {
        let mut request = self.agent.get(self.url(path)).header("accept", "text/event-stream");
        if self.token.is_some() {
            request = request.header("authorization", self.bearer());
        }
        let response = request.call().map_err(|e| self.unreachable(&e))?;
        let status = response.status().as_u16();
        let mut body = response.into_body().into_reader();
        if status >= 400 {
            let mut text = String::new();
            let _ = body.read_to_string(&mut text);
            return Err(problem(status, &text));
        }
        let (mut event, mut data) = (String::new(), String::new());
        for line in BufReader::new(body).lines() {
            let line = line.map_err(|e| {
                Error::new(format!("the stream from {} broke off: {e}", self.base)).kind(ErrorKind::Unavailable)
            })?;
            if let Some(name) = line.strip_prefix("event: ") {
                event = name.to_string();
            } else if let Some(text) = line.strip_prefix("data: ") {
                data += text;
            } else if line.is_empty() && !event.is_empty() {
                let value = serde_json::from_str(&data).unwrap_or(Value::Null);
                if !on(&event, &value) {
                    return Ok(());
                }
                event.clear();
                data.clear();
            }
        }
        Ok(())
    }
}

/// A problem document as an error of ours: title, every mistake with its place, help.
fn problem(status: u16, text: &str) -> Error {
    let Ok(p) = serde_json::from_str::<Value>(text) else {
        return Error::new(format!("the server answered {status}")).help("is it a cullmark server?");
    };
    let word = |v: &Value| v.as_str().map(str::to_string);
    let mut message = word(&p["detail"]).or(word(&p["title"])).unwrap_or_else(|| format!("status {status}"));
    let mistakes = p["errors"].as_array().cloned().unwrap_or_default();
    if !mistakes.is_empty() {
        message = word(&p["title"]).unwrap_or_default();
        for m in &mistakes {
            let e = Error {
                message: word(&m["message"]).unwrap_or_default(),
                file: word(&m["file"]).map(Into::into),
                line: m["line"].as_u64().map(|n| n as u32),
                column: m["column"].as_u64().map(|n| n as u32),
                key: word(&m["key"]),
                help: word(&m["help"]),
                snippet: word(&m["snippet"]),
                ..Error::default()
            };
            message += &format!("\n{e}");
        }
    }
    let kind = match status {
        404 => ErrorKind::Missing,
        500.. => ErrorKind::Unavailable,
        _ => ErrorKind::Input,
    };
    let error = Error::new(message).kind(kind);
    match word(&p["help"]) {
        Some(help) => error.help(help),
        None if status == 401 => error.help(format!("set {TOKEN}")),
        None => error,
    }
}

/// A part of a path or of a query: everything but letters, digits and `-_.~` is escaped.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.~@".contains(&byte) {
            out.push(char::from(byte));
        } else {
            out += &format!("%{byte:02X}");
        }
    }
    out
}

impl Server {
    /// # Errors
    /// When neither flag nor variable names a server.
    pub fn client(&self) -> Result<Client> {
        let server = self.server.as_deref().ok_or_else(|| {
            Error::new("no server is named").help("add --server http://HOST:PORT, or set CULLMARK_SERVER")
        })?;
        Client::new(server)
    }
}
