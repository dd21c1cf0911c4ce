//! Tables of numbers: PLY, point clouds, CSV, XYZ and NFF.
