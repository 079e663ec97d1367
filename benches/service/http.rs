//! A plain HTTP/1.1 client on one connection: what it costs is the server's alone.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;

pub struct Connection {
    stream: BufReader<TcpStream>,
    /// Ask for compressed answers, as browsers do.
    pub gzip: bool,
}

pub struct Reply {
    pub status: u16,
    pub body: Vec<u8>,
}

impl Reply {
    /// The body of an answer that must be one.
    pub fn json(&self) -> serde_json::Value {
        assert!(self.status < 300, "{}: {}", self.status, String::from_utf8_lossy(&self.body));
        serde_json::from_slice(&self.body).expect("an answer in JSON")
    }
}

impl Connection {
    pub fn new(address: &str) -> Connection {
        let stream = TcpStream::connect(address).expect("the server listens");
        stream.set_nodelay(true).expect("a socket");
        Connection { stream: BufReader::with_capacity(1 << 16, stream), gzip: false }
    }

    pub fn get(&mut self, path: &str) -> Reply {
        self.ask("GET", path, "", "")
    }

    pub fn post(&mut self, path: &str, body: &serde_json::Value) -> Reply {
        self.ask("POST", path, "application/json", &body.to_string())
    }

    fn ask(&mut self, method: &str, path: &str, kind: &str, body: &str) -> Reply {
        let mut head = format!("{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n");
        if self.gzip {
            head += "Accept-Encoding: gzip\r\n";
        }
        if method == "POST" {
            head += &format!("Content-Type: {kind}\r\nContent-Length: {}\r\n", body.len());
        }
        let request = format!("{head}\r\n{body}");
        self.stream.get_mut().write_all(request.as_bytes()).expect("the server reads");
        self.reply()
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stream.read_line(&mut line).expect("the server answers");
        line.trim_end().to_string()
    }

    fn reply(&mut self) -> Reply {
        let status = self.line().split(' ').nth(1).and_then(|s| s.parse().ok()).expect("a status line");
        let (mut length, mut chunked) = (0usize, false);
        loop {
            let line = self.line().to_ascii_lowercase();
            match line.split_once(": ") {
                Some(("content-length", n)) => length = n.parse().expect("a length"),
                Some(("transfer-encoding", "chunked")) => chunked = true,
                Some(_) => {}
                None => break,
            }
        }
        let mut body = Vec::new();
        loop {
            if chunked {
                length = usize::from_str_radix(&self.line(), 16).expect("a chunk");
            }
            let from = body.len();
            body.resize(from + length, 0);
            self.stream.read_exact(&mut body[from..]).expect("a body");
            if !chunked {
                return Reply { status, body };
            }
            self.line();
            if length == 0 {
                return Reply { status, body };
            }
        }
    }
}

/// What may stand in a query.
pub fn escape(text: &str) -> String {
    let byte = |b: u8| match b {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' => char::from(b).to_string(),
        _ => format!("%{b:02X}"),
    };
    text.bytes().map(byte).collect()
}
