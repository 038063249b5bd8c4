//! Pictures of the first seed: maps (figure 3.8), presses (3.7 d) and contact classes (3.4).

use palpate_core::reading::Reading;
use palpate_core::units::{DEG, MM};
use palpate_dissertation::geometric::model::GeometricMap;
use palpate_dissertation::occupancy::classify::{CONTACT_THRESHOLD, ContactClass, classify};
use palpate_sim::plot::grids::{Grid, Legend, grids_svg};
use palpate_sim::render::occupancy::layer_png;
use palpate_sim::rig::PlanarPose;

use super::{Lab, TestLetter};

/// Pixels of a map's cell.
const CELL_PIXELS: usize = 8;
/// Presses drawn of the first letter, and how many of them stand in a row.
const N_PRESSES: usize = 12;
const PER_ROW: usize = 6;

/// All pictures.
pub(super) fn of_lab(letters: &[TestLetter], lab: &Lab) -> Vec<(String, Vec<u8>)> {
    let mut pictures = maps(letters, lab);
    let presses = &lab.test[0];
    pictures.push(("letters-geometric-presses.svg".to_owned(), drawn(lab, presses).into_bytes()));
    pictures.push(("letters-geometric-classes.svg".to_owned(), classes(lab, presses).into_bytes()));
    pictures
}

/// The maps of the letters.
fn maps(letters: &[TestLetter], lab: &Lab) -> Vec<(String, Vec<u8>)> {
    let picture = |(letter, map): (&TestLetter, &std::sync::Arc<GeometricMap>)| {
        let case = if letter.symbol.is_ascii_uppercase() { "capital" } else { "small" };
        let name = format!("letters-geometric-{case}-{}.png", letter.symbol.to_ascii_lowercase());
        Some((name, layer_png(&map.occupancy, 0, CELL_PIXELS)?))
    };
    letters.iter().zip(&lab.model.maps).filter_map(picture).collect()
}

/// Figure 3.7 (d): presses spread evenly over the plan, on one scale of pressure.
fn drawn(lab: &Lab, presses: &[Reading]) -> String {
    let full = presses.iter().map(|reading| reading.image().max()).fold(0.0, f64::max);
    let chosen = presses.iter().step_by(presses.len().div_ceil(N_PRESSES).max(1));
    let grid = |reading: &Reading| {
        let at = PlanarPose::of(reading.session_from_sensor());
        let title = format!("{:.1}, {:.1} mm, {:.0}°", at.x / MM, at.y / MM, at.angle / DEG);
        Grid::tactile(&title, lab.sensor.grid(), &reading.image().pressures, full)
    };
    grids_svg(&chosen.map(grid).collect::<Vec<_>>(), PER_ROW)
}

/// Figure 3.4: the press whose rarest class is the most frequent, and its classes by equation 3.3.
fn classes(lab: &Lab, presses: &[Reading]) -> String {
    let classes_of = |reading: &Reading| classify(reading.image(), CONTACT_THRESHOLD);
    let rarest = |reading: &Reading| {
        let classes = classes_of(reading);
        let all = [ContactClass::InContact, ContactClass::NoContact, ContactClass::Unknown];
        all.map(|kind| classes.iter().filter(|class| **class == kind).count()).into_iter().min()
    };
    let Some(press) = presses.iter().max_by_key(|reading| rarest(reading)) else {
        return grids_svg(&[], 2);
    };
    let (grid, image) = (lab.sensor.grid(), press.image());
    let values: Vec<f64> = classes_of(press)
        .into_iter()
        .map(|class| match class {
            ContactClass::InContact => 1.0,
            ContactClass::Unknown => 0.5,
            ContactClass::NoContact => 0.0,
        })
        .collect();
    let title = "bright: contact, dark: none";
    let classes = Grid { legend: Legend::None, ..Grid::scaled(title, grid, &values) };
    let pressed = Grid::tactile("press", grid, &image.pressures, image.max());
    grids_svg(&[pressed, classes], 2)
}
