// The paths that a bounce reads, `paths`, and those that it hands to the next, `next_paths`, which the including kernel
// declares.

Path incoming_path(uint index)
{
    uvec4[PATH_WORDS] words;
    for (uint k = 0; k < PATH_WORDS; k++) {
        words[k] = paths[path_word(k, index, push.path_capacity)];
    }
    return unpack_path(words);
}

// Whether another bounce will read what this one hands on.
bool has_next_bounce()
{
    return push.bounce + 1 < push.bounces;
}

// Whether a path has not died there.
bool has_path(uint index)
{
    return paths[path_word(0, index, push.path_capacity)].w != NO_WALL;
}

void store_path(uint place, Path path)
{
    uvec4[PATH_WORDS] words = pack_path(path);
    for (uint k = 0; k < PATH_WORDS; k++) {
        next_paths[path_word(k, place, push.path_capacity)] = words[k];
    }
}

void store_dead_path(uint place)
{
    next_paths[path_word(0, place, push.path_capacity)].w = NO_WALL;
}
