//! Model files: OBJ, MTL and the materials, normals, textures and coordinates that they bring.
