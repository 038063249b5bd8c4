//! The service over real HTTP: each test starts a server on a free port with a folder of
//! its own.

mod bad_input;
mod harness;
mod objects;
mod sessions;
mod site;
mod training;
