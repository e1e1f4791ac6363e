//! The interface that Python wrote, as Rust.

use rohrpost::interface::Interface;

#[allow(dead_code, unreachable_pub, reason = "nothing of it is called here")]
mod made {
    include!("../golden/gripper.rust");
}

pub(super) fn generated_hash() -> u32 {
    made::GripperInterface::description().hash()
}
