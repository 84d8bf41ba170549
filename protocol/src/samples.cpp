// Compiles the vocabulary once, so that its static assertions hold in every build.
#include "abbe/protocol/samples.hpp"
#include "abbe/protocol/rt.hpp"
