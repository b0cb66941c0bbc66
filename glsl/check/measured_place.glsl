// Places without order for measurements: the PCG hash of a number (Jarzynski and Olano 2020). Twin of src/measure/bench/rates.rs.

uint measured_place(uint number)
{
    uint state = number * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}
