//! Watches a fleet: says which sessions need somebody, and acknowledges what it has said.
//!
//! ```sh
//! cargo run -p palpate-client --example watch
//! cargo run -p palpate-client --example watch -- once
//! ```
//! A real one would send a message instead of printing it. The server's address is in
//! `PALPATE_SERVER`.
#![expect(clippy::print_stdout, reason = "an example shows its answers")]

use std::time::Duration;

use palpate_client::Client;
use palpate_client::schemas::{AcknowledgeSessions, FleetQuery};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let once = std::env::args().nth(1).as_deref() == Some("once");
    let address = std::env::var("PALPATE_SERVER");
    let client = Client::new(address.as_deref().unwrap_or("http://127.0.0.1:7411"))?;
    let needed = FleetQuery { needed: Some(true), ..FleetQuery::default() };
    loop {
        let fleet = client.fleet(&needed).await?;
        println!("open sessions: {}, in need of attention: {}", fleet.n_open, fleet.n_needed);
        for one in &fleet.sessions {
            let robots = one.session.touched_by.join(", ");
            println!("  {robots} in {}: {}", one.session.id, one.attention.reason);
        }
        let sessions: Vec<_> = fleet.sessions.iter().map(|one| one.session.id).collect();
        if !sessions.is_empty() {
            client.acknowledge_sessions(&AcknowledgeSessions { sessions, mute_s: None }).await?;
        }
        if once {
            return Ok(());
        }
        tokio::time::sleep(Duration::from_secs(5)).await;
    }
}
