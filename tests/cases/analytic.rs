//! Pictures against formulas: filters, means of textures and panoramas, lights, samples, depth.
