//! The built-in views. Each selects data by type, from any sender; data of an unknown type are drawn by their
//! description.

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::network::{Clocks, Network};
use crate::pictures::Pictures;
use crate::points::Clouds;
use crate::replicas::Replicas;
use crate::scene::Scene;
use crate::slots::{Flows, Slots};
use crate::states::Level;
use crate::tcp_links::TcpLinks;
use crate::team::{Floor, Incidents, Teams};
use crate::view::{Datum, View, Wish, is};
use rohrpost::interface::Interface;
use rohrpost::interfaces::{CartographerInterface, ControlState};
use rohrpost::output::OutputLine;
use rohrpost::schema::{DataItem, Description};
use rohrpost::types::{LaserScan, OccupancyGrid, Odometry, Pose};

/// All of them; the last wants everything. The floor is that of a team.
pub(crate) fn built_in(floor: Option<Floor>) -> Vec<Box<dyn View>> {
    vec![
        Box::new(Laser),
        Box::new(Wheels),
        Box::new(Mapper),
        Box::new(Localisation),
        Box::new(Pictures),
        Box::new(Clouds),
        Box::new(Teams::on(floor)),
        Box::new(Incidents),
        Box::new(Drivers),
        Box::new(Output),
        // Before the network: of both tabs the first is there.
        Box::new(Replicas::default()),
        Box::new(Network::default()),
        Box::new(Clocks),
        Box::new(TcpLinks::default()),
        Box::new(Slots::default()),
        Box::new(Flows),
        Box::new(OtherData),
    ]
}

/// Scans, from where their scanner stood, or on the robot with the odometry that came first.
struct Laser;

impl View for Laser {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<LaserScan>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let scan: LaserScan = datum.read()?;
        if let Some(pose) = &scan.pose {
            scene.pose(datum.module, pose);
        }
        let carrier = scene.carrier().to_owned();
        scene.scan(datum.module, &scan, &carrier, &Pose::default());
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![Tab::plane("Laser", &["/world/scan/**", "/world/robot/**"])]
    }
}

/// Where the wheels say that the robot is, and how it moves.
struct Wheels;

impl View for Wheels {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<Odometry>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let odometry: Odometry = datum.read()?;
        scene.odometry(datum.module, &odometry);
        scene.motion(datum.module, &odometry.twist);
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![Tab::curves("Wheels", "motion")]
    }
}

/// Maps, tile by tile.
struct Mapper;

impl View for Mapper {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<OccupancyGrid>(item)
    }

    fn wish(&self) -> Wish {
        Wish::each()
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        scene.grid(datum.module, &datum.read::<OccupancyGrid>()?)
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![Tab::plane("Map", &["/world/map/**", "/world/trajectory/**", "/world/robot/**"])]
    }

    fn repair(&self, module: &Description) -> Option<u16> {
        let own = CartographerInterface::description();
        let known = own.function("publish_all").filter(|_| module.hash() == own.hash())?;
        Some(known.number)
    }
}

/// Poses, from the modules with the best estimate of the robot's place.
struct Localisation;

impl View for Localisation {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<Pose>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        scene.pose(datum.module, &datum.read()?);
        Ok(())
    }
}

/// Lines of output. Their place in the layout is always there.
struct Output;

impl View for Output {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<OutputLine>(item)
    }

    fn wish(&self) -> Wish {
        Wish::each()
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        draw_line(scene, datum.installation, &datum.read()?);
        Ok(())
    }
}

/// A line of output at its own time.
pub(crate) fn draw_line(scene: &mut Scene, installation: &rohrpost_config::Installation, line: &OutputLine) {
    scene.set_time(line.time_ns);
    let module = installation.classes.format(line.module());
    scene.output_line(&module, Level::from(line.level), &line.full_text());
}

/// Which program drives: as other data, and at the robot if it is one of a team.
struct Drivers;

impl View for Drivers {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<ControlState>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        scene.control(datum.from.system(), datum.read()?);
        OtherData.draw(scene, datum)
    }

    fn tabs(&self) -> Vec<Tab> {
        OtherData.tabs()
    }
}

/// Everything else: numbers as curves, the rest as text.
pub(crate) struct OtherData;

impl View for OtherData {
    fn wants(&self, _: &Description, _: &DataItem) -> bool {
        true
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        scene.generic(datum.module, &datum.item.field.name, &datum.value()?);
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![Tab::curves_and_lines("Other data", "data")]
    }
}
