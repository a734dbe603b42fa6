// One filter's steps, and all that runs them over a log.
#include "../constant_gain.cpp"
#include "../diagnosis.cpp"
#include "../filter.cpp"
#include "../reproduction.cpp"
#include "../smoother.cpp"
