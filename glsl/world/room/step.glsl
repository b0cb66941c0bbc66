// One bounce of a photon's path in the paper's room: the next wall, Russian roulette, reflection.

layout(set = 0, binding = 0, scalar) readonly buffer Rooms { Room rooms[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Walls { Wall walls[]; };

#include "world/step.glsl"

Step step_path(inout PhotonState path, uint bounce)
{
    Hit hit = intersect_room(rooms[0], path.position, path.direction, path.wall);
    Wall wall = walls[hit.wall];
    vec3 u = draw_bounce(push.key, path.photon, bounce, path.stream);
    Step taken;
    taken.escaped = wall.is_open != 0;
    taken.alive = !taken.escaped && u.x < wall.albedo;
    taken.stored = taken.alive;
    taken.absorbed = !taken.escaped && !taken.alive;

    vec3 arriving = path.direction;
    path.position = hit.position;
    path.direction = to_world(sample_cosine_hemisphere(u.y, u.z), wall);
    path.wall = hit.wall;
    float weight = view_weight(wall, hit.position, arriving, path.direction, push.eye);
    taken.photon = Photon(hit.position, hit.wall, path.flux, weight, path.photon, bounce);
    note_unless(!taken.alive || (is_finite(hit.position) && is_finite(path.direction) && is_finite(weight)), NONFINITE_PHOTON,
                DOMAIN_PHOTONS, push.key.round, path.photon);
    return taken;
}

Step no_step()
{
    return Step(false, false, false, false, Photon(vec3(0.0), NO_WALL, 0.0, 0.0, 0, 0));
}
