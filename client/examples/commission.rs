//! Commissions a sensor: twenty touches of a known object tell what is wrong with its set-up.
//!
//! ```sh
//! palpate explore --object mug --readings 30 --offline --out mug.json
//! cargo run -p palpate-client --example commission -- mug.json mug
//! ```
//! The file's touches must be of the object that the second argument names, at rest. Nothing is
//! changed: with `apply` the findings would correct later readings. The server's address is in
//! `PALPATE_SERVER`.
#![expect(clippy::print_stdout, reason = "an example shows its answers")]

use palpate_client::Client;
use palpate_client::schemas::{CommissionSensor, CommissioningReading, Reading};
use serde::Deserialize;

#[derive(Deserialize)]
struct Recording {
    readings: Vec<Reading>,
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (file, object) = std::env::args().nth(1).zip(std::env::args().nth(2)).ok_or("see above")?;
    let recording: Recording = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    let address = std::env::var("PALPATE_SERVER");
    let client = Client::new(address.as_deref().unwrap_or("http://127.0.0.1:7411"))?;

    let sensor = recording.readings.first().ok_or("the file has no readings")?.sensor.clone();
    let touches = recording.readings.into_iter().filter_map(|reading| {
        Some(CommissioningReading { image: reading.image, pose: reading.pose? })
    });
    let asked = CommissionSensor {
        object: Some(object),
        readings: touches.collect(),
        ..CommissionSensor::default()
    };
    let found = client.commission_sensor(&sensor, &asked).await?;
    println!("{}", found.summary);
    for finding in &found.findings {
        println!("{:?} {:?}", finding.name, finding.verdict);
    }
    Ok(())
}
