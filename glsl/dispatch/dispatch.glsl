// Which item an invocation works on: its index in a dispatch that is folded into rows, because a
// device may allow no more than 65 535 work groups along x. The size of a work group is constant 0, which the host sets.
layout(local_size_x_id = 0) in;

uint work_group_index()
{
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

uint invocation_index()
{
    return work_group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}
