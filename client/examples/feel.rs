//! Recognises an object without images: a bumper knows where it touched, and roughly which way the
//! surface looks.
//!
//! ```sh
//! palpate explore --object mug --readings 30 --offline --out mug.json
//! cargo run -p palpate-client --example feel -- mug.json
//! ```
//! The recording's presses stand for bumps: of each only the sensor's place and direction are used.
//! The server's address is in `PALPATE_SERVER`; the catalogue `default` must have been trained.
#![expect(clippy::print_stdout, reason = "an example shows its answers")]

use palpate_client::Client;
use palpate_client::schemas::{Contact, CreateSession, Reading};
use serde::Deserialize;

#[derive(Deserialize)]
struct Recording {
    readings: Vec<Reading>,
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("expected a file of readings")?;
    let recording: Recording = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    let address = std::env::var("PALPATE_SERVER");
    let client = Client::new(address.as_deref().unwrap_or("http://127.0.0.1:7411"))?;

    let mut session = client.touch_session(&CreateSession::default(), "bumper").await?;
    for reading in &recording.readings {
        let Some(pose) = &reading.pose else { continue };
        let touched = reading.image.iter().flatten().any(|pressure| *pressure > 0.0);
        // The surface looks against the sensor's +z.
        let [x, y, z, w] = pose.orientation;
        let out = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
        let contact = Contact {
            touched,
            position: pose.position,
            position_deviation_m: 0.002,
            normal: touched.then_some(out.map(|along| -along)),
            normal_deviation_rad: touched.then_some(0.3),
            force_n: None,
        };
        let belief = session.feel(&reading.sensor, contact).await?;
        let best = &belief.objects[0];
        println!("{:3} contacts: {} with {:.3}", belief.n_readings, best.name, best.probability);
    }
    client.close_session(session.id()).await?;
    Ok(())
}
