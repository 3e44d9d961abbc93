//! PLY and PCD, binary, little endian.

use super::{MapCell, StaticMap};
use crate::dataset::labels;

impl StaticMap {
    /// PLY: position \[m\], colour, SemanticKITTI's raw id, its share of the points, mean intensity and number of points.
    pub fn to_ply(&self) -> Vec<u8> {
        let header = format!(
            "ply\nformat binary_little_endian 1.0\n\
             comment sdslam static semantic map, {} m voxels, map frame (sensor frame of the first scan)\n\
             comment class: SemanticKITTI raw id; confidence: its share of the points; count: points in the voxel\n\
             element vertex {}\n\
             property float x\nproperty float y\nproperty float z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\n\
             property ushort class\nproperty float confidence\nproperty float intensity\nproperty uint count\n\
             end_header\n",
            self.voxel_m,
            self.cells.len()
        );
        let mut ply = header.into_bytes();
        for cell in &self.cells {
            extend_position(&mut ply, cell);
            ply.extend(labels::colour(cell.class));
            ply.extend((labels::raw_id(cell.class) as u16).to_le_bytes());
            ply.extend(cell.confidence.to_le_bytes());
            ply.extend(cell.intensity.to_le_bytes());
            ply.extend(cell.count.to_le_bytes());
        }
        ply
    }

    /// PCD 0.7: the same; the colour as PCL packs it, 0x00RRGGBB.
    pub fn to_pcd(&self) -> Vec<u8> {
        let cells = self.cells.len();
        let header = format!(
            "# .PCD v0.7 - sdslam static semantic map, {} m voxels\n\
             VERSION 0.7\nFIELDS x y z rgb label confidence intensity count\nSIZE 4 4 4 4 4 4 4 4\n\
             TYPE F F F U U F F U\nCOUNT 1 1 1 1 1 1 1 1\nWIDTH {cells}\nHEIGHT 1\n\
             VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {cells}\nDATA binary\n",
            self.voxel_m
        );
        let mut pcd = header.into_bytes();
        for cell in &self.cells {
            extend_position(&mut pcd, cell);
            let [red, green, blue] = labels::colour(cell.class);
            pcd.extend([blue, green, red, 0]);
            pcd.extend(labels::raw_id(cell.class).to_le_bytes());
            pcd.extend(cell.confidence.to_le_bytes());
            pcd.extend(cell.intensity.to_le_bytes());
            pcd.extend(cell.count.to_le_bytes());
        }
        pcd
    }
}

fn extend_position(bytes: &mut Vec<u8>, cell: &MapCell) {
    cell.position.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
}
