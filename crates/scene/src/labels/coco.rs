//! COCO's JSON: images, annotations with run-length masks, categories.

use serde_json::{Value, json};

use crate::drawing::picture::Labels;
use crate::shapes::material::Semantic;
use crate::truth::boxes::VehicleBox;

/// Collects the annotations of many images into one file.
#[derive(Clone, Debug, Default)]
pub struct Coco {
    images: Vec<Value>,
    annotations: Vec<Value>,
}

const CLASSES: [Semantic; 3] = [Semantic::Car, Semantic::Bus, Semantic::Truck];

impl Coco {
    /// Adds an image with the vehicles that are visible in it; `readout` states
    /// which readout of the stream the labels belong to.
    pub fn add(&mut self, file_name: &str, readout: u64, labels: &Labels, boxes: &[VehicleBox]) {
        let image_id = self.images.len() + 1;
        self.images.push(json!({
            "id": image_id, "file_name": file_name, "width": labels.width, "height": labels.height,
            "readout": readout, "t_s": labels.t,
        }));
        for b in boxes {
            let Some([x0, y0, x1, y1]) = b.visible else {
                continue;
            };
            self.annotations.push(json!({
                "id": self.annotations.len() + 1,
                "image_id": image_id,
                "category_id": b.class.semantic() as u8,
                "track_id": b.track_id,
                "bbox": [x0, y0, x1 - x0, y1 - y0],
                "amodal_bbox": [b.amodal[0], b.amodal[1], b.amodal[2] - b.amodal[0], b.amodal[3] - b.amodal[1]],
                "area": b.visible_pixels,
                "iscrowd": 0,
                "occlusion": b.occlusion,
                "truncation": b.truncation,
                "segmentation": { "size": [labels.height, labels.width], "counts": runs(labels, b.track_id) },
            }));
        }
    }

    /// The file.
    #[must_use]
    pub fn json(&self) -> Value {
        let categories: Vec<Value> = CLASSES
            .iter()
            .map(|c| json!({ "id": *c as u8, "name": c.name(), "supercategory": "vehicle" }))
            .collect();
        json!({ "images": self.images, "annotations": self.annotations, "categories": categories })
    }
}

/// COCO's uncompressed run lengths: column by column, zeros first.
fn runs(labels: &Labels, id: u32) -> Vec<u32> {
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
    use crate::drawing::picture::Labels;

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
        // Columns: 7 7 0 and 0 7 7.
        assert_eq!(super::runs(&labels, 7), [0, 2, 2, 2]);
        assert_eq!(super::runs(&labels, 1), [6]);
    }
}
