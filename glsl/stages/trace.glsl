// One bounce of every path. The including kernel chose how survivors are stored.

void trace_bounce()
{
    uint index = invocation_index();
    Path path;
    Bounced bounced = no_bounce();
    if (index < incoming_count(push.bounce)) {
        path = incoming_path(index);
        if (path.wall != NO_WALL) {
            bounced = bounce_path(path, push.bounce);
        }
    }
    bool stored = append_survivor(index, bounced.photon, path, bounced.alive);
    tally(push.bounce, stored, bounced.absorbed, bounced.escaped, bounced.alive && !stored);
}
