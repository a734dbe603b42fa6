// What shares no templates with filters and loops.
#include "../control.cpp"
#include "../module.cpp"
#include "../readers.cpp"
#include "../rotation.cpp"
#include "../winds.cpp"
