//! COCO JSON files with images, annotations with run-length masks, and categories.

use serde_json::{Value, json};

use crate::ground_truth::boxes::VehicleBox;
use crate::rendering::rendered_frame::Labels;
use crate::shapes::material::Semantic;

/// Collects the annotations of many images, which are written to one file.
#[derive(Clone, Debug, Default)]
pub struct CocoAnnotations {
    images: Vec<Value>,
    annotations: Vec<Value>,
}

const CLASSES: [Semantic; 3] = [Semantic::Car, Semantic::Bus, Semantic::Truck];

impl CocoAnnotations {
    /// Adds an image and its visible vehicles. `readout` is the readout of the stream at which the labels were
    /// computed.
    pub fn add(&mut self, file_name: &str, readout: u64, labels: &Labels, boxes: &[VehicleBox]) {
        let image_id = self.images.len() + 1;
        self.images.push(json!({
            "id": image_id, "file_name": file_name, "width": labels.width, "height": labels.height,
            "readout": readout, "t_s": labels.t,
        }));
        for b in boxes {
            let Some([x0, y0, x1, y1]) = b.visible_box else {
                continue;
            };
            self.annotations.push(json!({
                "id": self.annotations.len() + 1,
                "image_id": image_id,
                "category_id": b.class.semantic() as u8,
                "track_id": b.track_id,
                "bbox": [x0, y0, x1 - x0, y1 - y0],
                "amodal_bbox": [b.amodal_box[0], b.amodal_box[1], b.amodal_box[2] - b.amodal_box[0], b.amodal_box[3] - b.amodal_box[1]],
                "area": b.visible_pixels,
                "iscrowd": 0,
                "occlusion": b.occlusion,
                "truncation": b.truncation,
                "segmentation": { "size": [labels.height, labels.width], "counts": run_lengths(labels, b.track_id) },
            }));
        }
    }

    /// Returns the content of the file.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let categories: Vec<Value> = CLASSES
            .iter()
            .map(|c| json!({ "id": *c as u8, "name": c.name(), "supercategory": "vehicle" }))
            .collect();
        json!({ "images": self.images, "annotations": self.annotations, "categories": categories })
    }
}

/// Returns COCO's uncompressed run lengths of vehicle `id`. Pixels are counted column by column. The first run length
/// counts pixels outside the vehicle.
fn run_lengths(labels: &Labels, id: u32) -> Vec<u32> {
    let mut counts = vec![0u32];
    let mut inside = false;
    for column in 0..labels.width {
        for row in 0..labels.height {
            let here = labels.instance[row * labels.width + column] == id;
            if here != inside {
                counts.push(0);
                inside = here;
            }
            if let Some(last) = counts.last_mut() {
                *last += 1;
            }
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use crate::rendering::rendered_frame::Labels;

    #[test]
    fn runs_go_down_the_columns_and_start_with_zeros() {
        let labels = Labels {
            width: 2,
            height: 3,
            t: 0.0,
            depth_m: vec![1.0; 6],
            instance: vec![7, 0, 7, 7, 0, 7],
            semantic: vec![13; 6],
            part: vec![1; 6],
        };
        // The first column of the instance map is 7, 7, 0. The second column is 0, 7, 7.
        assert_eq!(super::run_lengths(&labels, 7), [0, 2, 2, 2]);
        assert_eq!(super::run_lengths(&labels, 1), [6]);
    }
}
