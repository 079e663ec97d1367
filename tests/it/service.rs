//! The service as others meet it: the real program on a free port, spoken to over HTTP
//! and with the client verbs of the command line.

mod access;
mod browsing;
mod conformance;
mod files;
mod life;
mod operations;
mod results;
mod schema;
mod server;
mod shared;
mod verbs;
