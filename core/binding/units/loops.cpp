// Closed loops and filters, one by one and in lanes.
#include "../batch.cpp"
#include "../effects.cpp"
#include "../lanes.cpp"
#include "../tick.cpp"
