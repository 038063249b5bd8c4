//! `palpate sessions feel`: sends one contact without an image, as a bumper feels it.

use clap::Args;
use palpate_client::Client;
use palpate_client::schemas::{
    AddReadings, BeliefDetail, Contact, Reading, ReadingsAdded, ReadingsQuery,
};

use crate::ids::SessionName;

/// Arguments of `palpate sessions feel`.
#[derive(Debug, Args)]
pub(super) struct FeelArgs {
    /// Id of the session, or its last digits.
    session: SessionName,
    /// Id or name of the sensor that felt it.
    #[arg(long)]
    sensor: String,
    /// Position of the contact in the session frame, in metres.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    position: Vec<f64>,
    /// Standard deviation of the position in millimetres.
    #[arg(long, value_name = "MM", default_value_t = 2.0)]
    deviation_mm: f64,
    /// Outward normal of the touched surface, a unit vector, if it was felt.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    normal: Option<Vec<f64>>,
    /// Standard deviation of the normal in degrees.
    #[arg(long, value_name = "DEG", default_value_t = 10.0)]
    normal_deviation_deg: f64,
    /// Normal force in newton.
    #[arg(long, value_name = "N")]
    force: Option<f64>,
    /// Nothing was touched at the position.
    #[arg(long)]
    missed: bool,
    /// Length of the free way to the position in millimetres, against the normal.
    #[arg(long, value_name = "MM", requires = "normal")]
    approach_mm: Option<f64>,
}

/// Sends the contact.
pub(super) async fn feel(client: &Client, args: FeelArgs) -> anyhow::Result<ReadingsAdded> {
    let session = args.session.id(client).await?;
    let reading = reading(args);
    let query = ReadingsQuery { belief: Some(BeliefDetail::Full) };
    Ok(client.add_readings(session, &AddReadings { readings: vec![reading] }, query).await?)
}

fn reading(args: FeelArgs) -> Reading {
    // Clap takes exactly three values.
    let vector = |values: &[f64]| [0, 1, 2].map(|axis| values.get(axis).copied().unwrap_or(0.0));
    let contact = Contact {
        touched: !args.missed,
        position: vector(&args.position),
        position_deviation_m: args.deviation_mm / 1e3,
        normal: args.normal.as_deref().map(vector),
        normal_deviation_rad: args.normal.as_ref().map(|_| args.normal_deviation_deg.to_radians()),
        force_n: args.force,
    };
    Reading {
        sensor: args.sensor,
        contact: Some(contact),
        approach_m: args.approach_mm.map(|mm| mm / 1e3),
        ..Reading::default()
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: FeelArgs,
    }

    const SESSION: &str = "01a212e3-686d-7003-8ceb-907bade6c23c";

    fn parsed(arguments: &[&str]) -> Result<Reading, clap::Error> {
        let start = ["feel", SESSION, "--sensor", "bumper", "--position", "0.1", "-0.2", "0.3"];
        let line = Line::try_parse_from(start.iter().chain(arguments))?;
        Ok(reading(line.args))
    }

    #[test]
    fn a_contact_is_sent_in_si_units() {
        let given = ["--normal", "0", "0", "-1", "--deviation-mm", "5", "--force", "2"];
        let sent = parsed(&given).unwrap();
        let contact = sent.contact.unwrap();
        assert_eq!((contact.position, contact.normal), ([0.1, -0.2, 0.3], Some([0.0, 0.0, -1.0])));
        assert!((contact.position_deviation_m - 0.005).abs() < 1e-12);
        assert!((contact.normal_deviation_rad.unwrap() - 0.174_533).abs() < 1e-6);
        assert!(contact.touched && sent.image.is_empty() && sent.pose.is_none());
        let missed = parsed(&["--missed"]).unwrap().contact.unwrap();
        assert_eq!((missed.touched, missed.normal_deviation_rad), (false, None));
    }

    #[test]
    fn a_free_way_needs_a_normal() {
        assert!(parsed(&["--missed", "--approach-mm", "50"]).is_err());
    }
}
