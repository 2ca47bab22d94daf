//! Single images, and folders of images in order.

pub mod folder;
pub mod image_file;
pub(super) mod missing_numbers;
pub mod natural_order;
pub mod still_image;
