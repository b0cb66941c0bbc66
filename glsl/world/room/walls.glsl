// The paper's box: an empty room, each face of it a wall.

// The axis-aligned room that holds the walls.
struct Room {
    vec3 min_corner;
    vec3 max_corner;
};

// One face of the room: a diffuse wall, or an opening.
struct Wall {
    // Into the room.
    vec3 normal;
    // Share of arriving photons that is reflected.
    float albedo;
    vec3 tangent;
    // Exponent of the Phong lobe; below 0 the wall is Lambertian.
    float shininess;
    vec3 bitangent;
    // 1: photons leave the scene here.
    uint is_open;
};
