// The paths that a bounce reads, `paths`, and those that it hands to the next, `next_paths`.

// Paths that an invocation takes through a bounce where several share an atomic. A ray through a hierarchy needs the registers of
// more.
const uint PATHS_EACH = 1;

layout(set = 1, binding = 0, scalar) readonly buffer Paths { PhotonState paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextPaths { PhotonState next_paths[]; };

PhotonState incoming_path(uint index)
{
    return paths[index];
}

// Whether a path has not died there; of those that a bounce has read, and of those that it may read.
bool is_path(PhotonState path)
{
    return path.arrival != 0;
}

bool has_path(uint index)
{
    return paths[index].arrival != 0;
}

// A path that has died where it stands.
PhotonState emptied(PhotonState path)
{
    path.arrival = 0;
    return path;
}

void store_path(uint place, PhotonState path)
{
    next_paths[place] = path;
}

void store_no_path(uint place)
{
    next_paths[place].arrival = 0;
}
