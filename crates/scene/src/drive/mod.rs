//! Who drives where: the road, the vehicles, and the camera on one of them.

pub(super) mod camera;
pub(super) mod follow;
pub(super) mod member;
pub(super) mod motion;
pub(super) mod road;
pub(super) mod traffic;
pub(super) mod vehicle;
