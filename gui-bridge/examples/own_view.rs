//! A bridge of one's own: it draws data of a type of one's own, and all else as the usual one does. Put it in the
//! configuration in that one's place: `program = "own_view"`.

use rohrpost::schema::{DataItem, Description};
use rohrpost_gui_bridge::rerun::{Color, Points2D};
use rohrpost_gui_bridge::{Datum, DrawError, Scene, Tab, View, entity};

/// Where a camera saw something that burns; as its module publishes it.
#[rohrpost::data]
struct Fires {
    /// Places in the world, metres.
    places_m: Vec<[f32; 2]>,
}

#[derive(Default)]
struct FireView;

impl View for FireView {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        item.field.ty.is::<Fires>()
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let fires: Fires = datum.read()?;
        let flames = Points2D::new(fires.places_m).with_radii([0.3]).with_colors([Color::from_rgb(255, 90, 0)]);
        scene.log(entity(&["world", "fires", datum.module]), &flames);
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![Tab::plane("Fires", &["/world/fires/**", "/world/map/**"])]
    }
}

fn main() -> std::process::ExitCode {
    rohrpost_gui_bridge::run_with::<FireView>()
}
