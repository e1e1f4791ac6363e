//! Camera and depth sensor of the simulated robot. Each is there if the module has a name of its class, and fills the
//! records of its stream in place.

use super::every::Every;
use crate::settings::{Recorded, has_class};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{CameraInterface, DepthInterface};
use rohrpost_modules::runtime::{Context, ContextError};
use rohrpost_modules::types::PointFormat;
use rohrpost_robot::camera::{CAMERA, SimulatedCamera};
use rohrpost_robot::depth::{DEPTH_SENSOR, SimulatedDepth};
use rohrpost_robot::simulator::Simulator;

/// What a record holds besides pixels or points: five numbers of at most five bytes.
const FRONT_BYTES_MAX: usize = 25;

/// The two sensors.
pub(super) struct Sensors {
    camera: Option<(Every, SimulatedCamera)>,
    depth: Option<(Every, SimulatedDepth)>,
}

impl Sensors {
    /// The sensors for which the module has a name.
    pub(super) fn new(context: &Context, camera_rate_hz: f64, depth_rate_hz: f64) -> Self {
        let (installation, me) = (context.installation(), context.me());
        let module = installation.module(me);
        let is_there = |class| module.is_some_and(|module| has_class(installation, module, class));
        let camera =
            is_there(CameraInterface::CLASS).then(|| (Every::hz(camera_rate_hz), SimulatedCamera::new(CAMERA)));
        let depth =
            is_there(DepthInterface::CLASS).then(|| (Every::hz(depth_rate_hz), SimulatedDepth::new(DEPTH_SENSOR)));
        Self { camera, depth }
    }

    /// Records of their streams.
    pub(super) fn recorded() -> [Recorded; 2] {
        let image_bytes = CAMERA.pixels() * 3 + FRONT_BYTES_MAX;
        let points_bytes = DEPTH_SENSOR.pixels() * PointFormat::Xyz.point_bytes() + FRONT_BYTES_MAX;
        [
            Recorded { class: CameraInterface::CLASS, stream: CameraInterface::IMAGE.name, bytes: image_bytes },
            Recorded { class: DepthInterface::CLASS, stream: DepthInterface::POINTS.name, bytes: points_bytes },
        ]
    }

    /// At other rates from now on.
    pub(super) fn set_rates(&mut self, camera_rate_hz: f64, depth_rate_hz: f64) {
        if let Some((every, _)) = &mut self.camera {
            every.set_hz(camera_rate_hz);
        }
        if let Some((every, _)) = &mut self.depth {
            every.set_hz(depth_rate_hz);
        }
    }

    /// Time is another one.
    pub(super) fn restart(&mut self, now_ns: u64) {
        let camera = self.camera.iter_mut().map(|(every, _)| every);
        let depth = self.depth.iter_mut().map(|(every, _)| every);
        camera.chain(depth).for_each(|every| every.restart(now_ns));
    }

    /// Looks with those that are due.
    pub(super) fn look(
        &mut self,
        context: &mut Context,
        simulator: &Simulator,
        now_ns: u64,
    ) -> Result<(), ContextError> {
        if let Some((every, camera)) = &mut self.camera
            && every.is_due(now_ns)
        {
            let (image, mut open) = (camera.image(), context.begin(CameraInterface::IMAGE, now_ns)?);
            let pixels = open.fill(&image, image.raw_bytes() as usize)?;
            camera.render(simulator.world(), &simulator.true_pose(), pixels);
            open.finish()?;
        }
        if let Some((every, depth)) = &mut self.depth
            && every.is_due(now_ns)
        {
            let (cloud, mut open) = (depth.cloud(), context.begin(DepthInterface::POINTS, now_ns)?);
            let points = open.fill(&cloud, cloud.raw_bytes() as usize)?;
            depth.look(simulator.world(), &simulator.true_pose(), points);
            open.finish()?;
        }
        Ok(())
    }
}
