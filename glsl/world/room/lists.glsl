// The paths that a bounce reads, `paths`, and those that it hands to the next, `next_paths`.

// Paths that an invocation takes through a bounce where several share an atomic.
const uint PATHS_EACH = PATHS_TOGETHER;

layout(set = 1, binding = 0, scalar) readonly buffer Paths { uvec4 paths[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer NextPaths { uvec4 next_paths[]; };

PhotonState incoming_path(uint index)
{
    uvec4[PATH_WORDS] words;
    for (uint k = 0; k < PATH_WORDS; k++) {
        words[k] = paths[path_word(k, index, push.path_capacity)];
    }
    return unpack_path(words);
}

// Whether a path has not died there; of those that a bounce has read, and of those that it may read.
bool is_path(PhotonState path)
{
    return path.wall != NO_WALL;
}

bool has_path(uint index)
{
    return paths[path_word(0, index, push.path_capacity)].w != NO_WALL;
}

// A path that has died where it stands.
PhotonState emptied(PhotonState path)
{
    path.wall = NO_WALL;
    return path;
}

void store_path(uint place, PhotonState path)
{
    uvec4[PATH_WORDS] words = pack_path(path);
    for (uint k = 0; k < PATH_WORDS; k++) {
        next_paths[path_word(k, place, push.path_capacity)] = words[k];
    }
}

void store_no_path(uint place)
{
    next_paths[path_word(0, place, push.path_capacity)].w = NO_WALL;
}
