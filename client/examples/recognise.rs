//! Recognises an object from recorded readings: the loop of a robot, with the readings from a file.
//!
//! ```sh
//! palpate explore --object mug --readings 30 --offline --out mug.json
//! cargo run -p palpate-client --example recognise -- mug.json
//! ```
//! The server's address is in `PALPATE_SERVER`; the catalogue `default` must have been trained.
#![expect(clippy::print_stdout, reason = "an example shows its answers")]

use palpate_client::schemas::{AskNextTouches, CreateSession, Reading};
use palpate_client::{Client, Touch};
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

    // A session that says when the answer is sure enough: at most one wrong in a hundred.
    let asked = CreateSession { risk: Some(0.01), ..CreateSession::default() };
    let mut session = client.touch_session(&asked, "example").await?;
    for reading in recording.readings {
        let sensor = reading.sensor.clone();
        let belief = session
            .send(Touch {
                sensor: reading.sensor,
                pose: reading.pose,
                image: reading.image,
                approach_m: reading.approach_m,
                contact: reading.contact,
                shear: reading.shear,
                stamp: None,
            })
            .await?;
        let best = &belief.objects[0];
        println!("{:3} touches: {} with {:.3}", belief.n_readings, best.name, best.probability);
        if belief.stop.is_some_and(|stop| stop.reached) {
            break;
        }
        // A real robot would go where the next touch tells most.
        let question = AskNextTouches { sensor, n: Some(1), ..AskNextTouches::default() };
        if let Some(next) = session.next_touches(&question).await?.touches.first() {
            println!("    next touch: {:.2} bits", next.information_bits);
        }
    }

    let belief = session.belief().await?;
    for pose in belief.poses.iter().take(2) {
        let [x, y, z] = pose.pose.position;
        println!("{} at {x:.4}, {y:.4}, {z:.4} m, weight {:.2}", pose.name, pose.weight);
    }
    client.close_session(session.id()).await?;
    Ok(())
}
