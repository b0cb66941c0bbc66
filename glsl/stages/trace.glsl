// One bounce of every path: intersection, Russian roulette, reflection, store. The including kernel
// chose how survivors are stored.

layout(set = 0, binding = 0, scalar) readonly buffer Rooms { Room rooms[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Walls { Wall walls[]; };

void trace_bounce()
{
    uint index = invocation_index();
    bool entered = index < incoming_count(push.bounce);
    Path path;
    if (entered) {
        path = paths[index];
        entered = path.wall != NO_WALL;
    }

    bool escaped = false;
    bool absorbed = false;
    bool alive = false;
    Photon photon;
    if (entered) {
        Hit hit = intersect_room(rooms[0], path.position, path.direction, path.wall);
        Wall wall = walls[hit.wall];
        vec3 u = draw_bounce(push.key, path.photon, push.bounce, path.stream);
        escaped = wall.is_open != 0;
        alive = !escaped && u.x < wall.albedo;
        absorbed = !escaped && !alive;

        vec3 arriving = path.direction;
        path.position = hit.position;
        path.direction = to_world(sample_cosine_hemisphere(u.y, u.z), wall);
        path.wall = hit.wall;
        float weight = view_weight(wall, hit.position, arriving, path.direction, push.eye);
        photon = Photon(hit.position, hit.wall, path.flux, weight, path.photon, push.bounce);
    }

    note_unless(!alive || (is_finite(photon.position) && is_finite(path.direction) && is_finite(photon.weight)), ODD_PHOTON,
                DOMAIN_PHOTONS, push.key.round, path.photon);
    bool stored = append_survivor(index, photon, path, alive);
    tally(push.bounce, stored, absorbed, escaped, alive && !stored);
}
